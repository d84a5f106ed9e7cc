//! Effects: named pieces of missing physics.

mod curves;
mod placed;
mod steps;

pub use curves::{Curve, curves, each_curve};
pub use placed::{On, Placed, acts, with_tangents};
pub use steps::{by_parameter_steps, push_forward_step};

use toml::Table;

use super::{Component, Hyperparameter};
use crate::data::{Layout, Layouts};
use crate::linalg::Matrix;

/// One candidate piece of missing physics: on the model's response, or inside the model through its
/// [switches](Effect::switches).
///
/// Its first parameter is its *size*: with the size of [`Effect::absent`] it changes nothing, whatever
/// the others are. Those, its *indices* (a lag, a frequency), say what kind of change it makes.
pub trait Effect: Component {
    /// What it is, for people.
    fn describe(&self) -> Description;

    /// Its unknowns on a response of this layout, with physical limits in their priors; the size first.
    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter>;

    /// Values of the parameters at which the effect is absent.
    fn absent(&self, layout: &Layout) -> Vec<f64>;

    /// The response with the effect added.
    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64>;

    /// The derivative of each value of [`Effect::apply`] (rows) by each of the effect's parameters (columns), by
    /// differences inside the priors' supports where the effect gives no formula.
    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        by_parameter_steps(self, layout, response, values)
    }

    /// The derivative of [`Effect::apply`] along a direction `tangent` of the response, by a central difference
    /// where the effect gives no formula.
    fn push_forward(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        push_forward_step(self, layout, response, values, tangent)
    }

    /// Values of the parameters from which a fit finds every mode of the effect: both signs of the size, and a grid
    /// of the indices that is fine enough that no mode lies between.
    fn starts(&self, layout: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>>;

    /// The versions of itself that a search for missing effects should try on such data, each as its options in a
    /// study; none when the effect has nothing to act on.
    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table>;

    /// Where a search may place it.
    fn reach(&self) -> Reach {
        Reach::Any
    }

    /// The inputs of a wider forward map that its parameters set, in their order, for an effect on the model; none for
    /// one on the response.
    fn switches(&self) -> &[usize] {
        &[]
    }
}

/// An effect in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// A plain-words name, such as `gauge factor`.
    pub title: String,
    /// The formula.
    pub formula: String,
    /// Where it comes from in the literature.
    pub source: String,
}

/// Where an effect can act, as its physics says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// On every curve, on some, or on one.
    Any,
    /// On one curve at a time: what it says of one says nothing of others.
    Single,
    /// On all curves together.
    Whole,
}

/// The data as they look to one who proposes effects: response and noise without any effect.
#[derive(Debug, Clone, Copy)]
pub struct Situation<'a> {
    /// The shapes of the responses.
    pub layouts: &'a Layouts,
    /// The calibrated response.
    pub response: &'a [f64],
    /// The standard deviation of one replicate, one an output.
    pub noise: &'a [f64],
}

impl Situation<'_> {
    /// The root mean square of the response: what is large in its unit.
    pub fn scale(&self) -> f64 {
        let count = self.response.len().max(1) as f64;
        let scale = (self.response.iter().map(|y| y * y).sum::<f64>() / count).sqrt();
        if scale > 0.0 { scale } else { 1.0 }
    }

    /// The length of the longest curve and the shortest step between two of its points, in the unit of the last axis;
    /// `None` where no curve has two points.
    pub fn duration_and_step(&self) -> Option<(f64, f64)> {
        let curves = self.layouts.parts().flat_map(|(layout, range)| {
            curves(layout, &self.response[range]).map(|curve| curve.at).collect::<Vec<_>>()
        });
        let mut found: Option<(f64, f64)> = None;
        for at in curves.filter(|at| at.len() >= 2) {
            let duration = at[at.len() - 1] - at[0];
            let step = at.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
            let (longest, shortest) = found.unwrap_or((0.0, f64::INFINITY));
            found = Some((longest.max(duration), shortest.min(step)));
        }
        found
    }
}
