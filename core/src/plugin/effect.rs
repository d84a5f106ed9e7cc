//! Effects: named pieces of missing physics.

use super::{Component, Hyperparameter};
use crate::data::Layout;
use crate::linalg::Matrix;

/// One candidate piece of missing physics that acts on the model's response.
///
/// With all its parameters at [`Effect::absent`] an effect changes nothing.
pub trait Effect: Component {
    /// What it is, for people.
    fn describe(&self) -> Description;

    /// Its unknowns on a response of this layout, with physical limits in their priors.
    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter>;

    /// The values of the parameters at which the effect is absent.
    fn absent(&self, layout: &Layout) -> Vec<f64>;

    /// The response with the effect added.
    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64>;

    /// The derivative of each value of [`Effect::apply`] (rows) by each of the effect's parameters (columns), by
    /// central differences where the effect gives no formula.
    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let mut jacobian = Matrix::zeros(layout.len(), values.len());
        for (j, &value) in values.iter().enumerate() {
            let step = 1e-5 * value.abs().max(1e-6);
            let shifted = |h: f64| {
                let mut moved = values.to_vec();
                moved[j] += h;
                self.apply(layout, response, &moved)
            };
            let (above, below) = (shifted(step), shifted(-step));
            for i in 0..layout.len() {
                jacobian[(i, j)] = (above[i] - below[i]) / (2.0 * step);
            }
        }
        jacobian
    }

    /// The transposed derivative by the response: the product `J' w` where `J` is the derivative of each
    /// value of [`Effect::apply`] by each value of `response`.
    fn pull_back(&self, layout: &Layout, response: &[f64], values: &[f64], w: &[f64]) -> Vec<f64>;
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
