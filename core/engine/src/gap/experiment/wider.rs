//! The extended forward map: the study's parameters, then inputs of the model that the study holds fixed.
//!
//! With every input at the value at which it has no effect, it equals the study's own forward map. Several candidates
//! inside the model are several inputs of this one map, so that they interact as they do in the model.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Forward;
use lacuna::plugin::discrepancy::CommonError;
use lacuna::plugin::effect::Placed;
use lacuna::plugin::forward::Wanted;
use lacuna_linalg::Matrix;

use super::with_effects::WithEffects;

/// The forward map of the study's parameters and of inputs that the study holds fixed.
pub struct ExtendedMap<'a> {
    /// The forward map: from the parameters, then the inputs, to responses.
    pub forward: Box<dyn Forward + 'a>,
    /// The inputs.
    pub inputs: Vec<FreeInput>,
    /// The covariance of its error, in addition to those of the study's own forward map: for
    /// [`Experiment::common`](crate::gap::experiment::Experiment::common).
    pub common: Vec<CommonError>,
}

impl ExtendedMap<'_> {
    /// The map with effects on its response, whose unknowns lie between the parameters and the inputs.
    pub fn with_effects<'b>(&'b self, effects: Vec<Placed<'b>>) -> ExtendedMap<'b> {
        let inputs = self.inputs.len();
        let forward = WithEffects::new(&*self.forward, effects);
        let reordered =
            Reordered { unknowns: forward.dimension() - self.forward.dimension(), inputs, forward };
        let (inputs, common) = (self.inputs.clone(), self.common.clone());
        ExtendedMap { forward: Box::new(reordered), inputs, common }
    }
}

/// A forward map whose inputs come after the unknowns of the effects on its response.
struct Reordered<'a> {
    forward: WithEffects<'a>,
    unknowns: usize,
    inputs: usize,
}

impl Reordered<'_> {
    /// Index in the reordered point of each entry of the inner map's point.
    fn order(&self) -> Vec<usize> {
        let (whole, behind) = (self.forward.dimension(), self.unknowns + self.inputs);
        let own = 0..whole - behind;
        let inputs = whole - self.inputs..whole;
        let unknowns = own.end..own.end + self.unknowns;
        own.chain(inputs).chain(unknowns).collect()
    }

    /// The point of the inner map, and the columns of these parameters in it.
    fn inner(&self, point: &[f64], parameters: &[usize]) -> (Vec<f64>, Vec<usize>) {
        let order = self.order();
        let moved = order.iter().map(|&i| point[i]).collect();
        let mut back = vec![0; order.len()];
        order.iter().enumerate().for_each(|(k, &i)| back[i] = k);
        (moved, parameters.iter().map(|&i| back[i]).collect())
    }
}

impl Forward for Reordered<'_> {
    fn dimension(&self) -> usize {
        self.forward.dimension()
    }

    fn outputs(&self) -> usize {
        self.forward.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.forward.mean(&points.select_columns(&self.order()))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.mean_and_jacobian(point).1
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let all: Vec<usize> = (0..point.len()).collect();
        self.mean_and_jacobian_by(point, Wanted::by(&all))
    }

    fn mean_at(&self, needed: &[bool], points: &Matrix) -> Matrix {
        self.forward.mean_at(needed, &points.select_columns(&self.order()))
    }

    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        let (point, parameters) = self.inner(point, wanted.parameters);
        self.forward.mean_and_jacobian_by(&point, Wanted { parameters: &parameters, ..wanted })
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}

/// An input of the model that the study holds fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeInput {
    /// The name of the input, which is that of the parameter when it is added to the study.
    pub name: String,
    /// The unit of its values.
    pub unit: Unit,
    /// The value at which the study holds it.
    pub absent: f64,
    /// The prior of the input once it is free.
    pub prior: Distribution,
    /// Start values of fits, in the unit of the input: one near each mode.
    pub starts: Vec<f64>,
}

impl FreeInput {
    /// An input whose fits start on both sides of its absent value, as far as the prior extends there.
    pub fn new(name: &str, unit: Unit, absent: f64, prior: Distribution) -> Self {
        // Three sizes per side, because a saturating effect has different slopes near its absent value and far from it.
        const SIZES: [f64; 3] = [0.1, 0.4, 0.8];
        let side = |low: f64, high: f64| {
            let (from, to) = (prior.cdf(low), prior.cdf(high));
            let wide = to - from > 0.01;
            SIZES.map(|p| prior.quantile(from + p * (to - from))).into_iter().filter(move |_| wide)
        };
        let (low, high) = prior.support();
        let starts: Vec<f64> = side(absent, high)
            .chain(side(low, absent))
            .filter(|x| x.is_finite() && *x != absent)
            .collect();
        Self { name: name.to_owned(), unit, absent, prior, starts }
    }

    /// An input whose fits start from these values.
    #[must_use]
    pub fn starting_from(self, starts: Vec<f64>) -> Self {
        Self { starts, ..self }
    }
}
