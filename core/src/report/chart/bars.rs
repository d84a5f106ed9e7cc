//! Upright bars, alone or in groups, over names or numbers.

use super::{Axis, Frame, WIDTH};
use crate::report::number::{fixed, significant, typeset};
use crate::report::svg::{Anchor, Area, Svg};

/// Bars of one kind, one a name.
#[derive(Debug, Clone, PartialEq)]
pub struct BarSeries {
    /// The class of the bars.
    pub class: &'static str,
    /// What they are.
    pub name: String,
    /// Their heights; one that is not finite is left out.
    pub values: Vec<f64>,
}

/// A level drawn across all bars.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// The class of its line.
    pub class: &'static str,
    /// What it is.
    pub label: String,
    /// Its height.
    pub value: f64,
}

/// A chart of bars.
#[derive(Debug, Clone, PartialEq)]
pub struct BarChart {
    /// The names below the bars.
    pub names: Vec<String>,
    /// Bars beside each other in every name's place.
    pub series: Vec<BarSeries>,
    /// Levels across.
    pub levels: Vec<Level>,
    /// The label of the names.
    pub x_label: String,
    /// The vertical axis.
    pub y: Axis,
    /// The class of a bar that stands out, by the index of its name.
    pub outstanding: Vec<usize>,
    /// Whether the numbers stand on the bars.
    pub numbers: bool,
}

impl BarChart {
    /// The drawing.
    pub fn draw(&self, description: &str) -> String {
        let height = 250.0;
        let area = Area::new(60.0, 20.0, WIDTH - 76.0, height - 64.0);
        let x = Axis::new(self.x_label.as_str(), (0.0, self.names.len().max(1) as f64)).ticks(0);
        let frame = Frame::new(area, &x, &self.y);
        let mut svg = Svg::new(WIDTH, height);
        frame.axes(&mut svg, &x, &self.y);
        self.draw_names(&mut svg, &frame);
        svg.clipped(area, |svg| self.draw_bars(svg, &frame));
        if self.numbers {
            self.draw_numbers(&mut svg, &frame);
        }
        for level in self.levels.iter().filter(|l| l.value.is_finite()) {
            let place = frame.y.place(level.value);
            svg.line(&format!("line {}", level.class), (area.x, place), (area.right(), place));
            let at = (area.right(), area.y - 6.0);
            svg.text(&format!("label {}", level.class), at, Anchor::End, &level.label);
        }
        svg.finish(description)
    }

    fn slot(&self, frame: &Frame) -> f64 {
        frame.area.width / self.names.len().max(1) as f64
    }

    /// The names, as many as fit.
    fn draw_names(&self, svg: &mut Svg, frame: &Frame) {
        let slot = self.slot(frame);
        let longest = self.names.iter().map(|n| n.chars().count()).max().unwrap_or(1);
        let stride = ((longest as f64 * 6.6 + 6.0) / slot).ceil().max(1.0) as usize;
        // Every tenth rather than every seventh.
        let stride = [1, 2, 5, 10, 20, 50].into_iter().find(|&s| s >= stride).unwrap_or(stride);
        // Numbers from one: 10, 20, 30 and not 1, 11, 21.
        for (i, name) in self.names.iter().enumerate().skip(stride - 1).step_by(stride) {
            let at = (frame.area.x + (i as f64 + 0.5) * slot, frame.area.bottom() + 14.0);
            svg.text("tick", at, Anchor::Middle, name);
        }
    }

    fn bar(&self, frame: &Frame, series: usize, name: usize) -> Option<Area> {
        let value = *self.series[series].values.get(name)?;
        let slot = self.slot(frame);
        let gap = if slot > 8.0 { 0.24 } else { 0.1 };
        let width = slot * (1.0 - gap) / self.series.len() as f64;
        let left = frame.area.x + slot * (name as f64 + 0.5 * gap) + width * series as f64;
        let (top, zero) = (frame.y.place(value), frame.y.place(0.0));
        value.is_finite().then(|| Area::new(left, top.min(zero), width, (zero - top).abs()))
    }

    fn draw_bars(&self, svg: &mut Svg, frame: &Frame) {
        for (s, series) in self.series.iter().enumerate() {
            for (i, name) in self.names.iter().enumerate() {
                let Some(area) = self.bar(frame, s, i) else { continue };
                let value = typeset(&significant(series.values[i], 3));
                let hint = format!("{} {name}: {value}", series.name);
                let outstanding = if self.outstanding.contains(&i) { " outstanding" } else { "" };
                let class = format!("bar {}{outstanding}", series.class);
                svg.rectangle(&class, area, hint.trim_start());
            }
        }
    }

    fn draw_numbers(&self, svg: &mut Svg, frame: &Frame) {
        let power = self.y.domain.1.log10().floor();
        let decimals = (2.0 - power).clamp(0.0, 9.0) as usize;
        for (s, series) in self.series.iter().enumerate() {
            for i in 0..self.names.len() {
                let Some(area) = self.bar(frame, s, i) else { continue };
                let text = typeset(&fixed(series.values[i], decimals));
                let at = (area.x + 0.5 * area.width, area.y - 4.0);
                svg.text("bar-number", at, Anchor::Middle, &text);
            }
        }
    }
}
