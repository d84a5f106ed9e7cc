//! The power of the workflow: effects, pairs, bumps, changes of another form than those of the candidates, and no effect at
//! all are injected into simulated data with the noise of a study's own replicates, and the whole search is run on each.

mod inject;
mod open_world;
pub mod stage;
mod tally;

use lacuna::math::random::Stream;
use lacuna::plugin::effect::On;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;
use serde::{Deserialize, Serialize};

use super::candidates::Candidate;
use super::experiment::Experiment;
use super::noise::Noise;
use super::search::{SearchOptions, Traits, VerdictKind, search, verdict};
use super::system::System;
use super::system::fit::Fit;
use super::system::whitener::Whitener;
use super::test::{Projection, common_error};

pub use inject::outside::{Distributed, Nearest, OtherForm, OutsideKind, Screen, UnlistedShape};
pub use inject::{Bump, Injected, Injection, Outside, inject, plan};
pub use open_world::{OutsideRates, told};
pub use tally::{Alarm, KindRates, Rates, SizeRates, rates};

/// The number and the sizes of injections.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PowerDesign {
    /// The sizes of injected effects: root mean square change of the curves that they touch, before calibration, over
    /// the standard deviation of one replicate's noise there.
    pub ratios: Vec<f64>,
    /// Cases of each type at each size.
    pub repeats: usize,
    /// Cases without an injection.
    pub nothing: usize,
    /// Cases with two effects of the largest size.
    pub pairs: usize,
    /// Cases with a bump on one curve at each size.
    pub bumps: usize,
    /// Cases with a change of another form than those of the candidates, at the largest size.
    pub outside: usize,
}

impl PowerDesign {
    /// A design that determines rates to a few per cent.
    pub fn thorough() -> Self {
        let ratios = vec![0.25, 0.5, 1.0, 2.0];
        Self { ratios, repeats: 10, nothing: 200, pairs: 30, bumps: 20, outside: 200 }
    }

    /// A small design for a first look at the rates.
    pub fn quick() -> Self {
        Self { ratios: vec![0.5, 1.0], repeats: 2, nothing: 40, pairs: 6, bumps: 4, outside: 40 }
    }
}

/// The data, candidates and truth from which cases are made.
#[derive(Clone, Copy)]
pub struct PowerSetting<'a> {
    /// The data whose shape and number of replicates the cases have.
    pub experiment: &'a Experiment<'a>,
    /// The candidates of the search.
    pub candidates: &'a [Candidate],
    /// The levels and limits of the search.
    pub options: SearchOptions,
    /// The calibrated model: the truth of each case without its injection.
    pub fit: &'a Fit,
    /// The noise of its replicates.
    pub noise: &'a Noise,
    /// The place of the sensor of each curve, from 0 to 1.
    pub places: &'a [f64],
    /// The candidates' answer to a change, by linearisation.
    pub screen: &'a Screen,
}

/// The outcome of the search on a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseOutcome {
    /// The number of the case.
    pub case: usize,
    /// The injection.
    pub planted: Injected,
    /// The word of the verdict.
    pub word: VerdictKind,
    /// The effects that explain most: type, place, and the types that cannot be told from it.
    pub effects: Vec<NamedInCase>,
    /// The share of the squared whitened length of the injection that the calibrated parameters absorb.
    pub absorbed: f64,
    /// The overlap of the regions with a bump: intersection over union of sensor and time.
    pub overlap: Option<f64>,
}

/// An effect that the search named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedInCase {
    /// The type.
    pub kind: String,
    /// Labels on which it acts, by axis; empty for all.
    pub on: On,
    /// The types that the data cannot distinguish from it, itself first.
    pub class: Vec<String>,
    /// The quantities from which its probability follows.
    pub traits: Option<Traits>,
}

/// The share above which an injection counts as absorbed by the calibrated parameters.
const ABSORBED: f64 = 0.99;

/// Runs the search on one case; `None` if the injection cannot be made as large as requested.
pub fn run(
    setting: &PowerSetting<'_>,
    case: usize,
    wanted: &Injection,
    stream: &Stream,
) -> Option<CaseOutcome> {
    let PowerSetting { experiment, candidates, options, noise, .. } = *setting;
    let (planted, response) = inject(setting, wanted, &stream.named("plant"))?;
    let absorbed = absorbed(setting, &response);
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
    let starts = [setting.fit.at.point.clone()];
    let found = search(&simulated, candidates, &starts, options, &stream.named("search"))?;
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    let overlap = planted.bump.as_ref().map(|bump| bump.overlap(experiment, &first.regions));
    let verdict = verdict(&found, candidates, options);
    let effects = verdict.effects.into_iter().map(|e| NamedInCase {
        kind: e.kind,
        on: e.on,
        class: e.class,
        traits: e.traits,
    });
    Some(CaseOutcome {
        case,
        planted,
        word: verdict.word,
        effects: effects.collect(),
        absorbed,
        overlap,
    })
}

/// The share of a change of the calibrated response, squared and whitened, that a shift of the parameters reproduces;
/// zero if nothing changes.
fn absorbed(setting: &PowerSetting<'_>, response: &[f64]) -> f64 {
    let PowerSetting { experiment, fit, noise, .. } = *setting;
    let whitener = Whitener::new(experiment, noise, &fit.at.response);
    let change = response.iter().zip(&fit.at.response).map(|(a, b)| a - b);
    let white =
        whitener.whiten_rows(&Matrix::from_rows(response.len(), [change.collect::<Vec<_>>()]));
    let length = dot(white.row(0), white.row(0));
    let system = System::new(experiment, Vec::new());
    let (_, left) = Projection::of(&system, fit).rest_of_rows(white);
    if length > 0.0 { (1.0 - left[0] / length).clamp(0.0, 1.0) } else { 0.0 }
}
