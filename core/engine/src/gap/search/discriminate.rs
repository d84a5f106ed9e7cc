//! Discrimination: which further data would distinguish the members of a class?
//!
//! If one explanation is true, the log evidence of another is lower by half the squared length of `P (m_i - m_j)`: the
//! difference of their whitened responses, projected onto the complement of the slopes of the other's unknowns, its
//! size among them. Further data are ranked by that length under the noise that all data would then have; the
//! covariance of the emulator's error does not average out.

use lacuna::plugin::effect::On;
use lacuna_linalg::Matrix;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cross_validate::Explanation;
use crate::gap::candidates::{place, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::fit::precision;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::Projection;

/// The log Bayes factor that distinguishes two explanations: 20 to 1, strong evidence (Kass and Raftery, Journal of the
/// American Statistical Association 90 (1995) 773).
const ENOUGH: f64 = 3.0;

/// The largest number of further replicates.
const MOST: usize = 1024;

/// Number of windows per condition.
const WINDOWS: usize = 4;

/// Quantiles of the prior to which an input is set.
const SETTINGS: [f64; 2] = [0.05, 0.95];

/// Further data that could be measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum FurtherData {
    /// Further replicates of a condition.
    Condition {
        /// Name of the scenario; `null` if the study has none.
        scenario: Option<String>,
    },
    /// Further measurements by one sensor under all conditions.
    Sensor {
        /// Sensor: its labels by axis.
        #[schemars(extend("propertyNames" = { "title": "axis" }))]
        on: On,
    },
    /// Further measurements in a window of the last axis under one condition.
    Window {
        /// Name of the scenario; `null` if the study has none.
        scenario: Option<String>,
        /// First and last place of the window, in the unit of the axis.
        span: (f64, f64),
    },
    /// All conditions again, with an input of the model set to a known value.
    Input {
        /// Parameter that is set.
        parameter: String,
        /// Value to which the parameter is set, in its unit.
        value: f64,
    },
}

/// Further data, ranked by how well they discriminate between the members of a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DiscriminatingData {
    /// The data.
    pub what: FurtherData,
    /// Expected log Bayes factor of the true member against the most similar one, after as many further replicates as
    /// there are now.
    pub expected: f64,
    /// Number of further replicates after which the expected log Bayes factor is 20; `None` if 1024 are not enough.
    pub replicates: Option<usize>,
}

/// The data that would discriminate between the members of a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Discrimination {
    /// Expected log Bayes factor of the true member against the most similar one, for data such as these.
    pub now: f64,
    /// The further data, the most discriminating first.
    pub ranked: Vec<DiscriminatingData>,
}

/// Ranks further data by how well they discriminate between the members of a class, each fitted to the data; `None` for
/// fewer than two members, or if a response is not finite.
pub fn discriminate(members: &[Explanation<'_, '_>], noise: &Noise) -> Option<Discrimination> {
    let finite = |m: &Explanation<'_, '_>| m.fit.at.response.iter().all(|y| y.is_finite());
    if members.len() < 2 || !members.iter().all(finite) {
        return None;
    }
    let experiment = members[0].system.experiment;
    let (counts, _) = experiment.means();
    let setting = DiscriminationSetting {
        members,
        noise,
        counts,
        here: members.iter().map(Side::here).collect(),
    };
    let now = setting.lead(&Further::Nothing, 0);
    let mut ranked: Vec<DiscriminatingData> = setting
        .choices(experiment)
        .into_par_iter()
        .map(|(what, further)| DiscriminatingData {
            what,
            expected: setting.lead(&further, experiment.most_replicates()),
            replicates: setting.needed(&further),
        })
        .collect();
    let needed = |own: &DiscriminatingData| own.replicates.unwrap_or(usize::MAX);
    ranked
        .sort_by(|a, b| needed(a).cmp(&needed(b)).then_with(|| b.expected.total_cmp(&a.expected)));
    Some(Discrimination { now, ranked })
}

/// Data that are added to the present ones.
enum Further {
    Nothing,
    /// Replicates of these outputs.
    Outputs(Vec<bool>),
    /// Replicates of all outputs, with the responses of each member given by these sides.
    Elsewhere(Vec<Side>),
}

/// A member's response and slopes at a setting of the inputs.
struct Side {
    response: Vec<f64>,
    tangents: Matrix,
}

impl Side {
    fn here(member: &Explanation<'_, '_>) -> Self {
        let at = &member.fit.at;
        Self { response: at.response.clone(), tangents: at.tangents.clone() }
    }

    /// The side of a member with a parameter set to a known value.
    fn with(member: &Explanation<'_, '_>, parameter: usize, value: f64) -> Self {
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

struct DiscriminationSetting<'a, 'b> {
    members: &'b [Explanation<'a, 'b>],
    noise: &'b Noise,
    counts: Vec<f64>,
    here: Vec<Side>,
}

impl DiscriminationSetting<'_, '_> {
    /// The further measurements that are possible.
    fn choices(&self, experiment: &Experiment<'_>) -> Vec<(FurtherData, Further)> {
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
            let what = FurtherData::Condition { scenario: scenario() };
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
                let what = FurtherData::Window { scenario: scenario(), span };
                all.push((what, outputs(window.iter().map(|(_, i)| *i).collect())));
            }
        }
        let sensors = sensors(experiment);
        if sensors.len() > 1 {
            for on in sensors {
                let own = experiment.curves.iter().filter(|curve| place(curve) == on);
                let own = own.flat_map(|curve| curve.measured.iter().copied()).collect();
                all.push((FurtherData::Sensor { on }, outputs(own)));
            }
        }
        all.extend(self.inputs(experiment));
        all
    }

    /// Inputs of the model, set to the ends of the range in which it is valid.
    fn inputs(&self, experiment: &Experiment<'_>) -> Vec<(FurtherData, Further)> {
        let bounds = self.members[0].system.bounds();
        let mut all = Vec::new();
        for (k, parameter) in experiment.parameters.iter().enumerate() {
            for quantile in SETTINGS {
                let value = parameter.prior.quantile(quantile).max(bounds[k].0).min(bounds[k].1);
                let sides: Vec<Side> =
                    self.members.iter().map(|member| Side::with(member, k, value)).collect();
                if sides.iter().all(Side::is_finite) {
                    let what = FurtherData::Input { parameter: parameter.name.clone(), value };
                    all.push((what, Further::Elsewhere(sides)));
                }
            }
        }
        all
    }

    /// The expected log Bayes factor of the truth over the most similar member, after this number of further
    /// replicates.
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

    /// The number of further replicates at which the log Bayes factor reaches [`ENOUGH`]; `None` above [`MOST`].
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

/// The rows of two matrices one after the other.
fn beside(a: &Matrix, b: &Matrix) -> Matrix {
    let rows = a.iter_rows().zip(b.iter_rows()).map(|(a, b)| [a, b].concat());
    Matrix::from_rows(a.columns() + b.columns(), rows)
}
