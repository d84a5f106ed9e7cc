//! Effects: named pieces of missing physics.

mod added;
mod curve;
mod placed;
mod span;
mod starts;
mod steps;
mod unknown;

use lacuna_base::data::{Layout, Layouts};
use lacuna_base::matrix::Matrix;
use toml::Table;

use super::{Component, Hyperparameter};

pub use added::{added, added_slopes};
pub use curve::{CurveEffect, Form};
pub use placed::{On, Placed, acts, with_tangents};
pub use span::{Span, each_curve, grid};
pub use starts::{all, apart, propose, signs, spaced, spaced_by_ratio};
pub use steps::{SIMULATED, SMOOTH, by_parameter_steps, by_parameter_steps_of, push_forward_step};
pub use unknown::{Measure, Unknown};

/// One candidate piece of missing physics: on the model's response, or inside the model through its
/// [switches](Effect::switches).
///
/// An effect that is a formula for the response is more easily written as a [`CurveEffect`].
///
/// The first parameter of an effect is its *size*: with the size of [`Effect::absent`] it changes nothing, whatever the
/// others are. The others, its *indices* (a lag, a frequency), determine the kind of change.
pub trait Effect: Component {
    /// Description for the user.
    fn describe(&self) -> Description;

    /// Unknowns of the effect on a response of this layout, with physical limits in their priors; the size comes first.
    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter>;

    /// Values of the parameters at which the effect is absent.
    fn absent(&self, layout: &Layout) -> Vec<f64>;

    /// The response with the effect applied, one value per output.
    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64>;

    /// Derivative of each value of [`Effect::apply`] by each parameter of the effect, `outputs x parameters`; by finite
    /// differences inside the priors' supports unless the effect implements a formula.
    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        by_parameter_steps(self, layout, response, values)
    }

    /// Derivative of [`Effect::apply`] along a direction `tangent` of the response; by a central difference unless the
    /// effect implements a formula.
    fn push_forward(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        push_forward_step(self, layout, response, values, tangent)
    }

    /// The response with the effect applied at a point of the forward map's parameters. Only an effect whose change follows
    /// from the physics of the model depends on the point.
    fn apply_at(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        _point: &[f64],
    ) -> Vec<f64> {
        self.apply(layout, response, values)
    }

    /// Derivative of each value of [`Effect::apply_at`] by each parameter of the effect, `outputs x parameters`.
    fn by_parameters_at(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        _point: &[f64],
    ) -> Matrix {
        self.by_parameters(layout, response, values)
    }

    /// Values of the parameters from which a fit finds every mode of the effect: both signs of the size, and a grid of
    /// the indices so fine that no mode lies in between.
    fn starts(&self, layout: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>>;

    /// Variants of the effect that a search for missing physics should try on these data, each as its options in a
    /// study; empty if there is nothing for the effect to act on.
    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table>;

    /// Curves on which a search may place the effect.
    fn reach(&self) -> Reach {
        Reach::Any
    }

    /// True for physics of the model, which acts before the effects of the measuring chain.
    fn acts_first(&self) -> bool {
        false
    }

    /// Relative error of the size of the effect that its own approximations cause.
    fn relative_error(&self) -> f64 {
        0.0
    }

    /// Names of effects that it looks like to first order: where one of them was not tried, it is not named alone.
    fn looks_like(&self) -> &'static [&'static str] {
        &[]
    }

    /// Inputs of an extended forward map that the parameters of the effect set, in their order, for an effect inside
    /// the model; empty for an effect on the response.
    fn switches(&self) -> &[usize] {
        &[]
    }
}

/// Description of an effect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// Name in plain words, such as `gauge factor`.
    pub title: String,
    /// Formula of the effect.
    pub formula: String,
    /// Source in the literature.
    pub source: String,
}

impl Description {
    /// A description of these words: title, formula and source.
    pub fn new(title: &str, formula: &str, source: &str) -> Self {
        Self { title: title.into(), formula: formula.into(), source: source.into() }
    }
}

/// Curves on which the physics of an effect allows it to act.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// All curves, some, or one.
    Any,
    /// One curve at a time; effects on different curves are independent.
    Single,
    /// All curves together.
    Whole,
}

/// Data for which effects are proposed: response and noise without any effect.
#[derive(Debug, Clone, Copy)]
pub struct Situation<'a> {
    /// Layouts of the responses.
    pub layouts: &'a Layouts,
    /// Calibrated response.
    pub response: &'a [f64],
    /// Standard deviation of one replicate, one value per output.
    pub noise: &'a [f64],
}

impl Situation<'_> {
    /// Root mean square of the response, the scale of its values; one if the response is zero.
    pub fn scale(&self) -> f64 {
        let count = self.response.len().max(1) as f64;
        let scale = (self.response.iter().map(|y| y * y).sum::<f64>() / count).sqrt();
        if scale > 0.0 { scale } else { 1.0 }
    }
}
