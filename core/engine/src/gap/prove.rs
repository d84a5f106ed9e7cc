//! Proof on held-out data: did the gap shrink?
//!
//! The gap of a response is the root of its whitened mean square misfit to held-out replicates less one, the
//! expectation under pure noise: the part that a perfect model could remove. The part of it that the covariances of the
//! emulator's and the numerical error could explain is given separately. The misfits of one replicate without and with
//! the effects share its noise, so that their difference is far more exact than either: the interval is that of
//! Student's t for the mean of the paired differences, replicates being independent. The differences vary between
//! conditions, so that the variance is that within conditions (stratified sampling; Cochran, Sampling Techniques, 3rd
//! ed., section 5.6).

use lacuna::math::special::student_t_quantile;
use lacuna_linalg::vector::dot;
use serde::{Deserialize, Serialize};

use super::experiment::Experiment;
use super::noise::Noise;
use super::system::whitener::Whitener;

/// The fit of two responses to held-out replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Proof {
    /// The comparison over all conditions.
    pub all: Comparison,
    /// The comparison under each condition.
    pub conditions: Vec<ConditionComparison>,
    /// The root mean square difference from the mean of the replicates, in the response's unit: without and with.
    pub rmse: [f64; 2],
    /// The share of held-out values inside the 95 % band of a replicate, without and with.
    pub coverage: [f64; 2],
    /// The gain in log predictive density of all held-out values by the effects: joint density, noise and emulator's
    /// error in its covariance, unknowns at their best fit.
    pub log_score: f64,
    /// True when the gap shrank: the lower bound of the closed share is above zero, and no condition became
    /// significantly worse.
    pub shrank: bool,
}

/// The comparison under one condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConditionComparison {
    /// The scenario; `None` where the study has none.
    pub scenario: Option<String>,
    /// The comparison over its replicates.
    pub comparison: Comparison,
}

/// The gaps of two responses over some replicates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The gap without the effects, in standard deviations of the noise.
    pub before: f64,
    /// The gap with them.
    pub after: f64,
    /// The share of the squared gap that closed; negative where it grew.
    pub closed: f64,
    /// The lower end of its 95 % interval.
    pub lower: f64,
    /// The upper end.
    pub upper: f64,
    /// The gap without the part that the covariances of the emulator's and the numerical error could explain, before
    /// and after.
    pub beyond_known_errors: Closing,
    /// The number of replicates.
    pub replicates: usize,
}

/// Size of a gap without and with the effects, and the share that closed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Closing {
    /// The gap without the effects, in standard deviations of the noise.
    pub before: f64,
    /// The gap with the effects, in standard deviations of the noise.
    pub after: f64,
    /// The share of the squared gap that closed, and the ends of its 95 % interval.
    pub closed: [f64; 3],
}

/// The misfits of one replicate.
#[derive(Debug, Clone, Copy)]
struct Misfits {
    before: f64,
    after: f64,
    /// Part of the misfits that the known errors of emulator and numerics are expected to cause.
    known: f64,
    values: f64,
}

/// Compares two responses, without and with the effects (one value an output, in the response's unit), with held-out
/// replicates under known noise; `None` without replicates.
pub fn prove(
    held_out: &Experiment<'_>,
    noise: &Noise,
    before: &[f64],
    after: &[f64],
) -> Option<Proof> {
    let by_condition: Vec<Vec<Misfits>> = (0..held_out.conditions.len())
        .map(|c| of_condition(held_out, noise, c, [before, after]))
        .collect();
    let all = Comparison::of(&by_condition)?;
    let conditions: Vec<ConditionComparison> = held_out
        .conditions
        .iter()
        .zip(&by_condition)
        .filter_map(|(condition, misfits)| {
            let comparison = Comparison::of(std::slice::from_ref(misfits))?;
            Some(ConditionComparison { scenario: condition.scenario.clone(), comparison })
        })
        .collect();
    let worse = |comparison: &Comparison| comparison.upper < 0.0;
    let shrank = all.lower > 0.0 && !conditions.iter().any(|c| worse(&c.comparison));
    let (counts, means) = held_out.means();
    let rmse = [before, after].map(|response| {
        let measured = (0..means.len()).filter(|&i| counts[i] > 0.0);
        let (sum, count) = measured.fold((0.0, 0.0), |(sum, count), i| {
            (sum + (means[i] - response[i]).powi(2), count + 1.0)
        });
        (sum / f64::max(count, 1.0)).sqrt()
    });
    let coverage = [before, after].map(|response| coverage(held_out, noise, response));
    // How replicates differ from their mean is the same for both.
    let whitener = Whitener::new(held_out, noise, before);
    let squares = [before, after].map(|response| {
        let misfit: Vec<f64> = means.iter().zip(response).map(|(y, m)| y - m).collect();
        let z = whitener.whiten(&misfit);
        dot(&z, &z)
    });
    let log_score = 0.5 * (squares[0] - squares[1]);
    Some(Proof { all, conditions, rmse, coverage, log_score, shrank })
}

fn of_condition(
    held_out: &Experiment<'_>,
    noise: &Noise,
    c: usize,
    responses: [&[f64]; 2],
) -> Vec<Misfits> {
    let condition = &held_out.conditions[c];
    let mut made: Option<(Vec<bool>, Whitener, f64)> = None;
    let mut misfits = Vec::new();
    for replicate in &condition.replicates {
        let pattern: Vec<bool> = replicate.iter().map(Option::is_some).collect();
        if made.as_ref().is_none_or(|(of, ..)| *of != pattern) {
            let mut alone = vec![Vec::new(); held_out.conditions.len()];
            alone[c] = vec![replicate.clone()];
            let mut one = held_out.with_replicates(alone).remeasured();
            // The noise of the replicates alone is the unit.
            (one.common, one.remainder) = (Vec::new(), Vec::new());
            let own = noise.restricted(held_out, &one);
            let whitener = Whitener::new(&one, &own, responses[0]);
            let known = of_known_errors(held_out, &whitener);
            made = Some((pattern, whitener, known));
        }
        let Some((_, whitener, known)) = &made else { continue };
        let square = |response: &[f64]| {
            let mut difference = vec![0.0; held_out.outputs()];
            for (i, y) in condition.outputs.clone().zip(replicate) {
                difference[i] = y.map_or(0.0, |y| y - response[i]);
            }
            let z = whitener.whiten(&difference);
            dot(&z, &z)
        };
        let values = replicate.iter().flatten().count() as f64;
        let (before, after) = (square(responses[0]), square(responses[1]));
        misfits.push(Misfits { before, after, known: *known, values });
    }
    misfits
}

/// The mean square of white differences that known errors of emulator and numerics make, summed over the values.
fn of_known_errors(held_out: &Experiment<'_>, whitener: &Whitener) -> f64 {
    let factors = held_out.common.iter().map(|error| {
        let white = whitener.whiten_rows(&error.factor.transposed());
        white.as_slice().iter().map(|z| z * z).sum::<f64>()
    });
    // The remainder is white where the innovations of the noise are.
    let scale = whitener.scale();
    let rest = held_out.remainder.iter().zip(&scale).map(|(rest, s)| rest * s * s);
    factors.sum::<f64>() + rest.sum::<f64>()
}

impl Comparison {
    /// The gap beyond the noise of the replicates, and the share of it that closed.
    pub fn closing(&self) -> Closing {
        let closed = [self.closed, self.lower, self.upper];
        Closing { before: self.before, after: self.after, closed }
    }

    /// Of the misfits by condition.
    fn of(conditions: &[Vec<Misfits>]) -> Option<Self> {
        let all: Vec<&Misfits> = conditions.iter().flatten().collect();
        if all.is_empty() {
            return None;
        }
        let count = all.len() as f64;
        let mean = |of: &dyn Fn(&Misfits) -> f64| all.iter().map(|m| of(m)).sum::<f64>() / count;
        let excess_before = mean(&|m| m.before / m.values - 1.0);
        let excess_after = mean(&|m| m.after / m.values - 1.0);
        // Known errors may explain what is left, as far as they go; their covariance is no estimate of what they are.
        let known = mean(&|m| m.known / m.values);
        let explained = known.min(excess_before).min(excess_after).max(0.0);
        let gain = |m: &Misfits| (m.before - m.after) / m.values;
        let mean_gain = mean(&gain);
        let (mut squares, mut freedom) = (0.0, 0.0);
        for own in conditions.iter().filter(|own| own.len() >= 2) {
            let mean = own.iter().map(gain).sum::<f64>() / own.len() as f64;
            squares += own.iter().map(|m| (gain(m) - mean).powi(2)).sum::<f64>();
            freedom += own.len() as f64 - 1.0;
        }
        let half = if freedom > 0.0 {
            student_t_quantile(freedom, 0.975)? * (squares / (freedom * count)).sqrt()
        } else {
            f64::INFINITY
        };
        let closing = |explained: f64| {
            // Where noise hides the gap before, its own size is no scale for what closed.
            let scale = (excess_before - explained).max(mean_gain.abs()).max(1e-12);
            Closing {
                before: (excess_before - explained).max(0.0).sqrt(),
                after: (excess_after - explained).max(0.0).sqrt(),
                closed: [mean_gain, mean_gain - half, mean_gain + half].map(|x| x / scale),
            }
        };
        let Closing { before, after, closed: [closed, lower, upper] } = closing(0.0);
        let beyond_known_errors = closing(explained);
        let replicates = all.len();
        Some(Self { before, after, closed, lower, upper, beyond_known_errors, replicates })
    }
}

/// The share of values within 1.96 standard deviations of a replicate about a response, the emulator's error included.
fn coverage(held_out: &Experiment<'_>, noise: &Noise, response: &[f64]) -> f64 {
    let sd = noise.sd(held_out, response);
    let mut variance: Vec<f64> = sd.iter().map(|s| s * s).collect();
    for (curve, law) in held_out.curves.iter().zip(&noise.curves) {
        for &i in &curve.measured {
            let rest = held_out.remainder.get(i).copied().unwrap_or(0.0);
            variance[i] += rest * law.memory.variance();
        }
    }
    for error in &held_out.common {
        for (v, row) in variance.iter_mut().zip(error.factor.iter_rows()) {
            *v += dot(row, row);
        }
    }
    let (mut inside, mut count) = (0.0, 0.0);
    for condition in &held_out.conditions {
        for replicate in &condition.replicates {
            for (i, y) in condition.outputs.clone().zip(replicate) {
                if let Some(y) = y {
                    count += 1.0;
                    inside +=
                        f64::from(u8::from((y - response[i]).abs() <= 1.96 * variance[i].sqrt()));
                }
            }
        }
    }
    inside / f64::max(count, 1.0)
}
