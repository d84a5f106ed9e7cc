//! Changes of each curve of a response by the gain, the timing and the offset of a replicate.

use lacuna::data::measurements::Summary;
use lacuna::data::{Coordinates, Layout};
use lacuna_linalg::vector::{add_scaled, dot};

/// Number of kinds of deviation: gain, timing, offset.
pub(super) const KINDS: usize = 3;

/// Least number of measured points of a curve whose gain, timing and offset can be told from noise.
pub(super) const POINTS: usize = 8;

/// Least share of a function's square that the functions before it do not explain.
const OWN: f64 = 0.1;

/// A curve of a response.
pub(super) struct Curve {
    /// Flat indices of its outputs with at least two values.
    pub outputs: Vec<usize>,
    /// Change of each output by a unit of gain, time and offset; `None` if the others explain it.
    functions: [Option<Vec<f64>>; KINDS],
}

impl Curve {
    /// Change of each output by a unit of this kind; zero if the curve does not have it.
    pub fn function(&self, kind: usize) -> impl Iterator<Item = f64> + '_ {
        let function = self.functions[kind].as_deref();
        (0..self.outputs.len()).map(move |i| function.map_or(0.0, |values| values[i]))
    }

    /// Kinds of deviation that the curve has.
    pub fn kinds(&self) -> impl Iterator<Item = usize> + '_ {
        (0..KINDS).filter(|&kind| self.functions[kind].is_some())
    }

    /// Change of the output of a place of the curve by a unit of this kind.
    pub fn at(&self, kind: usize, place: usize) -> f64 {
        self.functions[kind].as_ref().map_or(0.0, |values| values[place])
    }
}

/// Outputs with at least two values of each curve with enough of them, one curve for each combination of labels.
fn measured(layout: &Layout, summaries: &[Summary]) -> Vec<Vec<usize>> {
    if layout.abscissa().is_none() {
        return Vec::new();
    }
    let twice = |indices: Vec<usize>| -> Vec<usize> {
        indices.into_iter().filter(|&i| summaries[i].count >= 2).collect()
    };
    let all = layout.groups().into_iter().map(|group| twice(group.indices));
    all.filter(|outputs| outputs.len() >= POINTS).collect()
}

/// Returns true if there are curves with enough points.
pub(super) fn has_curves(layout: &Layout, summaries: &[Summary]) -> bool {
    !measured(layout, summaries).is_empty()
}

/// The curves with enough points, with a response that is finite.
pub(super) fn curves(layout: &Layout, response: &[f64], summaries: &[Summary]) -> Vec<Curve> {
    let slope = derivative(layout, response);
    let curve = |outputs: Vec<usize>| {
        let of = |all: &[f64]| outputs.iter().map(|&i| all[i]).collect::<Vec<f64>>();
        let functions = [of(response), of(&slope), vec![1.0; outputs.len()]];
        Curve { functions: independent(functions), outputs }
    };
    measured(layout, summaries).into_iter().map(curve).collect()
}

/// Keeps the functions that those before them do not explain.
fn independent(functions: [Vec<f64>; KINDS]) -> [Option<Vec<f64>>; KINDS] {
    let mut known: Vec<Vec<f64>> = Vec::new();
    functions.map(|function| {
        let size = dot(&function, &function);
        let mut left = function.clone();
        for direction in &known {
            let along = dot(direction, &left);
            add_scaled(&mut left, -along, direction);
        }
        let square = dot(&left, &left);
        if square <= OWN * size {
            return None;
        }
        known.push(left.iter().map(|x| x / square.sqrt()).collect());
        Some(function)
    })
}

/// Derivative of a response along its abscissa, by differences of the neighbours.
fn derivative(layout: &Layout, response: &[f64]) -> Vec<f64> {
    let is_grid = |axis: &lacuna::data::Axis| matches!(axis.coordinates, Coordinates::Grid { .. });
    let place = layout.axes.iter().rposition(is_grid);
    let (Some(axis), Some((_, grid, _))) = (place, layout.abscissa()) else {
        return vec![0.0; response.len()];
    };
    let step: usize = layout.axes[axis + 1..].iter().map(lacuna::data::Axis::len).product();
    let last = grid.len() - 1;
    let one = |i: usize| {
        let here = (i / step) % grid.len();
        let (before, after) = (here.saturating_sub(1), (here + 1).min(last));
        if before == after {
            return 0.0;
        }
        let value = |there: usize| response[i + there * step - here * step];
        (value(after) - value(before)) / (grid[after] - grid[before])
    };
    (0..response.len()).map(one).collect()
}
