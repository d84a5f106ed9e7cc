//! Effects written as formulas: from the unknowns, the formula and its derivatives everything else follows.

use lacuna_base::data::Layout;
use lacuna_base::matrix::Matrix;
use lacuna_base::text::problem::Complaints;
use toml::Table;

use super::unknown::{check_priors, hyperparameters};
use super::{Description, Effect, Reach, Situation, Span, Unknown, all, push_forward_step, signs};
use crate::plugin::{Component, Context, Hyperparameter};

/// An effect on the response, written as a formula with unknowns whose priors are options of the effect.
///
/// The checks of the priors, the hyperparameters, the values at absence, the starting points of fits and the derivative
/// along the response follow from the unknowns, the formula and its derivatives: a type with this trait is an
/// [`Effect`].
pub trait CurveEffect: Sized + Send + Sync {
    /// Dependence of the formula on the response.
    const FORM: Form;

    /// Value of the first unknown, the size, at which the effect changes nothing.
    const ABSENT: f64 = 0.0;

    /// Description for the user.
    fn describe(&self) -> Description;

    /// Unknowns of the effect, the size first.
    fn unknowns(&self) -> Vec<Unknown<'_>>;

    /// Response with the effect applied, one value per output; `values` holds one value per unknown.
    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64>;

    /// Derivative of each value of [`CurveEffect::formula`] with respect to each unknown, `outputs x unknowns`.
    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix;

    /// Derivative of [`CurveEffect::formula`] along a direction `tangent` of the response (one value per output): exact
    /// for the forms `Additive` and `Linear`, by a central difference for `Nonlinear` unless the effect implements it.
    fn along(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        match Self::FORM {
            Form::Additive => tangent.to_vec(),
            Form::Linear => self.formula(layout, tangent, values),
            Form::Nonlinear => push_forward_step(self, layout, response, values, tangent),
        }
    }

    /// Sizes from which fits start: on both sides of absence, if the prior allows it.
    fn sizes(&self, _layout: &Layout, _situation: &Situation<'_>) -> Vec<f64> {
        let size = self.unknowns().first().and_then(|size| size.prior.cloned());
        signs(size.as_ref(), Self::ABSENT)
    }

    /// Values of each unknown after the size from which fits start, on a grid so fine that no mode lies in between; all
    /// combinations with the sizes are tried. `None` for a response on which no fit can start.
    fn indices(&self, _layout: &Layout) -> Option<Vec<Vec<f64>>> {
        Some(Vec::new())
    }

    /// Variants of the effect that a search for missing effects should try on such data, each as its options in a
    /// study; empty if there is nothing for the effect to act on.
    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table>;

    /// Curves on which a search may place the effect.
    fn reach(&self) -> Reach {
        Reach::Any
    }

    /// Names of effects that it looks like to first order: where one of them was not tried, it is not named alone.
    fn looks_like(&self) -> &'static [&'static str] {
        &[]
    }

    /// Reports a response that the formula does not suit, such as one without curves, and errors in options other than
    /// priors.
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
    }
}

/// Dependence of an effect's formula on the response `y`, which determines its derivative with respect to the response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `y + f`, with `f` independent of the response.
    Additive,
    /// Linear and homogeneous in the response: `A y`.
    Linear,
    /// Any other dependence.
    Nonlinear,
}

impl<E: CurveEffect> Component for E {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        CurveEffect::check(self, context, complaints);
        check_priors(&self.unknowns(), context.layout, complaints);
    }
}

impl<E: CurveEffect> Effect for E {
    fn describe(&self) -> Description {
        CurveEffect::describe(self)
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        hyperparameters(&self.unknowns(), layout)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        let indices = self.parameters(layout).into_iter().skip(1).map(|index| index.start);
        std::iter::once(Self::ABSENT).chain(indices).collect()
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        self.formula(layout, response, values)
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        self.slopes(layout, response, values)
    }

    fn push_forward(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        self.along(layout, response, values, tangent)
    }

    fn starts(&self, layout: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>> {
        let Some(indices) = self.indices(layout) else { return Vec::new() };
        all(&[vec![self.sizes(layout, situation)], indices].concat())
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        CurveEffect::proposals(self, situation)
    }

    fn reach(&self) -> Reach {
        CurveEffect::reach(self)
    }

    fn looks_like(&self) -> &'static [&'static str] {
        CurveEffect::looks_like(self)
    }
}
