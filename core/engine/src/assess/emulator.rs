//! Effect of errors of the emulator and of the model's numerics on the estimates.

use super::words::{count, names, percent, short};
use super::{Finding, Rule, Severity};

const EMULATOR: &str = "emulator_error";
const NUMERICAL: &str = "numerical_error";
const SAMPLED: &str = "sampled_errors";
const REFINEMENT: &str = "refinement_unfinished";

/// Shifts of an estimate, in posterior standard deviations, that give a reservation and a failure if the likelihood
/// does not include the error. A 95 % interval whose centre is shifted by one standard deviation covers 83 %, by half
/// of one 92 %.
const SHIFT: (f64, f64) = (0.5, 1.0);
/// Fraction of the posterior variance due to the included error that gives a reservation.
const DOMINATED: f64 = 0.5;
/// Relative leave-one-out errors, means over outputs, that give a reservation and a failure: the fraction of the
/// response's variance that the emulator does not explain.
const LEFT_OUT: (f64, f64) = (0.1, 0.3);
/// Ratios of the emulator's actual to its stated error at the posterior that give a reservation and a failure.
const LARGER: (f64, f64) = (2.0, 5.0);

const MORE_RUNS: &str = "add runs near the posterior: `[surrogate] refine = { runs = 20 }`, or `lacuna campaign \
                         extend RUN --runs 20`";
const ALLOW: &str = "include the error in the likelihood, `[discrepancy] emulator_error = true`, and add runs near the \
                     posterior";
const FINER: &str = "use a finer mesh for the runs inside the prior, or repeat more of them in `[numerical_error]`; \
                     with few repeated runs, `surrogate = { use = \"gaussian_process\" }` there often predicts the \
                     error better";
const WHOLE: &str = "use a discrepancy that includes the whole covariance of these errors, or let this one sample \
                     more directions: `[discrepancy] common`";
const ROUNDS: &str = "allow more `rounds` in `[surrogate] refine`";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: EMULATOR,
            looks_at: "the root mean square shift of each estimate, in posterior sd, caused by the emulator's \
                       errors (at left-out and validation runs near the prior, scaled up if new runs at the \
                       posterior show larger errors); its relative leave-one-out error; the error at new runs at \
                       the posterior relative to that elsewhere"
                .to_owned(),
            threshold: format!(
                "error not in the likelihood: shift of {} sd: reservation, {} sd: failure. Error in the likelihood: \
                 {} of the posterior variance: reservation. Leave-one-out error {}: reservation, {}: failure. Error \
                 at new runs {} times that at the others: reservation, {} times: failure",
                SHIFT.0,
                SHIFT.1,
                percent(DOMINATED),
                LEFT_OUT.0,
                LEFT_OUT.1,
                LARGER.0,
                LARGER.1
            ),
            why: "a 95 % interval whose centre is shifted by 1 sd covers 83 %, by 0.5 sd 92 %; if the emulator's \
                  error dominates, the interval is only as good as the estimate of that error",
            action: MORE_RUNS,
        },
        Rule {
            code: NUMERICAL,
            looks_at: "the shift of each estimate, in posterior sd, caused by the whole numerical error".to_owned(),
            threshold: format!(
                "error in the likelihood: {} of the posterior variance: reservation",
                percent(DOMINATED)
            ),
            why: "a discretisation error resembles a change of the parameters, with the same sign everywhere",
            action: FINER,
        },
        Rule {
            code: SAMPLED,
            looks_at: "the shift of each estimate, in posterior sd, caused by the errors of emulator, numerics and \
                       replicates along the directions that a discrepancy which samples their weights omits"
                .to_owned(),
            threshold: format!("shift of {} sd: reservation, {} sd: failure", SHIFT.0, SHIFT.1),
            why: "along the omitted directions the emulator counts as exact, and the estimates rely on it",
            action: WHOLE,
        },
        Rule {
            code: REFINEMENT,
            looks_at: "the ratio of the emulator's error at the last new runs to the discrepancy".to_owned(),
            threshold: "more than `until`, or a posterior at the edge of the region: reservation".to_owned(),
            why: "the refinement that the study requests was not reached",
            action: ROUNDS,
        },
    ]
}

/// Effect of an error on the estimates.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// For each parameter, its name and the root mean square shift of its estimate in posterior standard deviations.
    pub shifts: Vec<(String, f64)>,
    /// Median over outputs of the ratio of the error to the standard error of the replicates' mean, if that is known.
    pub against_noise: Option<f64>,
    /// True if the likelihood includes the error.
    pub allowed: bool,
}

impl Effect {
    fn worst(&self) -> Option<(&str, f64)> {
        let worst = self.shifts.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((&worst.0, worst.1))
    }

    /// Largest shift.
    pub fn largest(&self) -> Option<f64> {
        self.worst().map(|(_, shift)| shift)
    }

    fn beside_noise(&self) -> String {
        let size = |ratio| {
            format!(
                "; it is {} times the standard error of the replicates' mean (median over outputs)",
                short(ratio)
            )
        };
        self.against_noise.map(size).unwrap_or_default()
    }
}

/// Finding about the emulator's error.
pub fn emulator(effect: &Effect) -> Option<Finding> {
    judged(effect, EMULATOR, "emulator's error", if effect.allowed { MORE_RUNS } else { ALLOW })
}

/// Finding about the numerical error of the model.
pub fn numerical(effect: &Effect) -> Option<Finding> {
    judged(effect, NUMERICAL, "model's numerical error", FINER)
}

fn judged(effect: &Effect, code: &str, what: &str, action: &str) -> Option<Finding> {
    let (name, worst) = effect.worst()?;
    let noise = effect.beside_noise();
    if effect.allowed {
        let share = worst * worst;
        let message = format!(
            "about {} of the posterior variance is due to the {what}, which the likelihood includes: the interval \
             is only as good as the estimate of that error from the runs{noise}",
            percent(share.min(1.0))
        );
        let figures = (share, DOMINATED);
        return (share >= DOMINATED)
            .then(|| Finding::new((code, name), figures, Severity::Reservation, message, action));
    }
    if worst.is_finite() && worst < SHIFT.0 {
        return None;
    }
    let all: Vec<&str> =
        effect.shifts.iter().filter(|s| s.1 >= SHIFT.0).map(|s| s.0.as_str()).collect();
    let message = format!(
        "the {what}, which the likelihood does not include, shifts estimates by up to {} posterior standard \
         deviations ({}){noise}",
        short(worst),
        names(&all)
    );
    let severity = if worst < SHIFT.1 { Severity::Reservation } else { Severity::Failure };
    Some(Finding::new((code, name), (worst, SHIFT.0), severity, message, action))
}

/// Finding about the directions that a discrepancy with this number of sampled directions omits: `shifts` holds for
/// each parameter its name and the standard deviation of its shift, in posterior standard deviations.
pub fn sampled(shifts: &[(String, f64)], directions: usize) -> Option<Finding> {
    let (name, worst) = shifts.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    if *worst < SHIFT.0 {
        return None;
    }
    let severity = if *worst < SHIFT.1 { Severity::Reservation } else { Severity::Failure };
    let all: Vec<&str> = shifts.iter().filter(|s| s.1 >= SHIFT.0).map(|s| s.0.as_str()).collect();
    let message = format!(
        "the discrepancy samples {} of the errors common to all replicates; the omitted part shifts estimates by up \
         to {} posterior standard deviations ({})",
        count(directions, "direction"),
        short(*worst),
        names(&all)
    );
    Some(Finding::new((SAMPLED, name), (*worst, SHIFT.0), severity, message, WHOLE))
}

/// Finding about the relative leave-one-out error, mean over outputs, of an emulator with this number of training runs.
pub fn left_out(relative: f64, runs: usize) -> Option<Finding> {
    if relative < LEFT_OUT.0 {
        return None;
    }
    let severity = if relative < LEFT_OUT.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "the emulator of {runs} runs does not explain {} of the variance of the response (leave-one-out)",
        percent(relative)
    );
    Some(Finding::new(
        (EMULATOR, "leave-one-out"),
        (relative, LEFT_OUT.0),
        severity,
        message,
        MORE_RUNS,
    ))
}

/// Finding about the ratio of the root mean square error at `count` new runs at posterior draws to that of the errors
/// elsewhere; `matters` is true if errors of that size shift the estimates.
pub fn at_posterior(ratio: f64, count: usize, matters: bool) -> Option<Finding> {
    if !matters || ratio < LARGER.0 {
        return None;
    }
    let severity = if ratio < LARGER.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "the error of the emulator at {count} new runs at the posterior is {} times its error at the runs from \
         which it was estimated",
        short(ratio)
    );
    let figures = (ratio, LARGER.0);
    Some(Finding::new((EMULATOR, "posterior"), figures, severity, message, MORE_RUNS))
}

/// Finding about a refinement that ended before it reached the requested ratio.
/// `of` says in words what the error is compared with.
pub fn unfinished(rounds: usize, (ratio, of): (f64, &str), until: f64, clear: bool) -> Finding {
    let edge = if clear { "" } else { ", and the posterior extends to the edge of the region" };
    let message = format!(
        "after {rounds} rounds of refinement the emulator's error at new runs is {} of {of} (requested: {}){edge}",
        short(ratio),
        short(until)
    );
    Finding::new((REFINEMENT, ""), (ratio, until), Severity::Reservation, message, ROUNDS)
}
