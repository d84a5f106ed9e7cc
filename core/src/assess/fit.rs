//! The calibrated model against the data.

use crate::math::moments::{mean, variance};

use super::words::{percent, short};
use super::{Finding, Rule, Severity};

const REFERENCE: &str = "no_better_than_reference";
const MODEL_FORM: &str = "model_form";
const PREDICTIVE: &str = "predictive_check";

/// By how much the log-likelihood at the reference may be above that at the MAP: a reservation, and a failure.
const BETTER: (f64, f64) = (2.0, 10.0);
/// The model form over the measurement, in standard deviations: a reservation, and a failure.
const FORM: (f64, f64) = (1.0, 3.0);
/// Data inside the 95 % band of a new replicate: below these a reservation, and a failure.
const COVERED: (f64, f64) = (0.9, 0.8);
/// Points of the calibrated model inside the replicates' 95 % interval: the same.
const ACCURATE: (f64, f64) = (0.7, 0.4);
/// The posterior predictive p-value that is a reservation.
const P: f64 = 0.01;
/// How many standard errors above one the mean square misfit over that of the replicates' mean may be.
const ERRORS: f64 = 5.0;
/// How many times larger than expected the misfit must be to be a failure: twice in standard deviations; or, where chance is out of
/// the question, 1.4 times, with which 95 % intervals hold 83 %.
const MISFIT: f64 = 4.0;
const CERTAIN: f64 = 2.0;
/// So many standard deviations of the logarithms of the simulated misfits are out of the question.
const CHANCE: f64 = 4.0;

const START_AGAIN: &str =
    "look at the emulator near both points: the model was run there; add runs between them";
const GAP: &str =
    "`lacuna gap STUDY` says where the model and the data disagree and what may be missing";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: REFERENCE,
            looks_at: "log-likelihood of the response at the reference parameters above that at the MAP, both simulated \
                       or both emulated"
                .to_owned(),
            threshold: format!("{}: reservation; {}: failure", BETTER.0, BETTER.1),
            why: "calibrated parameters that fit worse than those before the calibration are no gain: the \
                  emulator misleads. A reference that is the truth is better by 2 once in 55 (one parameter) or less",
            action: START_AGAIN,
        },
        Rule {
            code: MODEL_FORM,
            looks_at: "standard deviation of the model form over that of the measurement".to_owned(),
            threshold: format!("{}: reservation; {}: failure", FORM.0, FORM.1),
            why: "the parameters make up for what the model lacks, in the direction that helps the fit and not in that \
                  of the truth (Brynjarsdottir and O'Hagan 2014)",
            action: GAP,
        },
        Rule {
            code: PREDICTIVE,
            looks_at: "measured values inside the 95 % band of a new replicate; points of the calibrated model inside \
                       the replicates' 95 % interval; the misfit of the replicates' mean against data simulated \
                       at posterior draws (posterior predictive p-value), and against the scatter of the replicates (F)"
                .to_owned(),
            threshold: format!(
                "band: below {}: reservation, {}: failure; interval: below {}: reservation, {}: failure; p below \
                 {P}: reservation, with a misfit {MISFIT} times as large as expected, or {CERTAIN} times and {CHANCE} standard \
                 deviations of its logarithm: failure; F more than {ERRORS} standard errors above 1, and above \
                 that of all simulated data: reservation",
                percent(COVERED.0),
                percent(COVERED.1),
                percent(ACCURATE.0),
                percent(ACCURATE.1)
            ),
            why: "a model of data that could not have made these data gives no probabilities about their causes",
            action: GAP,
        },
    ]
}

/// MAP against reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Against {
    /// The log-likelihood of the data with the response at the MAP and at the reference.
    pub log_likelihood: (f64, f64),
    /// The root mean square differences from the replicates' mean.
    pub rmse: (f64, f64),
    /// Whether the model was run at both.
    pub simulated: bool,
}

/// A MAP that fits worse than the reference.
pub fn reference(against: &Against) -> Option<Finding> {
    let (map, reference) = against.log_likelihood;
    let better = reference - map;
    if better.is_nan() || better < BETTER.0 {
        return None;
    }
    let severity = if better < BETTER.1 { Severity::Reservation } else { Severity::Failure };
    let how = if against.simulated { "simulated" } else { "emulated" };
    let message = format!(
        "the {how} response at the reference parameters fits better than at the MAP, by {} in log-likelihood (root \
         mean square difference {} against {})",
        short(better),
        short(against.rmse.1),
        short(against.rmse.0)
    );
    Some(Finding::new((REFERENCE, "map"), (better, BETTER.0), severity, message, START_AGAIN))
}

/// The standard deviations of model form and measurement.
pub fn model_form(form: f64, measurement: f64) -> Option<Finding> {
    let ratio = form / measurement;
    if ratio.is_nan() || ratio < FORM.0 {
        return None;
    }
    let severity = if ratio < FORM.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "what the model misses is {} times the noise of a measurement: the parameters make up for it",
        short(ratio)
    );
    Some(Finding::new((MODEL_FORM, ""), (ratio, FORM.0), severity, message, GAP))
}

/// Of so many measured values these are inside the 95 % band of a new replicate.
pub fn covered(inside: usize, of: usize) -> Option<Finding> {
    let share = inside as f64 / of.max(1) as f64;
    // Few values are outside by chance: three standard deviations of a binomial share are allowed beyond the threshold.
    let chance = 3.0 * (0.95 * 0.05 / of.max(1) as f64).sqrt();
    if share >= COVERED.0.min(0.95 - chance) {
        return None;
    }
    let severity = if share < COVERED.1.min(0.95 - 1.5 * chance) {
        Severity::Failure
    } else {
        Severity::Reservation
    };
    let message = format!(
        "{} of {of} measured values lie inside the 95 % band of a new replicate",
        percent(share)
    );
    Some(Finding::new((PREDICTIVE, "band"), (share, COVERED.0), severity, message, GAP))
}

/// The share of the points of the calibrated model inside the replicates' 95 % interval.
pub fn accurate(share: f64) -> Option<Finding> {
    if share.is_nan() || share >= ACCURATE.0 {
        return None;
    }
    let severity = if share < ACCURATE.1 { Severity::Failure } else { Severity::Reservation };
    let message = format!(
        "{} of the points of the calibrated model lie inside the 95 % interval of the replicates",
        percent(share)
    );
    Some(Finding::new((PREDICTIVE, "map"), (share, ACCURATE.0), severity, message, GAP))
}

/// A misfit of the data beside those of data simulated at posterior draws.
pub fn misfit(observed: f64, simulated: &[f64]) -> Option<Finding> {
    if simulated.is_empty() || !observed.is_finite() {
        return None;
    }
    let above = simulated.iter().filter(|s| **s >= observed).count();
    let p = (above + 1) as f64 / (simulated.len() + 1) as f64;
    if p >= P {
        return None;
    }
    let mut sorted = simulated.to_vec();
    sorted.sort_by(f64::total_cmp);
    let ratio = observed / sorted[sorted.len() / 2];
    let is_certain = ratio >= CERTAIN && beyond(observed, simulated) >= CHANCE;
    let is_failure = ratio >= MISFIT || is_certain;
    let severity = if is_failure { Severity::Failure } else { Severity::Reservation };
    let message = format!(
        "the misfit of the replicates' mean is {} times as large (mean square) as in data simulated from the \
         calibrated study, which reach it with probability {} or less",
        short(ratio),
        short(p)
    );
    Some(Finding::new((PREDICTIVE, "misfit"), (p, P), severity, message, GAP))
}

/// How many standard deviations of its logarithm a positive number is above others.
fn beyond(observed: f64, others: &[f64]) -> f64 {
    let logs: Vec<f64> = others.iter().map(|s| s.ln()).collect();
    (observed.ln() - mean(&logs)) / variance(&logs).sqrt()
}

/// The mean square of the replicates' mean about the calibrated model over its variance by the replicates' scatter, `f`,
/// and the same in simulated data. `effective` is the number of independent values of a curve by the replicates'
/// own correlation, of all curves together.
pub fn scatter(f: f64, simulated: &[f64], effective: f64, replicates: f64) -> Option<Finding> {
    let most = simulated.iter().copied().fold(1.0, f64::max);
    // The variance of F for so many values above and (replicates - 1) times as many below.
    let error = (2.0 / effective * (1.0 + 1.0 / (replicates - 1.0))).sqrt();
    let limit = 1.0 + ERRORS * error;
    if !f.is_finite() || !limit.is_finite() || f <= limit || f <= most {
        return None;
    }
    let message = format!(
        "the calibrated model misses the replicates' mean by {} times what their scatter lets expect (mean square): \
         a part of that is no noise, and the parameters make up for some of it",
        short(f)
    );
    let figures = (f, limit);
    Some(Finding::new((PREDICTIVE, "replicates"), figures, Severity::Reservation, message, GAP))
}
