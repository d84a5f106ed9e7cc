//! Candidates that act inside the model through inputs of the extended forward map, and the changes that they make.

use lacuna::data::Layout;
use lacuna::plugin::effect::{Description, Placed, Reach, Situation};
use lacuna::plugin::{Component, Effect, Hyperparameter};

use super::System;
use super::fit::Fit;
use crate::gap::experiment::wider::FreeInput;

/// A candidate that acts through inputs of the extended forward map, the first being its size.
#[derive(Debug, Clone, PartialEq)]
pub struct InputEffect {
    /// The indices of its inputs among those of the extended forward map.
    pub places: Vec<usize>,
    /// The inputs, the size first.
    pub inputs: Vec<FreeInput>,
    /// The description of the effect.
    pub description: Description,
}

impl Component for InputEffect {}

impl Effect for InputEffect {
    fn describe(&self) -> Description {
        self.description.clone()
    }

    fn parameters(&self, _layout: &Layout) -> Vec<Hyperparameter> {
        let unknown = |input: &FreeInput| Hyperparameter {
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

    /// The response is returned unchanged: the system sets the inputs before the model is evaluated.
    fn apply(&self, _layout: &Layout, response: &[f64], _values: &[f64]) -> Vec<f64> {
        response.to_vec()
    }

    fn starts(&self, _layout: &Layout, _situation: &Situation<'_>) -> Vec<Vec<f64>> {
        // A candidate with indices stands for many candidates: the score of each estimates its size.
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

/// Largest number of settings of the indices at which the slope is taken.
const SLOPES: usize = 8;

/// The derivatives of the response by the size of an effect inside the model (one value per output, per unit of size),
/// each with a start: the derivative at absence for each setting of the other inputs, unless there are many, and the
/// difference quotient over each start. Empty if the system already has the effect.
pub fn slopes(
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
    // A derivative costs several responses; with many settings the difference quotients carry the same information.
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
