//! What may be missing inside the model: inputs that the study holds fixed, set free.
//!
//! All candidates of this kind are inputs of one wider forward map, that of the study's parameters and then of
//! the inputs. With every input at the value at which it is absent it is the study's own forward map, so that several of them
//! combine as the model itself combines them.

use super::fit::Fit;
use super::system::System;
use super::with_effects::WithEffects;
use crate::data::{Layout, Unit};
use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::plugin::discrepancy::CommonError;
use crate::plugin::effect::{Description, Placed, Reach, Situation};
use crate::plugin::{Component, Effect, Forward, Hyperparameter};

/// The forward map of the study's parameters and of inputs that the study holds fixed.
pub struct Wide<'a> {
    /// From parameters and then inputs to responses.
    pub forward: Box<dyn Forward + 'a>,
    /// The inputs.
    pub inputs: Vec<Freed>,
    /// Errors of the wide map that all replicates share, beside those of the study's own: for
    /// [`Experiment::common`](super::experiment::Experiment::common).
    pub common: Vec<CommonError>,
}

impl Wide<'_> {
    /// The same with effects on top, whose unknowns stand between the parameters and the inputs.
    pub fn with_effects<'b>(&'b self, effects: Vec<Placed<'b>>) -> Wide<'b> {
        let inputs = self.inputs.len();
        let forward = WithEffects::new(&*self.forward, effects);
        let reordered =
            Reordered { unknowns: forward.dimension() - self.forward.dimension(), inputs, forward };
        let (inputs, common) = (self.inputs.clone(), self.common.clone());
        Wide { forward: Box::new(reordered), inputs, common }
    }
}

/// A forward map whose inputs stand behind the unknowns of the effects on top of it.
struct Reordered<'a> {
    forward: WithEffects<'a>,
    unknowns: usize,
    inputs: usize,
}

impl Reordered<'_> {
    /// Where each number of the map's own point stands.
    fn order(&self) -> Vec<usize> {
        let (whole, behind) = (self.forward.dimension(), self.unknowns + self.inputs);
        let own = 0..whole - behind;
        let inputs = whole - self.inputs..whole;
        let unknowns = own.end..own.end + self.unknowns;
        own.chain(inputs).chain(unknowns).collect()
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
        self.mean_and_jacobian_by(point, &all)
    }

    fn mean_and_jacobian_by(&self, point: &[f64], parameters: &[usize]) -> (Vec<f64>, Matrix) {
        let order = self.order();
        let moved: Vec<f64> = order.iter().map(|&i| point[i]).collect();
        let mut back = vec![0; order.len()];
        order.iter().enumerate().for_each(|(k, &i)| back[i] = k);
        let inner: Vec<usize> = parameters.iter().map(|&i| back[i]).collect();
        self.forward.mean_and_jacobian_by(&moved, &inner)
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}

/// An input of the model that the study holds fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Freed {
    /// The name of the input, which is that of the parameter when it is added to the study.
    pub name: String,
    /// The unit of its values.
    pub unit: Unit,
    /// The value at which the study holds it.
    pub absent: f64,
    /// Where it may lie once it is free.
    pub prior: Distribution,
    /// Values from which a fit finds every mode.
    pub starts: Vec<f64>,
}

impl Freed {
    /// An input whose fits start on both sides of its absent value, as far as the prior goes there.
    pub fn new(name: &str, unit: Unit, absent: f64, prior: Distribution) -> Self {
        // Three sizes a side: what saturates looks different from near and from far.
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

/// A candidate that acts through inputs of the wide forward map, the first being its size.
#[derive(Debug, Clone, PartialEq)]
pub struct Switched {
    /// Its inputs among those of the wide forward map.
    pub places: Vec<usize>,
    /// The same inputs.
    pub inputs: Vec<Freed>,
    /// What it is.
    pub description: Description,
}

impl Component for Switched {}

impl Effect for Switched {
    fn describe(&self) -> Description {
        self.description.clone()
    }

    fn parameters(&self, _layout: &Layout) -> Vec<Hyperparameter> {
        let unknown = |input: &Freed| Hyperparameter {
            name: input.name.clone(),
            symbol: input.name.clone(),
            unit: input.unit.clone(),
            prior: input.prior.clone(),
            log: false,
            start: input.starts.first().copied().unwrap_or(input.absent),
        };
        self.inputs.iter().map(unknown).collect()
    }

    fn absent(&self, _layout: &Layout) -> Vec<f64> {
        self.inputs.iter().map(|input| input.absent).collect()
    }

    /// The response as it is: a system sets the inputs before the model answers.
    fn apply(&self, _layout: &Layout, response: &[f64], _values: &[f64]) -> Vec<f64> {
        response.to_vec()
    }

    fn starts(&self, _layout: &Layout, _situation: &Situation<'_>) -> Vec<Vec<f64>> {
        // What has indices is many candidates in one: the score of each estimates its size.
        let sizes = if self.inputs.len() > 1 { 1 } else { usize::MAX };
        let size = &self.inputs[0];
        let mut all: Vec<Vec<f64>> = size.starts.iter().take(sizes).map(|x| vec![*x]).collect();
        for index in &self.inputs[1..] {
            let with = |first: &Vec<f64>| -> Vec<Vec<f64>> {
                index.starts.iter().map(|x| [&first[..], &[*x]].concat()).collect()
            };
            all = all.iter().flat_map(with).collect();
        }
        all
    }

    fn proposals(&self, _situation: &Situation<'_>) -> Vec<toml::Table> {
        Vec::new()
    }

    fn reach(&self) -> Reach {
        Reach::Whole
    }

    fn switches(&self) -> &[usize] {
        &self.places
    }
}

/// The most settings of indices at which the slope is taken.
const SLOPES: usize = 8;

/// What an effect on the model does per unit of its size, with a start: for each setting of its indices the slope at
/// absence unless they are many, and the change over each start. None where the system has the effect already.
pub(super) fn slopes(
    system: &System<'_>,
    fit: &Fit,
    placed: &Placed<'_>,
    situation: &Situation<'_>,
) -> Vec<(Vec<f64>, Vec<f64>)> {
    let switches = placed.effect.switches();
    if system.effects.iter().any(|e| e.effect.switches().iter().any(|i| switches.contains(i))) {
        return Vec::new();
    }
    let layout = &situation.layouts.blocks[0];
    let absent = placed.absent()[0];
    let starts = placed.effect.starts(layout, situation);
    let with = system.with(placed.clone());
    let at = |own: &[f64]| [&fit.at.point[..], own].concat();
    let responses = with.responses(&starts.iter().map(|own| at(own)).collect::<Vec<_>>());
    let mut seen: Vec<&[f64]> = Vec::new();
    let mut slopes = Vec::new();
    // A slope costs several responses: of many settings the changes alone tell as much.
    let many = starts.len() > SLOPES && starts[0].len() > 1;
    for (start, response) in starts.iter().zip(&responses) {
        if !many && !seen.contains(&&start[1..]) {
            seen.push(&start[1..]);
            let there = with.linearised(&at(&[&[absent], &start[1..]].concat()));
            slopes.push((start.clone(), there.tangents.row(fit.at.point.len()).to_vec()));
        }
        let over = |(y, without): (&f64, &f64)| (y - without) / (start[0] - absent);
        slopes.push((start.clone(), response.iter().zip(&fit.at.response).map(over).collect()));
    }
    let told =
        |slope: &[f64]| slope.iter().all(|x| x.is_finite()) && slope.iter().any(|x| *x != 0.0);
    slopes.retain(|(_, slope)| told(slope));
    slopes
}

#[cfg(test)]
mod tests;
