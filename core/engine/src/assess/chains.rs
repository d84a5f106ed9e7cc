//! Convergence of the draws.

use super::words::{self, count, names};
use super::{Finding, Rule, Severity};

const NOT_CONVERGED: &str = "not_converged";
const SHORT: &str = "short_chain";
const STRANDED: &str = "stranded_walkers";

/// Number of autocorrelation times from which on the autocorrelation time itself is reliable (Foreman-Mackey et al.,
/// PASP 125 (2013) 306).
const TIMES: f64 = 50.0;
/// Monte Carlo error of a mean, in posterior standard deviations, that gives a reservation.
const ERROR: f64 = 0.1;
/// Factor on a standard error if the autocorrelation time may be underestimated by a factor of three: sqrt(3).
const DOUBT: f64 = 1.732;
/// Fraction of stranded walkers that gives a failure.
const LOST: f64 = 0.05;

const LONGER: &str =
    "run more steps: raise `[sampler] steps`, or set `stop = { effective_sample_size = 400 }`";
const RESTART: &str =
    "start the walkers around the best fit, `[sampler] start = \"map\"`, or use a longer `burn_in`";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: NOT_CONVERGED,
            looks_at: "the largest R-hat, and problems reported by the sampler".to_owned(),
            threshold: "R-hat above 1.01 for independent chains, above 1.1 for walkers of one ensemble; `R-hat^2 - \
                        1` over twice the allowed value: failure, otherwise reservation; fewer than 400 effective \
                        draws: reservation; problems reported by the sampler: failure"
                .to_owned(),
            why: "1.01: Vehtari et al. 2021; walkers of an ensemble are correlated and have an R-hat of 1.095 after \
                  ten autocorrelation times even if converged",
            action: LONGER,
        },
        Rule {
            code: SHORT,
            looks_at: "steps after the burn-in divided by the longest autocorrelation time".to_owned(),
            threshold: format!(
                "fewer than {TIMES}: note; reservation if the Monte Carlo error of a mean, for an autocorrelation \
                 time three times as long, is above {ERROR} posterior sd"
            ),
            why: "short chains underestimate the autocorrelation time, and with it all Monte Carlo errors \
                  (Foreman-Mackey et al. 2013)",
            action: LONGER,
        },
        Rule {
            code: STRANDED,
            looks_at: "walkers whose log density stays far below the bulk until the last step".to_owned(),
            threshold: format!("any: reservation; {} %: failure", 100.0 * LOST),
            why: "every mean, interval and band includes their points",
            action: RESTART,
        },
    ]
}

/// Diagnostics of chains.
#[derive(Debug, Clone, PartialEq)]
pub struct Chains {
    /// True if they are walkers of one ensemble.
    pub ensemble: bool,
    /// True if all criteria hold.
    pub converged: bool,
    /// Name, R-hat, and the smaller effective sample size of bulk and tails of each coordinate.
    pub coordinates: Vec<(String, f64, f64)>,
    /// Largest allowed R-hat, and required effective sample size.
    pub allowed: (f64, f64),
    /// Advice of the diagnosis.
    pub advice: String,
}

/// Finding about chains that have not converged.
pub fn not_converged(chains: &Chains) -> Option<Finding> {
    if chains.converged {
        return None;
    }
    let (most, wanted) = chains.allowed;
    let reason = if chains.ensemble {
        "the limit for walkers of one ensemble, which are correlated: converged ones have 1.095 after ten \
         autocorrelation times"
    } else {
        "the limit for independent chains"
    };
    let worst = chains.coordinates.iter().max_by(|a, b| rank(a.1).total_cmp(&rank(b.1)))?;
    let excess = |r_hat: f64| r_hat * r_hat - 1.0;
    let disagree = worst.1.is_nan() || worst.1 > most;
    let few: Vec<&str> =
        chains.coordinates.iter().filter(|c| c.2 < wanted).map(|c| c.0.as_str()).collect();
    let far = worst.1.is_nan() || excess(worst.1) > 2.0 * excess(most);
    // If neither R-hat nor the effective sample size is at fault, the sampler itself has reported a problem.
    let severity = if far || (!disagree && few.is_empty()) {
        Severity::Failure
    } else {
        Severity::Reservation
    };
    let r_hat = if disagree {
        format!("R-hat is {:.3}, and {most} is {reason}", worst.1)
    } else if few.is_empty() {
        chains.advice.clone()
    } else {
        format!("fewer than {wanted} effective draws of {}", names(&few))
    };
    let message = format!("the sampler has not converged: {r_hat}");
    Some(Finding::new((NOT_CONVERGED, &worst.0), (worst.1, most), severity, message, LONGER))
}

fn rank(r_hat: f64) -> f64 {
    if r_hat.is_nan() { f64::INFINITY } else { r_hat }
}

/// Finding about short chains: `steps` steps with the longest autocorrelation time, of the coordinate `name`; `error`
/// is the largest Monte Carlo error of a mean in posterior standard deviations.
pub fn short(name: &str, steps: usize, time: f64, error: f64) -> Option<Finding> {
    let times = steps as f64 / time;
    if times >= TIMES || !time.is_finite() {
        return None;
    }
    let error = DOUBT * error;
    let severity = if error > ERROR { Severity::Reservation } else { Severity::Note };
    let message = format!(
        "the chains have {steps} steps, which is {} autocorrelation times of {} steps: too few for a reliable \
         estimate of that time; if it is three times as long, a mean has a Monte Carlo error of {} posterior \
         standard deviations",
        words::short(times),
        words::short(time),
        words::short(error)
    );
    Some(Finding::new((SHORT, name), (times, TIMES), severity, message, LONGER))
}

/// Finding about walkers, out of `of`, that never reached the bulk.
pub fn stranded(lost: &[usize], of: usize) -> Option<Finding> {
    if lost.is_empty() {
        return None;
    }
    let share = lost.len() as f64 / of as f64;
    let severity = if share < LOST { Severity::Reservation } else { Severity::Failure };
    let list: Vec<String> = lost.iter().map(ToString::to_string).collect();
    let message = format!(
        "{} of {} {} stranded far below the bulk of the density, and every summary includes them: {}",
        lost.len(),
        count(of, "walker"),
        if lost.len() == 1 { "is" } else { "are" },
        list.join(", ")
    );
    Some(Finding::new((STRANDED, ""), (share, 0.0), severity, message, RESTART))
}
