//! Whether the draws are what they should be.

use super::words::{self, count, names};
use super::{Finding, Rule, Severity};

const NOT_CONVERGED: &str = "not_converged";
const SHORT: &str = "short_chain";
const STRANDED: &str = "stranded_walkers";

/// The number of autocorrelation times from which on the time itself is known (Foreman-Mackey et al., PASP 125
/// (2013) 306).
const TIMES: f64 = 50.0;
/// The Monte Carlo error of a mean, in posterior standard deviations, that is a reservation.
const ERROR: f64 = 0.1;
/// What a standard error is to be multiplied by where the autocorrelation time may be too short by a factor of three.
const DOUBT: f64 = 1.732;
/// The share of stranded walkers that is a failure.
const LOST: f64 = 0.05;

const LONGER: &str =
    "draw more: raise `[sampler] steps`, or set `stop = { effective_sample_size = 400 }`";
const RESTART: &str = "start the walkers around the best fit, `[sampler] start = \"map\"`, or drop a longer \
                       `burn_in`";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: NOT_CONVERGED,
            looks_at: "the largest R-hat, and what the sampler says of itself".to_owned(),
            threshold: "R-hat above 1.01 for independent chains, above 1.1 for walkers of one ensemble; \
                        excess over twice the allowed one: failure, else reservation; fewer than 400 \
                        effective draws: reservation; the sampler's own doubts: failure"
                .to_owned(),
            why: "1.01: Vehtari et al. 2021; walkers are correlated, and those of a converged ensemble have 1.095 at \
                  ten autocorrelation times",
            action: LONGER,
        },
        Rule {
            code: SHORT,
            looks_at: "steps after the burn-in over the longest autocorrelation time".to_owned(),
            threshold: format!(
                "fewer than {TIMES}: note; reservation where the Monte Carlo error of a mean, with a time three \
                 times as long, is above {ERROR} posterior sd"
            ),
            why: "the autocorrelation time is estimated too short from short chains, and all errors with it \
                  (Foreman-Mackey et al. 2013)",
            action: LONGER,
        },
        Rule {
            code: STRANDED,
            looks_at: "walkers far below the bulk of the density to the end".to_owned(),
            threshold: format!("any: reservation; {} %: failure", 100.0 * LOST),
            why: "every mean, interval and band holds their points",
            action: RESTART,
        },
    ]
}

/// What is known about chains.
#[derive(Debug, Clone, PartialEq)]
pub struct Chains {
    /// Whether they are walkers of one ensemble.
    pub ensemble: bool,
    /// Whether all criteria hold.
    pub converged: bool,
    /// Each coordinate: name, R-hat, the smaller effective sample size of bulk and tails.
    pub coordinates: Vec<(String, f64, f64)>,
    /// The largest R-hat that is allowed, and the effective draws that are wanted.
    pub allowed: (f64, f64),
    /// The advice in words.
    pub advice: String,
}

/// Chains that have not converged.
pub fn not_converged(chains: &Chains) -> Option<Finding> {
    if chains.converged {
        return None;
    }
    let (most, wanted) = chains.allowed;
    let reason = if chains.ensemble {
        "the limit for walkers of one ensemble, which are correlated: converged ones have 1.095 at ten \
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
    // What is neither a matter of R-hat nor of the number of draws is the sampler's own doubt.
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

/// So many steps with this longest autocorrelation time, for the coordinate that has it; `error` is the largest Monte
/// Carlo error of a mean in posterior standard deviations.
pub fn short(name: &str, steps: usize, time: f64, error: f64) -> Option<Finding> {
    let times = steps as f64 / time;
    if times >= TIMES || !time.is_finite() {
        return None;
    }
    let error = DOUBT * error;
    let severity = if error > ERROR { Severity::Reservation } else { Severity::Note };
    let message = format!(
        "{steps} steps are {} autocorrelation times of {} steps, too few to know that time well; \
         were it three times as long, a mean would be uncertain by {} posterior standard deviations",
        words::short(times),
        words::short(time),
        words::short(error)
    );
    Some(Finding::new((SHORT, name), (times, TIMES), severity, message, LONGER))
}

/// Walkers, out of so many, that never reached the bulk.
pub fn stranded(lost: &[usize], of: usize) -> Option<Finding> {
    if lost.is_empty() {
        return None;
    }
    let share = lost.len() as f64 / of as f64;
    let severity = if share < LOST { Severity::Reservation } else { Severity::Failure };
    let list: Vec<String> = lost.iter().map(ToString::to_string).collect();
    let message = format!(
        "{} of {} {} stranded far below the bulk of the density, and every summary holds them: {}",
        lost.len(),
        count(of, "walker"),
        if lost.len() == 1 { "is" } else { "are" },
        list.join(", ")
    );
    Some(Finding::new((STRANDED, ""), (share, 0.0), severity, message, RESTART))
}
