//! The curves of a response: its values along the last axis, where that is a grid.

use crate::data::{Coordinates, Layout};

/// One curve of a response, such as what one sensor shows over time.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    /// The grid, increasing, in the unit of the axis; one zero where the last axis is no grid.
    pub at: &'a [f64],
    /// The values.
    pub values: &'a [f64],
    /// Its first output.
    pub begin: usize,
}

/// The curves of a response one after another.
pub fn curves<'a>(
    layout: &'a Layout,
    response: &'a [f64],
) -> impl Iterator<Item = Curve<'a>> + use<'a> {
    let at: &[f64] = match layout.axes.last().map(|axis| &axis.coordinates) {
        Some(Coordinates::Grid { values, .. }) => values,
        _ => &[0.0],
    };
    let length = at.len().max(1);
    response.chunks(length).enumerate().map(move |(i, values)| Curve {
        at,
        values,
        begin: i * length,
    })
}

/// The response in which each curve became another one of the same length.
pub fn each_curve(
    layout: &Layout,
    response: &[f64],
    change: impl Fn(&Curve<'_>) -> Vec<f64>,
) -> Vec<f64> {
    curves(layout, response).flat_map(|curve| change(&curve)).collect()
}
