//! Prior and data that contradict each other.

use super::words::short;
use super::{Finding, Rule, Severity};

const CODE: &str = "prior_conflict";

/// How many standard deviations, of what the prior lets expect, the posterior may be off.
const Z: (f64, f64) = (3.3, 5.0);

const QUESTION: &str = "ask where the prior comes from, and whether the model lacks something that the parameter \
                        makes up for";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "posterior mean minus prior mean over sqrt(prior variance - posterior variance), for priors \
                   without bounds"
            .to_owned(),
        threshold: format!("{}: reservation (probability 0.001); {}: failure", Z.0, Z.1),
        why: "were the prior true, this were a standard normal variable (linear model, normal prior; Evans and \
              Moshonov 2006): data and prior contradict each other, and the posterior is a compromise \
              that neither supports",
        action: QUESTION,
    }]
}

/// A parameter's prior and posterior as mean and standard deviation.
pub fn conflict(name: &str, prior: (f64, f64), posterior: (f64, f64)) -> Option<Finding> {
    let learned = prior.1 * prior.1 - posterior.1 * posterior.1;
    // Where the data say next to nothing the difference is Monte Carlo error over nothing.
    if !learned.is_finite() || learned < 0.05 * prior.1 * prior.1 {
        return None;
    }
    let z = (posterior.0 - prior.0).abs() / learned.sqrt();
    if z < Z.0 {
        return None;
    }
    let severity = if z < Z.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "the posterior mean {} is {} standard deviations from what the prior ({} ± {}) lets expect",
        short(posterior.0),
        short(z),
        short(prior.0),
        short(prior.1)
    );
    Some(Finding::new((CODE, name), (z, Z.0), severity, message, QUESTION))
}
