//! Residuals that are correlated along the last axis although the likelihood treats them as independent.

use super::words::short;
use super::{Finding, Rule, Severity};

const CODE: &str = "correlated_residuals";

/// Factors by which intervals are too narrow that give a reservation and a failure. A 95 % interval that is too narrow
/// by a factor of 1.5 covers 81 %, by a factor of 3 49 %.
const NARROW: (f64, f64) = (1.5, 3.0);

const CORRELATED: &str = "use a discrepancy with autocorrelation: `[discrepancy] use = \"autoregressive\"` or \
                          `\"gaussian_process\"`";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "the autocorrelation time of the residuals along the last axis, relative to that in data \
                   simulated from the calibrated study"
            .to_owned(),
        threshold: format!(
            "so much longer that standard deviations are too small by a factor of {}: reservation; {}: failure",
            NARROW.0, NARROW.1
        ),
        why: "correlated data carry less information: a 95 % interval that is too narrow by a factor of 1.5 covers \
              81 %, by a factor of 3 49 %",
        action: CORRELATED,
    }]
}

/// Finding about the autocorrelation time of the residuals in steps of the last axis, compared with those in simulated
/// data, for this number of data.
pub fn correlated(time: f64, simulated: &[f64], data: usize) -> Option<Finding> {
    let mut sorted = simulated.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (expected, most) = (*sorted.get(sorted.len() / 2)?, *sorted.last()?);
    if time <= most {
        return None;
    }
    let narrow = (time / expected).sqrt();
    if narrow.is_nan() || narrow < NARROW.0 {
        return None;
    }
    let severity = if narrow < NARROW.1 { Severity::Reservation } else { Severity::Failure };
    let effective = data as f64 * expected / time;
    let message = format!(
        "the autocorrelation time of the residuals is {} steps, {} according to the likelihood: {data} data \
         correspond to about {:.0} independent ones, and standard deviations are too small by a factor of about {}",
        short(time),
        short(expected),
        effective,
        short(narrow)
    );
    Some(Finding::new((CODE, ""), (narrow, NARROW.0), severity, message, CORRELATED))
}
