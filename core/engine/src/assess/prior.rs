//! Conflicts between prior and data.

use super::words::short;
use super::{Finding, Rule, Severity};

const CODE: &str = "prior_conflict";

/// Distance of the posterior mean from the prior mean, in standard deviations of its expected scatter under the prior,
/// that gives a reservation and a failure.
const Z: (f64, f64) = (3.3, 5.0);

const QUESTION: &str =
    "check the source of the prior, and whether the parameter compensates for missing physics";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "posterior mean minus prior mean, divided by sqrt(prior variance - posterior variance), for \
                   priors without bounds"
            .to_owned(),
        threshold: format!("{}: reservation (probability 0.001); {}: failure", Z.0, Z.1),
        why: "if the prior holds, this is a standard normal variable (linear model, normal prior; Evans and \
              Moshonov 2006); with a large value data and prior contradict each other, and the posterior is a \
              compromise that neither supports",
        action: QUESTION,
    }]
}

/// Finding about a parameter with this mean and standard deviation of prior and posterior.
pub fn conflict(name: &str, prior: (f64, f64), posterior: (f64, f64)) -> Option<Finding> {
    let learned = prior.1 * prior.1 - posterior.1 * posterior.1;
    // If the data are almost uninformative, the ratio is Monte Carlo error divided by nearly zero.
    if !learned.is_finite() || learned < 0.05 * prior.1 * prior.1 {
        return None;
    }
    let z = (posterior.0 - prior.0).abs() / learned.sqrt();
    if z < Z.0 {
        return None;
    }
    let severity = if z < Z.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "the posterior mean {} is {} standard deviations from its expectation under the prior ({} ± {})",
        short(posterior.0),
        short(z),
        short(prior.0),
        short(prior.1)
    );
    Some(Finding::new((CODE, name), (z, Z.0), severity, message, QUESTION))
}
