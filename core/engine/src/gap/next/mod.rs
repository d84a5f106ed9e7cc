//! The next data: how many bits further measurements, or runs of the simulator, are expected to give on the name of what is
//! missing, on the parameters, and on a quantity of the response.
//!
//! Each hypothesis is a type of effect at its best fit, or a free form in its place, with a normal posterior of its
//! unknowns, of the errors of emulator and numerics, and of its remainder; these are the same in old data and new. Under it
//! the new data are normal.
//! The bits on the name are the mutual information of hypothesis and new data; those on the parameters are the expected
//! decrease of their entropy, averaged over the hypotheses; those on a quantity are its mutual information with the data
//! (Lindley, Annals of Mathematical Statistics 27 (1956) 986; Chaloner and Verdinelli, Statistical Science 10 (1995) 273).

mod choice;
mod hypothesis;
mod information;
mod options;
mod planned;
mod possible;
mod quantity;
mod rank;
#[cfg(test)]
mod tests;

use lacuna::math::random::Stream;
use serde::{Deserialize, Serialize};

use super::noise::Noise;
use super::search::{Explanation, SearchResult};
use crate::gap::candidates::Candidate;
use crate::gap::experiment::Experiment;
use crate::study::gap::next::{NextKeys, QuantityKeys};

use choice::Choice;
use hypothesis::Hypothesis;
use information::Predicted;
use possible::possible;
use quantity::Functional;

pub use rank::Wanted;

/// The statements of a study about the next data.
#[derive(Debug, Clone, Copy)]
pub struct Wish<'a> {
    /// The options; the usual ones if there are none.
    pub options: &'a [NextKeys],
    /// The quantity.
    pub quantity: Option<&'a QuantityKeys>,
    /// The number of runs with which the surrogate was trained; zero without a surrogate.
    pub runs: usize,
}

/// Information that further data are expected to give.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextData {
    /// Types that the name may be, and that none of them is right, with their posterior probabilities; empty if there is no
    /// choice.
    pub hypotheses: Vec<WeightedName>,
    /// The purpose by which the options are ranked, per cost: the name if there is a choice, or else the quantity if the study states one,
    /// or else the parameters.
    pub ranked_by: Wanted,
    /// Options, best first.
    pub options: Vec<NextOption>,
    /// Names of the options that measure nothing: no curve of the response has their scenario, labels and interval.
    pub without_data: Vec<String>,
}

/// A type of effect with its probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WeightedName {
    /// Type.
    pub kind: String,
    /// Posterior probability: that of the types is shared as the search computed it.
    pub weight: f64,
}

/// Data that could be taken, with the information expected from them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextOption {
    /// Name of the option: as the study states it, or what is taken, in words.
    pub name: String,
    /// Cost.
    pub cost: f64,
    /// Expected bits on the name.
    pub name_bits: f64,
    /// Monte Carlo standard error of `name_bits`.
    pub name_error: f64,
    /// Expected bits on the parameters of the model, averaged over the hypotheses.
    pub parameter_bits: f64,
    /// Expected bits on the quantity; `null` without a quantity.
    pub quantity_bits: Option<f64>,
    /// Monte Carlo standard error of `quantity_bits`.
    pub quantity_error: Option<f64>,
    /// True if the difference to the first option is at most two Monte Carlo standard errors.
    pub equal_to_best: bool,
}

/// The information expected from the options of a study after a search; `None` if a response is not finite or a posterior
/// has no density. `none` is the probability that none of the types is right.
pub fn after<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
    none: Option<f64>,
    wish: Wish<'_>,
    stream: &Stream,
) -> Option<NextData> {
    let all = possible(found, candidates, none);
    let weighted: Vec<(String, f64, Explanation<'_, '_>)> =
        all.iter().map(|own| (own.kind.clone(), own.weight, own.explanation())).collect();
    next(&weighted, &found.noise, wish, stream)
}

/// The options with the information expected from each; `None` if a response is not finite or a posterior has no
/// density. `explanations` are the hypotheses, with name and weight, fitted to the data of one experiment.
pub fn next(
    explanations: &[(String, f64, Explanation<'_, '_>)],
    noise: &Noise,
    wish: Wish<'_>,
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
    let quantity = wish.quantity.map(|keys| Functional::of(keys, experiment));
    let setting = Setting { hypotheses: &hypotheses, weights: &weights, quantity };
    let (all, without_data) = options::options(experiment, noise, wish);
    let each =
        all.iter().enumerate().map(|(i, option)| setting.weigh(option, &stream.at(i as u64)));
    let options: Vec<NextOption> = each.collect::<Option<_>>()?;
    let has_choice = explanations.len() > 1;
    let named = explanations
        .iter()
        .zip(&weights)
        .map(|((kind, _, _), &weight)| WeightedName { kind: kind.clone(), weight });
    let ranked_by = if has_choice {
        Wanted::Name
    } else if wish.quantity.is_some() {
        Wanted::Quantity
    } else {
        Wanted::Parameters
    };
    let hypotheses = if has_choice { named.collect() } else { Vec::new() };
    Some(NextData { hypotheses, ranked_by, options, without_data }.ranked(ranked_by))
}

/// The hypotheses and the quantity with which all options are weighed.
struct Setting<'a> {
    hypotheses: &'a [Hypothesis],
    weights: &'a [f64],
    quantity: Option<Functional>,
}

impl Setting<'_> {
    /// The information expected from an option; `None` if a posterior has no density.
    fn weigh(&self, option: &Choice<'_>, stream: &Stream) -> Option<NextOption> {
        let reference = &self.hypotheses[0];
        let predicted: Vec<Predicted> =
            self.hypotheses.iter().map(|own| option.predicted(own, reference)).collect();
        let known = self.quantity.as_ref();
        let quantities: Option<Vec<_>> =
            known.map(|own| self.hypotheses.iter().map(|h| own.under(h)).collect());
        let bits = information::bits(self.weights, &predicted, quantities.as_deref(), stream)?;
        let each = self.hypotheses.iter().zip(&predicted).map(|(own, new)| own.parameter_bits(new));
        let each: Vec<f64> = each.collect::<Option<_>>()?;
        let mean = self.weights.iter().zip(each).map(|(w, bits)| w * bits).sum::<f64>();
        Some(NextOption {
            name: option.name.clone(),
            cost: option.cost,
            name_bits: bits.name.value,
            name_error: bits.name.error,
            parameter_bits: mean,
            quantity_bits: bits.quantity.map(|own| own.value),
            quantity_error: bits.quantity.map(|own| own.error),
            equal_to_best: false,
        })
    }
}

/// An experiment whose known errors are left out: they are unknowns of the hypotheses.
fn without_errors<'a>(experiment: &Experiment<'a>) -> Experiment<'a> {
    Experiment { common: Vec::new(), ..experiment.clone() }
}
