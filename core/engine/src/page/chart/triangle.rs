//! Lower triangle of cells: all pairs of quantities, with single quantities on the diagonal.

use super::{Axis, Frame, WIDTH};
use crate::page::svg::{Area, Svg};

/// Cell to be drawn.
pub enum Cell {
    /// One quantity; its axis is labelled only in the last row of the triangle.
    Diagonal {
        /// Index of the quantity.
        index: usize,
        /// Rectangle of the cell.
        area: Area,
        /// Axis of the quantity as shown in this cell.
        shown: Axis,
    },
    /// Two quantities; the axes are already drawn.
    Pair {
        /// Index of the quantity on the horizontal axis.
        x: usize,
        /// Index of the quantity on the vertical axis.
        y: usize,
        /// Frame of the cell.
        frame: Frame,
    },
}

/// Draws the triangle, one quantity per axis; `draw` fills the cells.
pub fn triangle(axes: &[Axis], description: &str, draw: impl Fn(&mut Svg, Cell)) -> String {
    let n = axes.len();
    let grid = Grid::new(n);
    let mut svg = Svg::new(grid.width(), grid.height());
    for y in 0..n {
        for x in 0..=y {
            let area = grid.cell(y, x);
            let shown = axes[x].shown(y + 1 == n);
            if x == y {
                draw(&mut svg, Cell::Diagonal { index: x, area, shown });
                continue;
            }
            let frame = Frame::new(area, &axes[x], &axes[y]);
            frame.axes(&mut svg, &shown, &axes[y].shown(x == 0));
            draw(&mut svg, Cell::Pair { x, y, frame });
        }
    }
    svg.finish(description)
}

/// Square cells of a lower triangle.
struct Grid {
    n: usize,
    side: f64,
    left: f64,
}

impl Grid {
    const GAP: f64 = 24.0;
    /// Smallest side of a cell: more cells make the drawing wider than the page.
    const SMALLEST: f64 = 132.0;

    /// The cells for `n` quantities.
    fn new(n: usize) -> Self {
        let most = if n <= 3 { 210.0 } else { 180.0 };
        let n_float = n.max(1) as f64;
        let side = (WIDTH - 80.0 - Self::GAP * (n_float - 1.0)) / n_float;
        let side = side.clamp(Self::SMALLEST, most);
        let width = side * n_float + Self::GAP * (n_float - 1.0);
        Self { n, side, left: ((WIDTH - width) / 2.0).max(68.0) }
    }

    /// Width of the whole drawing.
    fn width(&self) -> f64 {
        let right = self.cell(0, self.n.max(1) - 1).right() + 12.0;
        right.max(WIDTH)
    }

    /// Height of the whole drawing.
    fn height(&self) -> f64 {
        20.0 + (self.side + Self::GAP) * self.n.max(1) as f64 + 26.0
    }

    /// Rectangle of the cell in this row and column.
    fn cell(&self, row: usize, column: usize) -> Area {
        let step = self.side + Self::GAP;
        let (x, y) = (self.left + step * column as f64, 18.0 + step * row as f64);
        Area::new(x, y, self.side, self.side)
    }
}
