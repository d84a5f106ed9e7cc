//! Fit of the calibrated model to the data.

use lacuna::math::moments::{mean, variance};

use super::words::{percent, short};
use super::{Finding, Rule, Severity};

const REFERENCE: &str = "no_better_than_reference";
const MODEL_FORM: &str = "model_form";
const PREDICTIVE: &str = "predictive_check";

/// Excess of the log-likelihood at the reference over that at the MAP that gives a reservation and a failure.
const BETTER: (f64, f64) = (2.0, 10.0);
/// Ratios of model form to measurement error, as standard deviations, that give a reservation and a failure.
const FORM: (f64, f64) = (1.0, 3.0);
/// Fractions of data inside the 95 % band of a new replicate below which there is a reservation and a failure.
const COVERED: (f64, f64) = (0.9, 0.8);
/// Fractions of points of the calibrated model inside the replicates' 95 % interval below which there is a reservation
/// and a failure.
const ACCURATE: (f64, f64) = (0.7, 0.4);
/// Posterior predictive p-value that gives a reservation.
const P: f64 = 0.01;
/// Excess of the mean square misfit, relative to the variance of the replicates' mean, over one, in standard errors,
/// that gives a finding.
const ERRORS: f64 = 5.0;
/// Ratio of the misfit to its expected value that gives a failure: twice in standard deviations. If chance is excluded,
/// a ratio of 1.4, for which 95 % intervals cover 83 %, suffices.
const MISFIT: f64 = 4.0;
const CERTAIN: f64 = 2.0;
/// Distance from the simulated misfits, in standard deviations of their logarithm, that excludes chance.
const CHANCE: f64 = 4.0;

const START_AGAIN: &str =
    "compare emulator and model at both points, where the model was run; add runs between them";
const GAP: &str = "`lacuna gap STUDY` locates the disagreement between model and data and searches for missing physics";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: REFERENCE,
            looks_at: "excess of the log-likelihood at the reference parameters over that at the MAP, both \
                       simulated or both emulated"
                .to_owned(),
            threshold: format!("{}: reservation; {}: failure", BETTER.0, BETTER.1),
            why: "if the calibrated parameters fit worse than the reference, the emulator is misleading. A \
                  reference that is the truth fits better by 2 with probability 1/55 (one parameter) or less",
            action: START_AGAIN,
        },
        Rule {
            code: MODEL_FORM,
            looks_at: "ratio of the standard deviations of model form and measurement; of a discrepancy that is not divided into \
                       these, of what exceeds the scatter of the replicates or the noise that `[measurements]` states"
                .to_owned(),
            threshold: format!("{}: reservation; {}: failure", FORM.0, FORM.1),
            why: "the parameters compensate for missing physics in the direction that improves the fit, not in that \
                  of the truth (Brynjarsdottir and O'Hagan 2014)",
            action: GAP,
        },
        Rule {
            code: PREDICTIVE,
            looks_at: "fraction of measured values inside the 95 % band of a new replicate; fraction of points of \
                       the calibrated model inside the replicates' 95 % interval; misfit of the replicates' mean \
                       compared with data simulated at posterior draws (posterior predictive p-value), and with the \
                       scatter of the replicates (F)"
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
            why: "the posterior is not meaningful if the statistical model could not have produced the data",
            action: GAP,
        },
    ]
}

/// Comparison of the MAP with the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Against {
    /// Log-likelihood of the data for the response at the MAP and at the reference.
    pub log_likelihood: (f64, f64),
    /// Root mean square differences from the replicates' mean, at the MAP and at the reference.
    pub rmse: (f64, f64),
    /// True if the model was run at both.
    pub simulated: bool,
}

/// Finding about a MAP that fits worse than the reference.
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

/// Finding about the standard deviations of model form and measurement.
pub fn model_form(form: f64, measurement: f64) -> Option<Finding> {
    let ratio = form / measurement;
    if ratio.is_nan() || ratio < FORM.0 {
        return None;
    }
    let severity = if ratio < FORM.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "the model form error is {} times the noise of a measurement: the parameters compensate for it",
        short(ratio)
    );
    Some(Finding::new((MODEL_FORM, ""), (ratio, FORM.0), severity, message, GAP))
}

/// Finding about the coverage: `inside` of `of` measured values are inside the 95 % band of a new replicate.
pub fn covered(inside: usize, of: usize) -> Option<Finding> {
    let share = inside as f64 / of.max(1) as f64;
    // With few values some are outside by chance: three standard deviations of a binomial fraction are allowed beyond
    // the threshold.
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

/// Finding about the fraction of the points of the calibrated model inside the replicates' 95 % interval.
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

/// Finding about the misfit of the data compared with that of data simulated at posterior draws.
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
         calibrated study (posterior predictive p-value <= {})",
        short(ratio),
        short(p)
    );
    Some(Finding::new((PREDICTIVE, "misfit"), (p, P), severity, message, GAP))
}

/// Distance of a positive number above others, in standard deviations of the logarithm.
fn beyond(observed: f64, others: &[f64]) -> f64 {
    let logs: Vec<f64> = others.iter().map(|s| s.ln()).collect();
    (observed.ln() - mean(&logs)) / variance(&logs).sqrt()
}

/// Finding about the mean square difference between the replicates' mean and the calibrated model, divided by its
/// variance according to the scatter of the replicates, `f`, and the same in simulated data. `effective` is the
/// effective number of independent values of all curves together, according to the correlation within replicates.
pub fn scatter(f: f64, simulated: &[f64], effective: f64, replicates: f64) -> Option<Finding> {
    let most = simulated.iter().copied().fold(1.0, f64::max);
    // Variance of F with this number of degrees of freedom in the numerator and (replicates - 1) times as many in the
    // denominator.
    let error = (2.0 / effective * (1.0 + 1.0 / (replicates - 1.0))).sqrt();
    let limit = 1.0 + ERRORS * error;
    if !f.is_finite() || !limit.is_finite() || f <= limit || f <= most {
        return None;
    }
    let message = format!(
        "the mean square difference between the calibrated model and the replicates' mean is {} times that expected \
         from their scatter: a part of it is not noise, and the parameters compensate for some of it",
        short(f)
    );
    let figures = (f, limit);
    Some(Finding::new((PREDICTIVE, "replicates"), figures, Severity::Reservation, message, GAP))
}
