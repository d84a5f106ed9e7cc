//! What would tell the members of a class apart.
//!
//! Where one explanation is true, another falls short of its log evidence by half the squared length of `P (m_i - m_j)`: the
//! difference of their whitened responses off what the other's own unknowns, its size among them, can follow. What would
//! be added to the data is weighed by that length with the noise that the data would then have; errors that all replicates
//! share do not average out.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::foretell::Rival;
use crate::gap::candidates::{place, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::fit::precision;
use crate::gap::locate::Projection;
use crate::gap::noise::Noise;
use crate::gap::whitener::Whitener;
use crate::linalg::Matrix;
use crate::plugin::effect::On;

/// The log evidence that tells two explanations apart.
const ENOUGH: f64 = 20.0;

/// The most further replicates that are thought of.
const MOST: usize = 1024;

/// Windows of a condition.
const WINDOWS: usize = 4;

/// Quantiles of the prior to which an input is set.
const SETTINGS: [f64; 2] = [0.05, 0.95];

/// Something that can be measured further.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum What {
    /// Further replicates of a condition.
    Condition {
        /// The scenario's name; `None` where the study has none.
        scenario: Option<String>,
    },
    /// Further measurements by one sensor under all conditions.
    Sensor {
        /// The sensor: its labels by axis.
        on: On,
    },
    /// Further measurements in a window of the last axis under one condition.
    Window {
        /// The scenario's name; `None` where the study has none.
        scenario: Option<String>,
        /// The first and the last place, in the unit of the axis.
        span: (f64, f64),
    },
    /// All conditions again, with an input of the model set to a value that is known.
    Input {
        /// The parameter.
        parameter: String,
        /// The value, in its unit.
        value: f64,
    },
}

/// How well something further would separate a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Separation {
    /// What.
    pub what: What,
    /// The log evidence by which the truth is expected to lead the member that is hardest to tell from it, after as many further
    /// replicates as there are now.
    pub expected: f64,
    /// The number of further replicates after which that is 20; `None` where 1024 are not enough.
    pub replicates: Option<usize>,
}

/// What would separate a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Separations {
    /// The log evidence by which the truth is expected to lead the member that is hardest to tell from it, in data such as these.
    pub now: f64,
    /// What can be measured further, the best first.
    pub ranked: Vec<Separation>,
}

/// Ranks what would separate the members of a class (two at least), each fitted to the data; `None` for fewer, or where a
/// response has no value.
pub fn separate(members: &[Rival<'_, '_>], noise: &Noise) -> Option<Separations> {
    let finite = |m: &Rival<'_, '_>| m.fit.at.response.iter().all(|y| y.is_finite());
    if members.len() < 2 || !members.iter().all(finite) {
        return None;
    }
    let experiment = members[0].system.experiment;
    let (counts, _) = experiment.means();
    let bench = Bench { members, noise, counts, here: members.iter().map(Side::here).collect() };
    let now = bench.lead(&Further::Nothing, 0);
    let mut ranked: Vec<Separation> = bench
        .choices(experiment)
        .into_par_iter()
        .map(|(what, further)| Separation {
            what,
            expected: bench.lead(&further, experiment.most_replicates()),
            replicates: bench.needed(&further),
        })
        .collect();
    let needed = |own: &Separation| own.replicates.unwrap_or(usize::MAX);
    ranked
        .sort_by(|a, b| needed(a).cmp(&needed(b)).then_with(|| b.expected.total_cmp(&a.expected)));
    Some(Separations { now, ranked })
}

/// What is added to the data.
enum Further {
    Nothing,
    /// Replicates of these outputs.
    Outputs(Vec<bool>),
    /// Replicates of all outputs where each member is on this side.
    Elsewhere(Vec<Side>),
}

/// A member's response and slopes at a setting of the inputs.
struct Side {
    response: Vec<f64>,
    tangents: Matrix,
}

impl Side {
    fn here(member: &Rival<'_, '_>) -> Self {
        let at = &member.fit.at;
        Self { response: at.response.clone(), tangents: at.tangents.clone() }
    }

    /// With a parameter set to a value that is known.
    fn with(member: &Rival<'_, '_>, parameter: usize, value: f64) -> Self {
        let mut point = member.fit.at.point.clone();
        point[parameter] = value;
        let mut at = member.system.linearised(&point);
        at.tangents.row_mut(parameter).fill(0.0);
        Self { response: at.response, tangents: at.tangents }
    }

    fn is_finite(&self) -> bool {
        self.response.iter().chain(self.tangents.as_slice()).all(|x| x.is_finite())
    }
}

struct Bench<'a, 'b> {
    members: &'b [Rival<'a, 'b>],
    noise: &'b Noise,
    counts: Vec<f64>,
    here: Vec<Side>,
}

impl Bench<'_, '_> {
    /// What can be measured further.
    fn choices(&self, experiment: &Experiment<'_>) -> Vec<(What, Further)> {
        let mut all = Vec::new();
        let outputs = |own: Vec<usize>| {
            let mut chosen = vec![false; experiment.outputs()];
            for i in own {
                chosen[i] = self.counts[i] > 0.0;
            }
            Further::Outputs(chosen)
        };
        for condition in &experiment.conditions {
            let scenario = || condition.scenario.clone();
            let what = What::Condition { scenario: scenario() };
            all.push((what, outputs(condition.outputs.clone().collect())));
            let curves = &experiment.curves[condition.curves.clone()];
            let places = curves.iter().flat_map(|curve| curve.measured.iter().zip(&curve.at));
            let mut places: Vec<(f64, usize)> = places.map(|(&i, &at)| (at, i)).collect();
            places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let length = places.len().div_ceil(WINDOWS).max(1);
            if places.first().map(|p| p.0) == places.last().map(|p| p.0) {
                continue;
            }
            for window in places.chunks(length) {
                let span = (window[0].0, window[window.len() - 1].0);
                let what = What::Window { scenario: scenario(), span };
                all.push((what, outputs(window.iter().map(|(_, i)| *i).collect())));
            }
        }
        let sensors = sensors(experiment);
        if sensors.len() > 1 {
            for on in sensors {
                let own = experiment.curves.iter().filter(|curve| place(curve) == on);
                let own = own.flat_map(|curve| curve.measured.iter().copied()).collect();
                all.push((What::Sensor { on }, outputs(own)));
            }
        }
        all.extend(self.inputs(experiment));
        all
    }

    /// The inputs of the model at the ends of where it holds.
    fn inputs(&self, experiment: &Experiment<'_>) -> Vec<(What, Further)> {
        let bounds = self.members[0].system.bounds();
        let mut all = Vec::new();
        for (k, parameter) in experiment.parameters.iter().enumerate() {
            for quantile in SETTINGS {
                let value = parameter.prior.quantile(quantile).max(bounds[k].0).min(bounds[k].1);
                let sides: Vec<Side> =
                    self.members.iter().map(|member| Side::with(member, k, value)).collect();
                if sides.iter().all(Side::is_finite) {
                    let what = What::Input { parameter: parameter.name.clone(), value };
                    all.push((what, Further::Elsewhere(sides)));
                }
            }
        }
        all
    }

    /// The lead of the truth over the member that is hardest to tell from it, after so many further replicates.
    fn lead(&self, further: &Further, replicates: usize) -> f64 {
        let n = replicates as f64;
        let here: Vec<f64> = match further {
            Further::Outputs(chosen) => {
                let each = self.counts.iter().zip(chosen);
                each.map(|(count, own)| if *own { count + n } else { *count }).collect()
            }
            _ => self.counts.clone(),
        };
        let there: Vec<f64> =
            self.counts.iter().map(|count| if *count > 0.0 { n } else { 0.0 }).collect();
        let mut least = f64::INFINITY;
        for (j, member) in self.members.iter().enumerate() {
            let (slopes, differences) = match further {
                Further::Elsewhere(sides) if replicates > 0 => {
                    let (a, x) = self.whitened(&self.here, j, &here);
                    let (b, y) = self.whitened(sides, j, &there);
                    (beside(&a, &b), beside(&x, &y))
                }
                _ => self.whitened(&self.here, j, &here),
            };
            let precisions: Vec<f64> = member.system.priors().iter().map(precision).collect();
            let (_, squares) = Projection::off(&slopes, &precisions).rest_of_rows(differences);
            least = squares.into_iter().map(|square| 0.5 * square).fold(least, f64::min);
        }
        least.max(0.0)
    }

    /// The whitened slopes of a member, and the differences of the others' responses from its own.
    fn whitened(&self, sides: &[Side], j: usize, counts: &[f64]) -> (Matrix, Matrix) {
        let experiment = self.members[j].system.experiment;
        let own = &sides[j].response;
        let whitener = Whitener::of_counts(experiment, self.noise, own, counts);
        let others = sides.iter().enumerate().filter(|(i, _)| *i != j).map(|(_, other)| {
            other.response.iter().zip(own).map(|(a, b)| a - b).collect::<Vec<f64>>()
        });
        let differences = Matrix::from_rows(own.len(), others);
        (whitener.whiten_rows(&sides[j].tangents), whitener.whiten_rows(&differences))
    }

    /// The number of further replicates that is enough.
    fn needed(&self, further: &Further) -> Option<usize> {
        let enough = |n: usize| self.lead(further, n) >= ENOUGH;
        if enough(0) {
            return Some(0);
        }
        let mut high = 1;
        while !enough(high) {
            high *= 2;
            if high > MOST {
                return None;
            }
        }
        let mut low = high / 2;
        while high - low > 1 {
            let middle = low.midpoint(high);
            if enough(middle) { high = middle } else { low = middle }
        }
        Some(high)
    }
}

/// Rows of two matrices one after another.
fn beside(a: &Matrix, b: &Matrix) -> Matrix {
    let rows = a.iter_rows().zip(b.iter_rows()).map(|(a, b)| [a, b].concat());
    Matrix::from_rows(a.columns() + b.columns(), rows)
}
