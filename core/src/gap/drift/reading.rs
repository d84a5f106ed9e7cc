//! What drifting parameters say: a flaw of the model, or of one sensor's chain.

use serde::{Deserialize, Serialize};

use super::equality::{Equality, Pieces};
use super::map::{Bench, Drifting};
use crate::gap::candidates::sensors;
use crate::gap::experiment::{Curve, Experiment};
use crate::gap::part::part;
use crate::gap::whitener::Whitener;
use crate::plugin::effect::On;

/// Differences less probable than this are real.
const LEVEL: f64 = 0.05;

/// A sensor with this share of the misfit beyond noise dominates it.
const DOMINATES: f64 = 0.6;

/// A misfit beyond noise is real from so many standard deviations on.
const CLEAR: f64 = 3.0;

/// A sensor's part of the misfit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// The sensor: its labels by axis.
    pub on: On,
    /// Its share of the misfit beyond noise of all sensors together.
    pub share: f64,
    /// Its misfit beyond noise, in the standard deviations of what noise makes.
    pub excess: f64,
}

/// At what level something is missing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "level")]
pub enum Reading {
    /// The parameters are the same everywhere, and no sensor stands out.
    None,
    /// The parameters differ, whichever sensor is left out: the model's physics.
    Model {
        /// The parameters that differ, the one first that alone would explain most of the differences.
        parameters: Vec<String>,
    },
    /// One sensor makes the difference: its chain, or what happens at its place.
    Response {
        /// The sensor: its labels by axis.
        on: On,
    },
    /// The parameters differ, and there is one sensor only: either.
    Either {
        /// The parameters that differ.
        parameters: Vec<String>,
    },
}

/// Each sensor's share, the largest first.
pub(super) fn shares(experiment: &Experiment<'_>, pieces: &Pieces, residual: &[f64]) -> Vec<Share> {
    let (left, leverage) = (pieces.rest(residual), pieces.leverage());
    let mut all: Vec<Share> = sensors(experiment)
        .into_iter()
        .map(|on| {
            let outputs = experiment.curves.iter().filter(|curve| is_of(curve, &on));
            let outputs = outputs.flat_map(|curve| curve.measured.iter());
            let (energy, expected) = outputs.fold((0.0, 0.0), |(energy, expected), &i| {
                (energy + left[i] * left[i], expected + 1.0 - leverage[i])
            });
            let beyond = energy - expected;
            let excess = beyond / (2.0 * f64::max(expected, 1.0)).sqrt();
            Share { on, share: beyond.max(0.0), excess }
        })
        .collect();
    let total: f64 = all.iter().map(|own| own.share).sum();
    for own in &mut all {
        own.share /= total.max(f64::MIN_POSITIVE);
    }
    all.sort_by(|a, b| b.share.total_cmp(&a.share));
    all
}

/// The test of equality of all parameters without the sensor of the largest share; `None` with one sensor.
pub(super) fn without(bench: &Bench<'_>, sensors: &[Share]) -> Option<Equality> {
    let first = sensors.first().filter(|_| sensors.len() > 1)?;
    let mut hidden = vec![false; bench.experiment.outputs()];
    for curve in bench.experiment.curves.iter().filter(|curve| is_of(curve, &first.on)) {
        curve.measured.iter().for_each(|&i| hidden[i] = true);
    }
    let (part, noise) = part(bench.experiment, bench.noise, |_, _, i| !hidden[i]);
    let whitener = Whitener::new(&part, &noise, bench.response);
    let stream = bench.stream.named("without");
    let own = Bench { experiment: &part, noise: &noise, stream: &stream, ..*bench };
    own.tests(&whitener).map(|(_, tests)| tests.all)
}

fn is_of(curve: &Curve, on: &On) -> bool {
    crate::gap::candidates::place(curve) == *on
}

/// The reading, and the same in words.
pub(super) fn read(
    parameters: &[Drifting],
    all: &Equality,
    sensors: &[Share],
    without: Option<&Equality>,
) -> (Reading, String) {
    let drifts = all.p <= LEVEL;
    let differ = differing(parameters);
    let several = sensors.len() > 1;
    let stands_out = |own: &&Share| several && own.share >= DOMINATES && own.excess > CLEAR;
    let dominating = sensors.first().filter(stands_out);
    let stays = without.is_none_or(|without| without.p <= LEVEL);
    let named = named(&differ);
    let chain = "look at that sensor's chain before the model";
    match dominating {
        None if !drifts => {
            let words = "the parameters are the same everywhere within noise";
            (Reading::None, format!("{words} (p = {:.2})", all.p))
        }
        Some(own) if !drifts || !stays => {
            let what = if drifts {
                format!("{named} between conditions or windows, but not without")
            } else {
                "the parameters are the same everywhere, and the misfit is that of".to_owned()
            };
            let label = own.on.values().flatten().cloned().collect::<Vec<_>>().join(" ");
            let share = format!("{:.0} % of the misfit beyond noise", 100.0 * own.share);
            let words = format!("{what} `{label}`, which has {share}: {chain}");
            (Reading::Response { on: own.on.clone() }, words)
        }
        _ if several => {
            let words = format!(
                "{named} between conditions or windows (p = {:.3}), and no sensor alone makes the difference: \
                 physics that the model lacks",
                all.p
            );
            (Reading::Model { parameters: differ }, words)
        }
        _ => {
            let words = format!(
                "{named} between conditions or windows (p = {:.3}); with one sensor this may be its chain or the \
                 model",
                all.p
            );
            (Reading::Either { parameters: differ }, words)
        }
    }
}

/// The parameters that differ even when all others may, and the one that alone explains most; the latter first.
fn differing(parameters: &[Drifting]) -> Vec<String> {
    let mut order: Vec<&Drifting> = parameters.iter().collect();
    order.sort_by(|a, b| b.explains.total_cmp(&a.explains));
    let differs =
        |(k, own): &(usize, &&Drifting)| own.equality.p <= LEVEL || *k == 0 && own.alone.p <= LEVEL;
    order.iter().enumerate().filter(differs).map(|(_, own)| own.name.clone()).collect()
}

/// Which parameters differ, as the beginning of a sentence.
fn named(differ: &[String]) -> String {
    let quoted: Vec<String> = differ.iter().map(|name| format!("`{name}`")).collect();
    match &quoted[..] {
        [] => "the parameters together differ".to_owned(),
        [one] => format!("{one} differs"),
        all => format!("{} differ", all.join(", ")),
    }
}
