//! A symbolic form of an unlisted effect: few terms of a dictionary, by forward selection.
//!
//! The terms are compared in the metric of the noise, orthogonal to the slopes of the calibrated unknowns. A term acts
//! on all sensors or on one, under all conditions (group sparsity: de Silva et al., Frontiers in Artificial
//! Intelligence 3 (2020) 25). Each further term must gain more than the best of the whole dictionary gains on noise
//! alone, and the gain of the same number of terms on noise alone is stated for comparison. The noise is taken as known
//! here: the tests of [`crate::gap::test`] decide whether there is a gap at all.

use lacuna::math::random::Stream;
use lacuna::plugin::effect::On;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::norm;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::dictionary::{Dictionary, DictionaryTerm, Sharing, short};
use super::selection::{Blocks, Chosen, Metric};
use crate::gap::candidates::{place, sensors};
use crate::gap::system::System;
use crate::gap::system::fit::Fit;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{Region, probability};

/// The largest number of terms.
const TERMS: usize = 3;

/// The level at which a further term is significant.
const LEVEL: f64 = 0.05;

/// The number of simulations of whole selections on noise alone.
const SELECTIONS: usize = 40;

/// A symbolic form of an unlisted effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Symbolic {
    /// The terms, in the order in which they were found.
    pub terms: Vec<SymbolicTerm>,
    /// The sensors on which it was searched for.
    pub sensors: Vec<On>,
    /// The formula of the change of the response, in the language of expressions: `y` is the response, `t` the place on
    /// the last axis, `dy` and `ddy` the derivatives of `y` along it; `[a, b]` has one coefficient per sensor.
    pub form: String,
    /// The form as `expression` effects, if the language of expressions has all its functions: one for all sensors, or
    /// one per sensor if coefficients differ. Empty otherwise.
    pub expressions: Vec<WrittenExpression>,
    /// The gain in log-likelihood over the data of the search.
    pub gain: f64,
    /// The mean gain of the same number of best terms on noise alone, by simulation.
    pub by_chance: f64,
    /// The number of terms that were tried.
    pub tried: usize,
    /// The share of the excess misfit that it explains, minus its expectation under noise alone.
    pub explained: f64,
}

/// One term.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SymbolicTerm {
    /// The functions: one, or sine and cosine.
    pub functions: Vec<String>,
    /// The coefficients on the sensors that have them, in the response's unit per unit of the function; common
    /// coefficients of all sensors have an empty `on`.
    pub coefficients: Vec<Coefficient>,
    /// The gain in log-likelihood when it was added.
    pub gain: f64,
    /// The p-value of that gain against the best term of the dictionary on noise alone.
    pub p: f64,
}

/// The coefficients of a term's functions on a sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    /// The sensor: its labels by axis; empty for all.
    pub on: On,
    /// The coefficients, one per function.
    pub values: Vec<f64>,
    /// The standard deviations of the coefficients.
    pub sd: Vec<f64>,
}

/// An `expression` effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WrittenExpression {
    /// Labels on which it acts, by axis; empty for all.
    pub on: On,
    /// The formula of the response; it is `y` if its first parameter, the size, is zero.
    pub formula: String,
    /// The parameters: name, value, and standard deviation by that of their coefficient.
    pub parameters: Vec<(String, f64, f64)>,
}

/// Searches for a symbolic form of the residual on the sensors of the regions, or on all if there are no regions;
/// `excess` is the energy of the residual minus its expectation under noise. `None` if no term is significant.
pub fn symbolic(
    system: &System<'_>,
    fit: &Fit,
    whitener: &Whitener,
    regions: &[Region],
    excess: f64,
    simulations: usize,
    stream: &Stream,
) -> Option<Symbolic> {
    let experiment = system.experiment;
    let named = regions.iter().flat_map(|region| &region.curves);
    let named: Vec<On> = named.map(|&s| place(&experiment.curves[s])).collect();
    let mut all = sensors(experiment);
    if all.is_empty() {
        all.push(On::new());
    }
    all.retain(|on| named.is_empty() || named.contains(on));
    let dictionary = Dictionary::new(experiment, &fit.at.response, &all)?;
    let mut white = whitener.whiten_rows(&dictionary.rows);
    let scale: Vec<f64> = white.iter_rows().map(|row| norm(row).max(1e-300)).collect();
    for (a, scale) in scale.iter().enumerate() {
        for x in white.row_mut(a) {
            *x /= scale;
        }
    }
    let metric = Metric::new(system, fit)?;
    let rows: Vec<Vec<usize>> = dictionary.candidates.iter().map(|c| c.rows.clone()).collect();
    let values = experiment.curves.iter().filter(|curve| all.contains(&place(curve)));
    let values = values.map(|curve| curve.measured.len()).sum();
    let blocks = Blocks::new(&metric, &white, &rows, values);
    let chosen = select(&blocks, &fit.residual, simulations, stream);
    if chosen.is_empty() {
        return None;
    }
    let own: Vec<usize> = chosen.iter().map(|(chosen, _)| chosen.block).collect();
    let (mut coefficients, mut sd) = blocks.coefficients(&own, &fit.residual)?;
    let used = own.iter().flat_map(|&b| &rows[b]);
    for ((c, s), &a) in coefficients.iter_mut().zip(&mut sd).zip(used) {
        (*c, *s) = (*c / scale[a], *s / scale[a]);
    }
    let mut given = coefficients.into_iter().zip(sd);
    let terms: Vec<SymbolicTerm> = chosen
        .iter()
        .map(|(chosen, p)| {
            let candidate = &dictionary.candidates[chosen.block];
            let mut coefficient = |on: On| {
                let (values, sd) = given.by_ref().take(candidate.parts.len()).unzip();
                Coefficient { on, values, sd }
            };
            let coefficients = match candidate.spread {
                Sharing::All => vec![coefficient(On::new())],
                Sharing::Each => all.iter().cloned().map(&mut coefficient).collect(),
                Sharing::One(sensor) => vec![coefficient(all[sensor].clone())],
            };
            SymbolicTerm {
                functions: candidate.parts.clone(),
                coefficients,
                gain: chosen.gain,
                p: *p,
            }
        })
        .collect();
    let gains: Vec<f64> = (0..SELECTIONS)
        .into_par_iter()
        .map(|b| blocks.gained(&metric.noise(&stream.named("whole").at(b as u64)), own.len()))
        .collect();
    let by_chance = gains.iter().sum::<f64>() / SELECTIONS as f64;
    let gain = chosen.iter().map(|(chosen, _)| chosen.gain).sum::<f64>();
    let candidates: Vec<&DictionaryTerm> = own.iter().map(|&b| &dictionary.candidates[b]).collect();
    Some(Symbolic {
        form: form(&terms),
        expressions: written(&terms, &candidates, &all),
        terms,
        gain,
        by_chance,
        tried: rows.len(),
        explained: (2.0 * (gain - by_chance) / excess.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0),
        sensors: all,
    })
}

/// The terms that gain significantly more than the best of all on noise alone, each in addition to those before, with
/// the p-value of its gain.
fn select(
    blocks: &Blocks<'_>,
    residual: &[f64],
    simulations: usize,
    stream: &Stream,
) -> Vec<(Chosen, f64)> {
    let simulated: Vec<Vec<f64>> =
        (0..simulations).map(|b| blocks.metric.noise(&stream.at(b as u64))).collect();
    let null = blocks.scores_of(&Matrix::from_rows(residual.len(), &simulated));
    let (mut left, scores) = (blocks.whole(), blocks.scores(residual));
    let mut chosen = Vec::new();
    while chosen.len() < TERMS {
        let Some(best) = blocks.best(&left, &scores, residual) else { break };
        let largest: Vec<f64> = simulated
            .par_iter()
            .enumerate()
            .map(|(b, residual)| blocks.best(&left, null.row(b), residual))
            .map(|best| best.map_or(f64::NEG_INFINITY, |best| best.criterion))
            .collect();
        let p = probability(&largest, best.criterion);
        if best.criterion <= 0.0 || p > LEVEL {
            break;
        }
        blocks.take(&mut left, best.block);
        chosen.push((best, p));
    }
    chosen
}

/// The formula of the change of the response.
fn form(terms: &[SymbolicTerm]) -> String {
    let label = |on: &On| on.values().flatten().cloned().collect::<Vec<_>>().join(" ");
    let mut parts = Vec::new();
    for term in terms {
        for (k, function) in term.functions.iter().enumerate() {
            let values: Vec<String> =
                term.coefficients.iter().map(|own| short(own.values[k])).collect();
            parts.push(match (&values[..], &term.coefficients[0].on) {
                ([one], on) if on.is_empty() => format!("{one} * {function}"),
                ([one], on) => format!("{one} * {function} on `{}`", label(on)),
                (several, _) => format!("[{}] * {function}", several.join(", ")),
            });
        }
    }
    parts.join(" + ")
}

/// The terms as `expression` effects: one for all sensors if their coefficients are common, otherwise one per sensor.
fn written(
    terms: &[SymbolicTerm],
    candidates: &[&DictionaryTerm],
    sensors: &[On],
) -> Vec<WrittenExpression> {
    if !candidates.iter().all(|candidate| candidate.expressible) {
        return Vec::new();
    }
    let common = candidates.iter().all(|candidate| candidate.spread == Sharing::All);
    let places = if common && sensors.len() > 1 { vec![On::new()] } else { sensors.to_vec() };
    places.into_iter().filter_map(|on| written_on(terms, on)).collect()
}

fn written_on(terms: &[SymbolicTerm], on: On) -> Option<WrittenExpression> {
    let mut parts: Vec<(&str, f64, f64)> = Vec::new();
    for term in terms {
        let own = term.coefficients.iter().find(|own| own.on.is_empty() || own.on == on);
        let Some(own) = own else { continue };
        for (k, function) in term.functions.iter().enumerate() {
            parts.push((function, own.values[k], own.sd[k]));
        }
    }
    // The first parameter is the size of the sum; the others are relative to it.
    let size = *parts.first()?;
    let mut formula = size.0.to_owned();
    let mut parameters = vec![("size".to_owned(), size.1, size.2)];
    for (k, (function, value, sd)) in parts.iter().enumerate().skip(1) {
        let name = format!("share_{}", k + 1);
        formula += &format!(" + {name} * {function}");
        parameters.push((name, value / size.1, (sd / size.1).abs()));
    }
    Some(WrittenExpression { on, formula: format!("y + size * ({formula})"), parameters })
}
