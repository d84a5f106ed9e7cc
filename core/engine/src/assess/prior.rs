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
    let of_run = Rule {
        code: OF_RUN,
        looks_at: "divergence of a prior that represents the posterior of an earlier run from held-out draws of that run, in \
                   nats; their energy distance; convergence of that run"
            .to_owned(),
        threshold: "more than 0.1 plus three standard errors away from zero, or p ≤ 0.01 of the energy distance, or not \
                    converged: reservation"
            .to_owned(),
        why: "the posterior of the earlier run enters as a fitted density; where it differs from the draws, the present \
              posterior uses another prior than the earlier study found",
        action: BETTER,
    };
    let conflict = Rule {
        code: CODE,
        looks_at: "posterior mean minus prior mean, divided by sqrt(prior variance - posterior variance), for \
                   priors without bounds"
            .to_owned(),
        threshold: format!("{}: reservation (probability 0.001); {}: failure", Z.0, Z.1),
        why: "if the prior holds, this is a standard normal variable (linear model, normal prior; Evans and \
              Moshonov 2006); with a large value data and prior contradict each other, and the posterior is a \
              compromise that neither supports",
        action: QUESTION,
    };
    vec![conflict, of_run]
}

const OF_RUN: &str = "prior_of_run";

const BETTER: &str =
    "run the earlier study with more steps, or calibrate the data of both studies together";

/// Finding about a prior that represents the posterior of a run: divergence in nats and its standard error, probability of
/// the energy distance, convergence of the run.
pub fn of_run(
    run: &str,
    divergence: (f64, f64),
    probability: f64,
    converged: bool,
    poor: bool,
) -> Option<Finding> {
    if converged && !poor {
        return None;
    }
    let message = if poor {
        format!(
            "the prior from `{run}` differs from held-out draws of that run: divergence {} ± {} nats, p {} of the energy \
             distance",
            short(divergence.0),
            short(divergence.1),
            short(probability)
        )
    } else {
        format!("the prior is the posterior of `{run}`, whose chains did not converge")
    };
    let figure = (divergence.0, 0.1);
    Some(Finding::new((OF_RUN, run), figure, Severity::Reservation, message, BETTER))
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
