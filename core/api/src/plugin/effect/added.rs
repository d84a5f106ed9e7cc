//! Effects that add a size times a time history to every curve.

use lacuna_base::data::Layout;
use lacuna_base::matrix::Matrix;

use super::span::grid;

/// Response with `size` times a time history added to every curve; `shape` returns the history at a time index.
pub fn added(
    layout: &Layout,
    response: &[f64],
    size: f64,
    shape: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let times = grid(layout).len().max(1);
    let shape: Vec<f64> = (0..times).map(shape).collect();
    response.iter().zip(shape.iter().cycle()).map(|(y, shape)| y + size * shape).collect()
}

/// Derivatives of the added curve with respect to the effect's unknowns, `outputs x columns`. `row` writes the
/// derivatives at a time index; they are the same for all curves.
pub fn added_slopes(layout: &Layout, columns: usize, row: impl Fn(usize, &mut [f64])) -> Matrix {
    let mut slopes = Matrix::zeros(layout.len(), columns);
    let times = grid(layout).len().max(1);
    let mut of_curve = vec![0.0; times * columns];
    of_curve.chunks_mut(columns).enumerate().for_each(|(i, out)| row(i, out));
    for curve in slopes.as_mut_slice().chunks_mut(times * columns) {
        curve.copy_from_slice(&of_curve[..curve.len()]);
    }
    slopes
}
