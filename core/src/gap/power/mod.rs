//! What the workflow would find: effects, pairs, bumps, what no candidate is, and nothing at all, planted in the noise of
//! a study's own replicates, and the whole search run on each.

mod plant;
mod tally;

pub use plant::{Plant, Planted, Shape, plan, plant};
pub use tally::{Alarm, KindRates, Rates, SizeRates, rates};

use serde::{Deserialize, Serialize};

use super::candidates::Candidate;
use super::experiment::Experiment;
use super::fit::Fit;
use super::locate::{Projection, common_error};
use super::name::{Options, Word, search, verdict};
use super::noise::Noise;
use super::system::System;
use super::whitener::Whitener;
use crate::linalg::Matrix;
use crate::linalg::vector::dot;
use crate::math::random::Stream;
use crate::plugin::effect::On;

/// How much is planted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Amount {
    /// The sizes of planted effects: root mean square change of the curves that they touch, before calibration, over the
    /// standard deviation of one replicate's noise there.
    pub ratios: Vec<f64>,
    /// Cases of each type at each size.
    pub repeats: usize,
    /// Cases in which nothing is planted.
    pub nothing: usize,
    /// Cases with two effects of the largest size.
    pub pairs: usize,
    /// Cases with a bump on one curve at each size.
    pub bumps: usize,
    /// Cases with what no candidate is, at the largest size.
    pub unlisted: usize,
}

impl Amount {
    /// What tells rates to a few per cent.
    pub fn thorough() -> Self {
        let ratios = vec![0.25, 0.5, 1.0, 2.0];
        Self { ratios, repeats: 10, nothing: 200, pairs: 30, bumps: 20, unlisted: 40 }
    }

    /// What tells whether the rates are in order.
    pub fn quick() -> Self {
        Self { ratios: vec![0.5, 1.0], repeats: 2, nothing: 40, pairs: 6, bumps: 4, unlisted: 8 }
    }
}

/// What a study's power is found with.
#[derive(Clone, Copy)]
pub struct Ground<'a> {
    /// The data whose shape and number of replicates the cases have.
    pub experiment: &'a Experiment<'a>,
    /// What is tried.
    pub candidates: &'a [Candidate],
    /// How the search judges.
    pub options: Options,
    /// The calibrated model, which is the truth of each case but for what is planted.
    pub fit: &'a Fit,
    /// The noise of its replicates.
    pub noise: &'a Noise,
}

/// What the search said of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The number of the case.
    pub case: usize,
    /// What was planted.
    pub planted: Planted,
    /// The word of the verdict.
    pub word: Word,
    /// The effects that explain most: type, place, and the types that cannot be told from it.
    pub effects: Vec<Said>,
    /// The share of what was planted that the calibrated parameters absorb.
    pub absorbed: f64,
    /// For a bump, the overlap of the places that were found with it: intersection over union of sensor and time.
    pub overlap: Option<f64>,
}

/// An effect that the search named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// Its type.
    pub kind: String,
    /// Where it acts.
    pub on: On,
    /// The types that the data cannot tell from it, itself first.
    pub class: Vec<String>,
}

/// Runs the search on one case; `None` where what should be planted cannot be made so large.
pub fn run(ground: &Ground<'_>, case: usize, wanted: &Plant, stream: &Stream) -> Option<Outcome> {
    let Ground { experiment, candidates, options, fit, noise } = *ground;
    let (planted, response) = plant(ground, wanted, &stream.named("plant"))?;
    let absorbed = absorbed(ground, &response);
    let error = common_error(experiment, noise, &stream.named("common"));
    let mut replicates = noise.simulate(experiment, &response, &stream.named("noise"));
    for (condition, replicates) in experiment.conditions.iter().zip(&mut replicates) {
        for replicate in replicates {
            let errors = &error[condition.outputs.clone()];
            for (y, e) in replicate.iter_mut().zip(errors) {
                *y = y.map(|y| y + e);
            }
        }
    }
    let simulated = experiment.with_replicates(replicates);
    let starts = [fit.at.point.clone()];
    let found = search(&simulated, candidates, &starts, options, &stream.named("search"))?;
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    let overlap = planted.bump.as_ref().map(|bump| bump.overlap(experiment, &first.regions));
    let verdict = verdict(&found, candidates, options);
    let effects = verdict.effects.into_iter();
    Some(Outcome {
        case,
        planted,
        word: verdict.word,
        effects: effects.map(|e| Said { kind: e.kind, on: e.on, class: e.class }).collect(),
        absorbed,
        overlap,
    })
}

/// The share of a change of the calibrated response, squared and whitened, that a shift of the parameters makes too; none
/// where nothing changes.
fn absorbed(ground: &Ground<'_>, response: &[f64]) -> f64 {
    let Ground { experiment, fit, noise, .. } = *ground;
    let whitener = Whitener::new(experiment, noise, &fit.at.response);
    let change = response.iter().zip(&fit.at.response).map(|(a, b)| a - b);
    let white =
        whitener.whiten_rows(&Matrix::from_rows(response.len(), [change.collect::<Vec<_>>()]));
    let length = dot(white.row(0), white.row(0));
    let system = System::new(experiment, Vec::new());
    let (_, left) = Projection::of(&system, fit).rest_of_rows(white);
    if length > 0.0 { (1.0 - left[0] / length).clamp(0.0, 1.0) } else { 0.0 }
}
