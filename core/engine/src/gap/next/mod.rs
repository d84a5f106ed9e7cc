//! The next measurement: how many bits further replicates are expected to give on the name of what is missing, and on the
//! parameters.
//!
//! Each hypothesis is a type of effect at its best fit, with a normal posterior of its unknowns and of the errors of
//! emulator and numerics, which are the same in old data and new. Under it the new data are normal. The bits on the
//! name are the mutual information of hypothesis and new data; those on the parameters are the expected decrease of
//! the entropy of the model's parameters, averaged over the hypotheses (Lindley, Annals of Mathematical Statistics 27
//! (1956) 986; Chaloner and Verdinelli, Statistical Science 10 (1995) 273).

mod hypothesis;
mod information;
mod options;
#[cfg(test)]
mod tests;

use lacuna::math::random::Stream;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::experiment::Experiment;
use super::noise::Noise;
use super::search::{Explanation, FurtherData};

use hypothesis::Hypothesis;
use information::name_bits;
use options::options;

/// Information that further measurements are expected to give.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NextData {
    /// Types that the name may be, with their posterior probabilities among these; empty if there is no choice.
    pub hypotheses: Vec<WeightedName>,
    /// Options, best first: by the bits on the name, or by those on the parameters if there is no choice of a name.
    pub options: Vec<NextOption>,
}

/// A type of effect with its probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WeightedName {
    /// Type.
    pub kind: String,
    /// Posterior probability among the types listed.
    pub weight: f64,
}

/// Further replicates, with the information expected from them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NextOption {
    /// Measurements; `null` for all that were measured.
    pub what: Option<FurtherData>,
    /// Number of further replicates.
    pub replicates: usize,
    /// Expected bits on the name.
    pub name: f64,
    /// Monte Carlo standard error of `name`.
    pub name_error: f64,
    /// Expected bits on the parameters of the model, averaged over the hypotheses.
    pub parameters: f64,
    /// True if the difference to the first option is at most two Monte Carlo standard errors.
    pub equal_to_best: bool,
}

/// Number of standard errors within which two options count as equal.
const EQUAL: f64 = 2.0;

/// The options with the information expected from each; `None` if a response is not finite or a posterior has no
/// density. `explanations` are the hypotheses, with name and weight, fitted to the data of one experiment.
pub fn next(
    explanations: &[(String, f64, Explanation<'_, '_>)],
    noise: &Noise,
    stream: &Stream,
) -> Option<NextData> {
    let (_, _, first) = explanations.first()?;
    let experiment = first.system.experiment;
    let total: f64 = explanations.iter().map(|(_, weight, _)| weight).sum();
    let weights: Vec<f64> = explanations.iter().map(|(_, weight, _)| weight / total).collect();
    let hypotheses: Vec<Hypothesis> = explanations
        .iter()
        .map(|(_, _, own)| Hypothesis::of(own, &first.fit.at.response, noise))
        .collect::<Option<_>>()?;
    let mut all = Vec::new();
    for (i, option) in options(experiment, noise).into_iter().enumerate() {
        let fields = hypotheses.iter().map(|own| option.predicted(own, &hypotheses[0]));
        let fields: Vec<_> = fields.collect();
        let bits = name_bits(&weights, &fields, &stream.at(i as u64))?;
        let each = hypotheses.iter().zip(&fields).map(|(own, field)| own.parameter_bits(field));
        let each: Vec<f64> = each.collect::<Option<_>>()?;
        all.push(NextOption {
            what: option.what,
            replicates: option.replicates,
            name: bits.value,
            name_error: bits.error,
            parameters: weights.iter().zip(each).map(|(w, bits)| w * bits).sum(),
            equal_to_best: false,
        });
    }
    let named = explanations.iter().zip(&weights);
    let named = named.map(|((kind, _, _), &weight)| WeightedName { kind: kind.clone(), weight });
    let has_choice = explanations.len() > 1;
    Some(NextData {
        hypotheses: if has_choice { named.collect() } else { Vec::new() },
        options: ranked(all, has_choice),
    })
}

/// The options in decreasing order of what is wanted.
fn ranked(mut all: Vec<NextOption>, by_name: bool) -> Vec<NextOption> {
    let wanted = |own: &NextOption| if by_name { own.name } else { own.parameters };
    all.sort_by(|a, b| wanted(b).total_cmp(&wanted(a)).then(b.parameters.total_cmp(&a.parameters)));
    let Some((best, error)) = all.first().map(|first| (wanted(first), first.name_error)) else {
        return all;
    };
    for own in &mut all {
        let error = if by_name { error.hypot(own.name_error) } else { 0.0 };
        own.equal_to_best = best - wanted(own) <= EQUAL * error;
    }
    all
}

/// An experiment whose known errors are left out: they are unknowns of the hypotheses.
fn without_errors<'a>(experiment: &Experiment<'a>) -> Experiment<'a> {
    Experiment { common: Vec::new(), ..experiment.clone() }
}
