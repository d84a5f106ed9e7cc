//! A quantity of the response, as a linear function of the unknowns about the best fit of a hypothesis.

use super::hypothesis::Hypothesis;
use super::planned::is_on;
use crate::gap::experiment::Experiment;
use crate::study::gap::next::{QuantityKeys, Reduction};

/// A quantity: a number to which the values of some outputs are reduced.
pub(super) struct Functional {
    outputs: Vec<usize>,
    of: Reduction,
}

/// A quantity under a hypothesis.
pub(super) struct Linear {
    /// The value at the best fit, in the response's unit.
    pub value: f64,
    /// The derivatives by the unknowns.
    pub slopes: Vec<f64>,
}

impl Functional {
    /// The quantity of an experiment.
    pub fn of(keys: &QuantityKeys, experiment: &Experiment<'_>) -> Self {
        let grid = super::planned::Grid::of(experiment);
        let named = |c: usize| {
            let name = experiment.conditions[c].scenario.as_ref();
            keys.scenarios.is_empty() || name.is_some_and(|name| keys.scenarios.contains(name))
        };
        let curves = experiment.curves.iter();
        let curves = curves.filter(|curve| named(curve.condition) && is_on(curve, &keys.on));
        let outputs = curves.flat_map(|curve| curve.outputs.clone());
        let outputs = outputs.filter(|&i| grid.is_along(i, &keys.along)).collect();
        Self { outputs, of: keys.of }
    }

    /// The quantity under a hypothesis; extremes are those of its best fit.
    pub fn under(&self, own: &Hypothesis) -> Linear {
        let at = |i: usize| own.response[i];
        let most = self.outputs.iter().copied().max_by(|a, b| at(*a).total_cmp(&at(*b)));
        let least = self.outputs.iter().copied().min_by(|a, b| at(*a).total_cmp(&at(*b)));
        let weights: Vec<(usize, f64)> = match self.of {
            Reduction::Mean => {
                self.outputs.iter().map(|&i| (i, 1.0 / self.outputs.len() as f64)).collect()
            }
            Reduction::Largest => most.map(|i| (i, 1.0)).into_iter().collect(),
            Reduction::Smallest => least.map(|i| (i, 1.0)).into_iter().collect(),
            Reduction::Range => {
                most.zip(least).map_or_else(Vec::new, |(a, b)| vec![(a, 1.0), (b, -1.0)])
            }
        };
        let sum = |value: &dyn Fn(usize) -> f64| weights.iter().map(|(i, w)| w * value(*i)).sum();
        let slopes = (0..own.tangents.rows()).map(|j| sum(&|i| own.tangents[(j, i)])).collect();
        Linear { value: sum(&at), slopes }
    }
}
