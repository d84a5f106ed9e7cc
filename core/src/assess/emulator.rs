//! What errors of the emulator and of the model's numerics do to the estimates.

use super::words::{names, percent, short};
use super::{Finding, Rule, Severity};

const EMULATOR: &str = "emulator_error";
const NUMERICAL: &str = "numerical_error";
const REFINEMENT: &str = "refinement_unfinished";

/// The shift of an estimate, in posterior standard deviations, that is a reservation and a failure where the likelihood
/// does not allow for the error. A 95 % interval whose centre is off by one standard deviation holds 83 %, by half
/// of one 92 %.
const SHIFT: (f64, f64) = (0.5, 1.0);
/// The share of the posterior's variance that is the allowed error's own: a reservation.
const DOMINATED: f64 = 0.5;
/// Relative leave-one-out errors, the mean over outputs, that are a reservation and a failure: the emulator
/// misses this share of the response's variance.
const LEFT_OUT: (f64, f64) = (0.1, 0.3);
/// How many times larger than stated the emulator's error may be at the posterior.
const LARGER: (f64, f64) = (2.0, 5.0);

const MORE_RUNS: &str = "add runs near the posterior: `[surrogate] refine = { runs = 20 }`, or `lacuna campaign extend RUN --runs 20`";
const ALLOW: &str =
    "allow for it: `[discrepancy] emulator_error = true`, and add runs near the posterior";
const FINER: &str = "use a finer mesh for the runs inside the prior, or repeat more of them in \
                     `[numerical_error]`; of few, `surrogate = { use = \"gaussian_process\" }` there often \
                     predicts more";
const ROUNDS: &str = "allow more `rounds` in `[surrogate] refine`";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: EMULATOR,
            looks_at: "how far the emulator's errors (leave-one-out and validation runs near the prior, \
                       larger where fresh runs at the posterior say so) move each estimate, in posterior sd, root mean \
                       square; its relative leave-one-out error; fresh runs at the posterior against the errors \
                       elsewhere"
                .to_owned(),
            threshold: format!(
                "not allowed for: shift of {} sd: reservation, {} sd: failure. Allowed for: {} of the \
                 posterior's variance: reservation. Leave-one-out error {}: reservation, {}: failure. Fresh runs \
                 {} times as far off as the others: reservation, {} times: failure",
                SHIFT.0,
                SHIFT.1,
                percent(DOMINATED),
                LEFT_OUT.0,
                LEFT_OUT.1,
                LARGER.0,
                LARGER.1
            ),
            why: "an interval whose centre is off by 1 sd holds 83 % instead of 95 %, by 0.5 sd 92 %; where the \
                  emulator's error dominates, the interval is as good as what is known of that error",
            action: MORE_RUNS,
        },
        Rule {
            code: NUMERICAL,
            looks_at: "how far the whole numerical error moves each estimate, in posterior sd".to_owned(),
            threshold: format!(
                "{} of the posterior's variance, for which the likelihood allows: reservation",
                percent(DOMINATED)
            ),
            why: "an error of the mesh looks like a change of the parameters, with one sign everywhere",
            action: FINER,
        },
        Rule {
            code: REFINEMENT,
            looks_at: "the emulator's error at the last new runs over the discrepancy".to_owned(),
            threshold: "more than `until`, or a posterior at the edge of the region: reservation".to_owned(),
            why: "the study asked for more than was reached",
            action: ROUNDS,
        },
    ]
}

/// What an error does to the estimates.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// For each parameter its name and the root mean square shift of its estimate in posterior standard deviations.
    pub shifts: Vec<(String, f64)>,
    /// The median over outputs of the error over the standard error of the replicates' mean, where that is known.
    pub against_noise: Option<f64>,
    /// Whether the likelihood allows for the error.
    pub allowed: bool,
}

impl Effect {
    fn worst(&self) -> Option<(&str, f64)> {
        let worst = self.shifts.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((&worst.0, worst.1))
    }

    /// The largest shift.
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

/// The emulator's error.
pub fn emulator(effect: &Effect) -> Option<Finding> {
    judged(effect, EMULATOR, "emulator's error", if effect.allowed { MORE_RUNS } else { ALLOW })
}

/// The numerical error of the model.
pub fn numerical(effect: &Effect) -> Option<Finding> {
    judged(effect, NUMERICAL, "model's numerical error", FINER)
}

fn judged(effect: &Effect, code: &str, what: &str, action: &str) -> Option<Finding> {
    let (name, worst) = effect.worst()?;
    let noise = effect.beside_noise();
    if effect.allowed {
        let share = worst * worst;
        let message = format!(
            "about {} of the variance of the posterior is the {what}, for which the likelihood \
             allows: the interval is as good as what the runs tell of that error{noise}",
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
        "the {what}, for which the likelihood does not allow, moves estimates by up to {} posterior \
         standard deviations ({}){noise}",
        short(worst),
        names(&all)
    );
    let severity = if worst < SHIFT.1 { Severity::Reservation } else { Severity::Failure };
    Some(Finding::new((code, name), (worst, SHIFT.0), severity, message, action))
}

/// The relative leave-one-out error, mean over outputs, of an emulator with this number of training runs.
pub fn left_out(relative: f64, runs: usize) -> Option<Finding> {
    if relative < LEFT_OUT.0 {
        return None;
    }
    let severity = if relative < LEFT_OUT.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "the emulator of {runs} runs misses {} of the variance of the response (leave-one-out)",
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

/// The root mean square error at `count` fresh runs at posterior draws over that of the errors elsewhere; `matters`
/// says whether errors of that size move the estimates.
pub fn at_posterior(ratio: f64, count: usize, matters: bool) -> Option<Finding> {
    if !matters || ratio < LARGER.0 {
        return None;
    }
    let severity = if ratio < LARGER.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "the emulator is off by {} times as much at {count} fresh runs at the posterior as at the runs \
         from which its error is known",
        short(ratio)
    );
    let figures = (ratio, LARGER.0);
    Some(Finding::new((EMULATOR, "posterior"), figures, severity, message, MORE_RUNS))
}

/// A refinement that ended before it reached what the study asks for.
pub fn unfinished(rounds: usize, ratio: f64, until: f64, clear: bool) -> Finding {
    let edge = if clear { "" } else { ", and the posterior meets the edge of the region" };
    let message = format!(
        "after {rounds} rounds of refinement the emulator's error at new runs is {} of the discrepancy, \
         and {} was asked for{edge}",
        short(ratio),
        short(until)
    );
    Finding::new((REFINEMENT, ""), (ratio, until), Severity::Reservation, message, ROUNDS)
}
