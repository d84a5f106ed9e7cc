//! Proof on held-out data: did the gap shrink?
//!
//! The gap of a response is the root of its whitened mean square misfit to held-out replicates less one, the
//! expectation under pure noise: the part that a perfect model could remove. The part of it that the covariances of the
//! emulator's and the numerical error could explain is given separately. The misfits of one replicate without and with
//! the effects share its noise, so that their difference is far more exact than either. The share that closed is the
//! ratio of the mean difference to the mean gap without the effects, and its interval is that of Fieller (Journal of the
//! Royal Statistical Society B 16 (1954) 175) for the ratio of two means that are both uncertain: where the gap itself
//! is not significant, no interval exists. Replicates are independent; differences vary between conditions, so that
//! variances are those within conditions (stratified sampling; Cochran, Sampling Techniques, 3rd ed., section 5.6).
//! Replicates are few, so that their variances are moderated by those that the model of the noise gives (Smyth,
//! Statistical Applications in Genetics and Molecular Biology 3 (2004) 3). The noise itself is estimated: an error of its
//! level shifts the gap of all replicates together, so that its variance is not divided by their number.

#[cfg(test)]
mod tests;

use lacuna::math::special::student_t_quantile;
use lacuna_linalg::vector::dot;
use serde::{Deserialize, Serialize};

use super::experiment::{Condition, Experiment};
use super::noise::Noise;
use super::system::whitener::Whitener;

/// The degrees of freedom of the variances that the model of the noise gives.
const MODERATION: f64 = 10.0;

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
    /// The lower end of its 95 % interval; may be infinite if the gap without the effects is not significant.
    pub lower: f64,
    /// The upper end, as the lower one.
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
    /// The squared whitened difference between the responses.
    change: f64,
    /// Part of the misfits that the known errors of emulator and numerics are expected to cause.
    known: f64,
    values: f64,
}

/// The degrees of freedom of the noise that data show, by condition: the differences between replicates; without
/// replicates all values, or infinitely many where the noise is stated.
pub fn freedoms(data: &Experiment<'_>) -> Vec<f64> {
    let (counts, _) = data.means();
    let of = |condition: &Condition| {
        let own = &counts[condition.outputs.clone()];
        let differences: f64 = own.iter().map(|count| (count - 1.0).max(0.0)).sum();
        match (differences > 0.0, data.stated.is_some()) {
            (true, _) => differences,
            (false, true) => f64::INFINITY,
            (false, false) => own.iter().sum(),
        }
    };
    data.conditions.iter().map(of).collect()
}

/// Compares two responses, without and with the effects (one value an output, in the response's unit), with held-out
/// replicates under noise that was estimated with these degrees of freedom, by condition; `None` without replicates.
pub fn prove(
    held_out: &Experiment<'_>,
    noise: &Noise,
    freedoms: &[f64],
    before: &[f64],
    after: &[f64],
) -> Option<Proof> {
    let by_condition: Vec<Vec<Misfits>> = (0..held_out.conditions.len())
        .map(|c| of_condition(held_out, noise, c, [before, after]))
        .collect();
    let level = |freedom: f64| 2.0 / f64::max(freedom, 1.0);
    let all = Comparison::of(&by_condition, level(freedoms.iter().sum()))?;
    let conditions: Vec<ConditionComparison> = held_out
        .conditions
        .iter()
        .zip(by_condition.iter().zip(freedoms))
        .filter_map(|(condition, (misfits, freedom))| {
            let comparison = Comparison::of(std::slice::from_ref(misfits), level(*freedom))?;
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
            (one.common, one.independent) = (Vec::new(), Vec::new());
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
        let mut difference = vec![0.0; held_out.outputs()];
        for (i, _) in condition.outputs.clone().zip(replicate).filter(|(_, y)| y.is_some()) {
            difference[i] = responses[0][i] - responses[1][i];
        }
        let white = whitener.whiten(&difference);
        misfits.push(Misfits { before, after, change: dot(&white, &white), known: *known, values });
    }
    misfits
}

/// The mean square of white differences that known errors of emulator and numerics make, summed over the values.
fn of_known_errors(held_out: &Experiment<'_>, whitener: &Whitener) -> f64 {
    let factors = held_out.common.iter().map(|error| {
        let white = whitener.whiten_rows(&error.factor.transposed());
        white.as_slice().iter().map(|z| z * z).sum::<f64>()
    });
    // Independent errors are white where the innovations of the noise are.
    let scale = whitener.scale();
    let rest = held_out.independent.iter().zip(&scale).map(|(rest, s)| rest * s * s);
    factors.sum::<f64>() + rest.sum::<f64>()
}

impl Comparison {
    /// The gap beyond the noise of the replicates, and the share of it that closed.
    pub fn closing(&self) -> Closing {
        let closed = [self.closed, self.lower, self.upper];
        Closing { before: self.before, after: self.after, closed }
    }

    /// Of the misfits by condition, and the relative variance of the level of the noise.
    fn of(conditions: &[Vec<Misfits>], level: f64) -> Option<Self> {
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
        let mean_gain = mean(&|m| m.gain());
        let spread = Spread::of(conditions, excess_before, excess_after);
        let closing = |explained: f64| {
            // Where noise hides the gap before, its own size is no scale for what closed.
            let scale = (excess_before - explained).max(mean_gain.abs()).max(1e-12);
            let [lower, upper] =
                spread.of_ratio(mean_gain, excess_before - explained, count, level);
            Closing {
                before: (excess_before - explained).max(0.0).sqrt(),
                after: (excess_after - explained).max(0.0).sqrt(),
                closed: [mean_gain / scale, lower, upper],
            }
        };
        let Closing { before, after, closed: [closed, lower, upper] } = closing(0.0);
        let beyond_known_errors = closing(explained);
        let replicates = all.len();
        Some(Self { before, after, closed, lower, upper, beyond_known_errors, replicates })
    }
}

impl Misfits {
    /// The squared misfit that the effects remove, per value.
    fn gain(&self) -> f64 {
        (self.before - self.after) / self.values
    }
}

/// The covariance of gain and squared misfit per value of one replicate: variances and covariance, with its degrees of
/// freedom.
#[derive(Debug, Clone, Copy)]
struct Spread {
    gain: f64,
    before: f64,
    both: f64,
    freedom: f64,
}

impl Spread {
    /// Of the misfits by condition, with the mean excesses without and with the effects.
    ///
    /// White noise `z` about the gaps `a` without and `b` with the effects has the squared misfits `|z + a|^2` and
    /// `|z + b|^2`: the first has the variance `2 n + 4 |a|^2`, their difference `4 |a - b|^2`, and both together
    /// `4 a (a - b)`.
    fn of(conditions: &[Vec<Misfits>], excess_before: f64, excess_after: f64) -> Self {
        let all: Vec<&Misfits> = conditions.iter().flatten().collect();
        let mean = |of: &dyn Fn(&Misfits) -> f64| {
            all.iter().map(|m| of(m)).sum::<f64>() / all.len() as f64
        };
        let [a, b] = [excess_before, excess_after].map(|excess| excess.max(0.0));
        let product = |m: &Misfits| 0.5 * (m.values * (a - b) + m.change);
        let expected = Self {
            gain: mean(&|m| 4.0 * m.change / m.values.powi(2)),
            before: mean(&|m| (2.0 + 4.0 * a) / m.values),
            both: mean(&|m| 4.0 * product(m) / m.values.powi(2)),
            freedom: MODERATION,
        };
        let mut seen = Self { gain: 0.0, before: 0.0, both: 0.0, freedom: 0.0 };
        for own in conditions.iter().filter(|own| own.len() >= 2) {
            let of = |value: &dyn Fn(&Misfits) -> f64| {
                let mean = own.iter().map(value).sum::<f64>() / own.len() as f64;
                own.iter().map(|m| value(m) - mean).collect::<Vec<f64>>()
            };
            let (gains, squares) = (of(&Misfits::gain), of(&|m| m.before / m.values));
            seen.gain += dot(&gains, &gains);
            seen.before += dot(&squares, &squares);
            seen.both += dot(&gains, &squares);
            seen.freedom += own.len() as f64 - 1.0;
        }
        let freedom = expected.freedom + seen.freedom;
        let moderated = |expected: f64, seen: f64| (MODERATION * expected + seen) / freedom;
        Self {
            gain: moderated(expected.gain, seen.gain),
            before: moderated(expected.before, seen.before),
            both: moderated(expected.both, seen.both),
            freedom,
        }
    }

    /// Fieller's 95 % interval of the ratio of a mean gain to a mean gap over so many replicates, with noise of this
    /// relative variance of its level. Where the gap is not significant, one end at least is infinite; the other follows
    /// from the sign of the gain, if that is known.
    fn of_ratio(&self, gain: f64, gap: f64, count: f64, level: f64) -> [f64; 2] {
        let nothing = [f64::NEG_INFINITY, f64::INFINITY];
        let Some(t) = student_t_quantile(self.freedom, 0.975) else { return nothing };
        let whole = 1.0 + gap;
        let before = t * t * (self.before / count + level * whole * whole);
        let both = t * t * (self.both / count + level * gain * whole);
        let of_gain = t * t * (self.gain / count + level * gain * gain);
        let (square, product) = (gap * gap - before, gap * gain - both);
        let root = product * product - square * (gain * gain - of_gain);
        if gap > 0.0 && square > 0.0 && root >= 0.0 {
            return [-1.0, 1.0].map(|sign| (product + sign * root.sqrt()) / square);
        }
        let (half, most) = (of_gain.sqrt(), gap + before.sqrt());
        match gain {
            gain if gain > half && most > 0.0 => [(gain - half) / most, f64::INFINITY],
            gain if gain < -half && most > 0.0 => [f64::NEG_INFINITY, (gain + half) / most],
            _ => nothing,
        }
    }
}

/// The share of values within 1.96 standard deviations of a replicate about a response, the emulator's error included.
fn coverage(held_out: &Experiment<'_>, noise: &Noise, response: &[f64]) -> f64 {
    let sd = noise.sd(held_out, response);
    let mut variance: Vec<f64> = sd.iter().map(|s| s * s).collect();
    for (curve, law) in held_out.curves.iter().zip(&noise.curves) {
        for &i in &curve.measured {
            let rest = held_out.independent.get(i).copied().unwrap_or(0.0);
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
