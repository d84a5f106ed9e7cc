//! Effects that add a size times a shape to every curve.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;

use super::grid;

/// The response with `size` times a shape, which is given by the index of the time, added to every curve.
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

/// The derivatives of the added curve by the effect's unknowns, which `row` writes for the index of a time; all
/// curves have the same.
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
