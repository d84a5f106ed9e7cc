//! The level at which something is missing: the model, or the measuring chain of one sensor.

use lacuna::plugin::effect::On;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::equality::{Equality, WindowSlopes};
use super::setting::{DriftSetting, DriftingParameter};
use crate::gap::candidates::sensors;
use crate::gap::experiment::{Experiment, MeasuredCurve};
use crate::gap::noise::part::part;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::is_at_floor;

/// The level at which differences are significant.
const LEVEL: f64 = 0.05;

/// Smallest share of the excess misfit at which a sensor dominates it.
const DOMINATES: f64 = 0.6;

/// Number of standard deviations from which an excess misfit is significant.
const CLEAR: f64 = 3.0;

/// A sensor's part of the misfit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MisfitShare {
    /// The sensor: its labels by axis.
    pub on: On,
    /// The share of the excess misfit of all sensors.
    pub share: f64,
    /// The excess misfit, in standard deviations under noise.
    pub excess: f64,
}

/// Level at which something is missing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "level")]
#[schemars(rename = "DriftReading")]
pub enum DriftLevel {
    /// The parameters are equal everywhere, and no sensor stands out.
    None,
    /// The parameters differ, whichever sensor is left out: the physics of the model.
    Model {
        /// Parameters that differ, beginning with the one that alone would explain most of the differences.
        parameters: Vec<String>,
    },
    /// One sensor causes the difference: its measuring chain, or an effect at its place.
    Response {
        /// Sensor: its labels by axis.
        #[schemars(extend("propertyNames" = { "title": "axis" }))]
        on: On,
    },
    /// The parameters differ, and there is only one sensor: the model or its measuring chain.
    Either {
        /// Parameters that differ, beginning with the one that alone would explain most of the differences.
        parameters: Vec<String>,
    },
    /// The effects that were named explain the difference.
    Explained {
        /// Types of the effects.
        by: Vec<String>,
    },
}

impl DriftLevel {
    /// The reading beside effects that have a name, and the same in words: parameters that differ without them are no
    /// sign of anything else.
    pub fn explained(&self, words: &str, by: &[String]) -> (Self, String) {
        if *self == Self::None {
            return (Self::None, words.to_owned());
        }
        let quoted: Vec<String> = by.iter().map(|kind| format!("`{kind}`")).collect();
        let verb = if by.len() == 1 { "explains" } else { "explain" };
        let words = format!(
            "without effects the parameters differ between conditions or windows, or one sensor has most of the misfit; {} {verb} it",
            quoted.join(" and ")
        );
        (Self::Explained { by: by.to_vec() }, words)
    }
}

/// The share of each sensor in the excess misfit, the largest first.
pub(super) fn shares(
    experiment: &Experiment<'_>,
    pieces: &WindowSlopes,
    residual: &[f64],
) -> Vec<MisfitShare> {
    let (left, leverage) = (pieces.rest(residual), pieces.leverage());
    let mut all: Vec<MisfitShare> = sensors(experiment)
        .into_iter()
        .map(|on| {
            let outputs = experiment.curves.iter().filter(|curve| is_of(curve, &on));
            let outputs = outputs.flat_map(|curve| curve.measured.iter());
            let (energy, expected) = outputs.fold((0.0, 0.0), |(energy, expected), &i| {
                (energy + left[i] * left[i], expected + 1.0 - leverage[i])
            });
            let beyond = energy - expected;
            let excess = beyond / (2.0 * f64::max(expected, 1.0)).sqrt();
            MisfitShare { on, share: beyond.max(0.0), excess }
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
pub(super) fn without(setting: &DriftSetting<'_>, sensors: &[MisfitShare]) -> Option<Equality> {
    let first = sensors.first().filter(|_| sensors.len() > 1)?;
    let mut hidden = vec![false; setting.experiment.outputs()];
    for curve in setting.experiment.curves.iter().filter(|curve| is_of(curve, &first.on)) {
        curve.measured.iter().for_each(|&i| hidden[i] = true);
    }
    let (part, noise) = part(setting.experiment, setting.noise, |_, _, i| !hidden[i]);
    let whitener = Whitener::new(&part, &noise, setting.response);
    let stream = setting.stream.named("without");
    let own = DriftSetting { experiment: &part, noise: &noise, stream: &stream, ..*setting };
    own.tests(&whitener).map(|(_, tests)| tests.all)
}

fn is_of(curve: &MeasuredCurve, on: &On) -> bool {
    crate::gap::candidates::place(curve) == *on
}

/// The level at which something is missing, and the same in words.
pub(super) fn read(
    parameters: &[DriftingParameter],
    all: &Equality,
    sensors: &[MisfitShare],
    without: Option<&Equality>,
    simulations: usize,
) -> (DriftLevel, String) {
    let drifts = all.p <= LEVEL;
    let differ = differing(parameters);
    let several = sensors.len() > 1;
    let stands_out = |own: &&MisfitShare| several && own.share >= DOMINATES && own.excess > CLEAR;
    let dominating = sensors.first().filter(stands_out);
    let stays = without.is_none_or(|without| without.p <= LEVEL);
    let named = named(&differ);
    let chain = "check the measuring chain of that sensor before the model";
    let sign = if is_at_floor(all.p, simulations) { "<=" } else { "=" };
    let p = format!("p {sign} {:.3}", all.p);
    match dominating {
        None if !drifts => {
            let words = "the parameters are the same everywhere within noise";
            (DriftLevel::None, format!("{words} (p = {:.2})", all.p))
        }
        Some(own) if !drifts || !stays => {
            let what = if drifts {
                format!("{named} between conditions or windows, but not without")
            } else {
                "the parameters are the same everywhere, and the misfit is that of".to_owned()
            };
            let label = own.on.values().flatten().cloned().collect::<Vec<_>>().join(" ");
            let share = format!("{:.0} % of the excess misfit", 100.0 * own.share);
            let words = format!("{what} `{label}`, which has {share}: {chain}");
            (DriftLevel::Response { on: own.on.clone() }, words)
        }
        _ if several => {
            let words = format!(
                "{named} between conditions or windows ({p}), whichever sensor is left out: physics that the model lacks"
            );
            (DriftLevel::Model { parameters: differ }, words)
        }
        _ => {
            let words = format!(
                "{named} between conditions or windows ({p}); with one sensor this may be its measuring chain or the \
                 model"
            );
            (DriftLevel::Either { parameters: differ }, words)
        }
    }
}

/// The parameters that differ even if all others may differ, beginning with the one that alone explains most.
fn differing(parameters: &[DriftingParameter]) -> Vec<String> {
    let mut order: Vec<&DriftingParameter> = parameters.iter().collect();
    order.sort_by(|a, b| b.explains.total_cmp(&a.explains));
    let differs = |(k, own): &(usize, &&DriftingParameter)| {
        own.equality.p <= LEVEL || *k == 0 && own.alone.p <= LEVEL
    };
    order.iter().enumerate().filter(differs).map(|(_, own)| own.name.clone()).collect()
}

/// The parameters that differ, as the beginning of a sentence.
fn named(differ: &[String]) -> String {
    let quoted: Vec<String> = differ.iter().map(|name| format!("`{name}`")).collect();
    match &quoted[..] {
        [] => "the parameters together differ".to_owned(),
        [one] => format!("{one} differs"),
        all => format!("{} differ", all.join(", ")),
    }
}
