//! Checks of the simulation runs: their number near the posterior, and their agreement with the declared design.

use super::words::{count, names, percent, short};
use super::{Finding, Rule, Severity};

const FEW: &str = "few_runs_near_posterior";
const OUTSIDE: &str = "runs_outside_design";
const INVALID: &str = "runs_invalid";
const FAILED: &str = "failed_runs";
const IDLE: &str = "idle_parameter";
const EDGE: &str = "no_margin";

/// Number of runs per parameter that is the rule of thumb for an emulator (Loeppky, Sacks and Welch, Technometrics 51
/// (2009) 366).
const RUNS_PER_PARAMETER: usize = 10;
/// Shift of the estimates by the emulator's error, in standard deviations, below which no further runs are needed.
const NEGLIGIBLE: f64 = 0.1;
/// Ratio of the distance between the posterior and its nearest runs to the usual distance that gives a finding. In a
/// corner of an evenly filled design the ratio is two.
const SPARSE: f64 = 2.5;
/// Fractions of draws beyond all runs that give a reservation and a failure.
const BEYOND: (f64, f64) = (0.05, 0.5);
/// Distance from the end of the runs, as a fraction of their range, within which draws lie at the edge; and distance to
/// which runs must extend beyond the prior to count as a margin.
pub const AT_EDGE: (f64, f64) = (0.1, 0.03);
/// Fraction of draws at an edge of the runs that gives a finding if the emulator's error shifts the estimates by at
/// least this many posterior standard deviations.
const EDGE_SHARE: (f64, f64) = (0.5, 0.3);
/// Fraction of the runs inside the prior that the model reports as invalid, which gives a reservation.
const INVALID_SHARE: f64 = 0.05;
/// Fractions of failed runs that give a reservation and a failure.
const FAILED_SHARE: (f64, f64) = (0.1, 0.5);

const MORE_RUNS: &str = "raise `[design] runs`, narrow a `design` that is much wider than the `prior`, or add runs \
                         near \
                         the posterior with `[surrogate] refine`";
const NARROW_PRIOR: &str =
    "make runs on the whole `prior`, including a margin beyond it, or narrow the `prior`";
const CORRECT_DESIGN: &str = "correct the `design` of the parameters or the table of runs";
const VALIDITY: &str = "narrow `design` and `prior` to the region where the model is valid";
const REPEAT: &str = "find out why they failed and repeat them: `lacuna campaign retry RUN`";
const MARGIN: &str = "extend the runs beyond the prior if the model can be evaluated there: `[design] margin = \
                      0.1`, or a wider `design` of the parameter; otherwise add runs near the posterior with \
                      `[surrogate] refine`";
const REMOVE: &str = "remove the parameter from the study, or connect it to the model";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: FEW,
            looks_at: format!(
                "number of training runs inside the prior's central 99 %, compared with {RUNS_PER_PARAMETER} per \
                 parameter; the fraction of posterior draws beyond all training runs, by parameter; the distance \
                 from the posterior mean to its nearest runs, relative to the median of the same distance between runs"
            ),
            threshold: format!(
                "fewer than {RUNS_PER_PARAMETER} runs per parameter: reservation; no more runs than parameters: \
                 failure; no finding if the emulator's error shifts every estimate by less than {NEGLIGIBLE} sd. {} \
                 of the draws beyond all runs: reservation; {}: failure. Nearest runs {SPARSE} times as far as \
                 usual: reservation (a factor of two is usual in a corner), with the same exception",
                percent(BEYOND.0),
                percent(BEYOND.1)
            ),
            why: "the emulator's error is known only near the runs; a posterior elsewhere relies on extrapolation \
                  (ten runs per parameter: Loeppky, Sacks and Welch 2009)",
            action: MORE_RUNS,
        },
        Rule {
            code: OUTSIDE,
            looks_at:
                "runs outside the declared `design`, to the last digit of the table; for unbounded distributions, \
                 beyond a tail probability of 1e-9"
                    .to_owned(),
            threshold: "any: an error of the reading stage; a reservation with \
                        `[simulations] outside_design = \"allow\"`"
                .to_owned(),
            why: "a polynomial expansion is orthogonal on the declared design but would be trained elsewhere: \
                  design or table is wrong",
            action: CORRECT_DESIGN,
        },
        Rule {
            code: INVALID,
            looks_at: "runs that the model reports as outside its range of validity, all and inside the prior"
                .to_owned(),
            threshold: format!(
                "excluded from the training: note; used for the training (`[surrogate] invalid_runs = \"train\"`), or \
                 {} of those inside the prior: reservation",
                percent(INVALID_SHARE)
            ),
            why: "responses outside the model's range of validity are not physical; if many lie inside the prior, \
                  the prior extends beyond the model",
            action: VALIDITY,
        },
        Rule {
            code: FAILED,
            looks_at: "the fraction of runs without a usable response".to_owned(),
            threshold: format!(
                "any: note; {}: reservation; {}: failure",
                percent(FAILED_SHARE.0),
                percent(FAILED_SHARE.1)
            ),
            why: "runs do not fail at random: the emulator extrapolates to where they failed",
            action: REPEAT,
        },
        Rule {
            code: EDGE,
            looks_at: format!(
                "the fraction of draws within {} of the range of the training runs from its end, if the runs end \
                 with the prior (extend less than {} of their range beyond it), by parameter",
                percent(AT_EDGE.0),
                percent(AT_EDGE.1)
            ),
            threshold: format!(
                "{}: note; no finding if the emulator's error shifts every estimate by less than {} sd",
                percent(EDGE_SHARE.0),
                EDGE_SHARE.1
            ),
            why: "an emulator is least accurate at the edge of its runs, where its error is also estimated from few \
                  runs",
            action: MARGIN,
        },
        Rule {
            code: IDLE,
            looks_at: "parameters on which no response depends".to_owned(),
            threshold: "any: reservation".to_owned(),
            why: "the posterior of such a parameter equals its prior, whatever the measurements",
            action: REMOVE,
        },
    ]
}

/// Finding about too few training runs inside the prior (`inside` of `of`) for this number of parameters; `shift` is
/// the shift of the estimates by the emulator's error, in posterior standard deviations.
pub fn few_in_prior(
    inside: usize,
    of: usize,
    parameters: usize,
    shift: Option<f64>,
) -> Option<Finding> {
    let needed = RUNS_PER_PARAMETER * parameters;
    if inside >= needed || shift.is_some_and(|shift| shift < NEGLIGIBLE) {
        return None;
    }
    let severity = if inside <= parameters { Severity::Failure } else { Severity::Reservation };
    let message = format!(
        "{inside} of {} are inside the prior, and {} require about {needed}: the emulator's error in the region of \
         the calibration is poorly known",
        count(of, "training run"),
        count(parameters, "parameter")
    );
    Some(Finding::new((FEW, "prior"), (inside as f64, needed as f64), severity, message, MORE_RUNS))
}

/// Finding about posterior draws of a parameter beyond all training runs, whose range is `low` to `high`.
pub fn extrapolated(name: &str, share: f64, (low, high): (f64, f64)) -> Option<Finding> {
    if share < BEYOND.0 {
        return None;
    }
    let severity = if share < BEYOND.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "{} of the posterior lies beyond all training runs, whose range is {} to {}: the emulator extrapolates there",
        percent(share),
        short(low),
        short(high)
    );
    Some(Finding::new((FEW, name), (share, BEYOND.0), severity, message, NARROW_PRIOR))
}

/// Finding about the fraction of draws at an edge of the runs, if neither runs nor prior extend beyond it; `shift` as
/// in [`few_in_prior`].
pub fn no_margin(name: &str, share: f64, end: f64, shift: Option<f64>) -> Option<Finding> {
    if share < EDGE_SHARE.0 || shift.is_none_or(|shift| shift < EDGE_SHARE.1) {
        return None;
    }
    let message = format!(
        "{} of the posterior lies at the end of the training runs, {}, and no run is beyond the prior there: an \
         emulator is least accurate at the edge of its runs",
        percent(share),
        short(end)
    );
    Some(Finding::new((EDGE, name), (share, EDGE_SHARE.0), Severity::Note, message, MARGIN))
}

/// Finding about the ratio of the distance from the posterior to its nearest training runs to the usual distance
/// between runs; `shift` as in [`few_in_prior`].
pub fn sparse(ratio: f64, shift: Option<f64>) -> Option<Finding> {
    if ratio.is_nan() || ratio < SPARSE || shift.is_some_and(|shift| shift < NEGLIGIBLE) {
        return None;
    }
    let message = format!(
        "the distance from the posterior to its nearest training runs is {} times the usual distance between runs",
        short(ratio)
    );
    let severity = Severity::Reservation;
    Some(Finding::new((FEW, "posterior"), (ratio, SPARSE), severity, message, MORE_RUNS))
}

/// Finding about runs outside the declared design that the study permits, with the parameters concerned.
pub fn outside_design(outside: usize, of: usize, parameters: &[String]) -> Option<Finding> {
    if outside == 0 {
        return None;
    }
    let message = format!(
        "{outside} of {} lie outside the declared design in {}, as the study allows",
        count(of, "run"),
        names(parameters)
    );
    let severity = Severity::Reservation;
    Some(Finding::new((OUTSIDE, ""), (outside as f64, 0.0), severity, message, CORRECT_DESIGN))
}

/// Numbers of runs that the model reports as invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Invalid {
    /// Number of invalid runs, and of all runs.
    pub all: (usize, usize),
    /// Number of invalid runs inside the prior, and of all runs there.
    pub in_prior: (usize, usize),
    /// True if the surrogate was trained on them.
    pub trained: bool,
}

/// Finding about invalid runs.
pub fn invalid(runs: &Invalid) -> Option<Finding> {
    let (invalid, of) = runs.all;
    if invalid == 0 {
        return None;
    }
    let (inside, of_inside) = runs.in_prior;
    let share = inside as f64 / of_inside.max(1) as f64;
    let many = share >= INVALID_SHARE;
    let what = if runs.trained { "and used for training the surrogate" } else { "and excluded" };
    let message = format!(
        "{invalid} of {} are outside the model's range of validity {what}; inside the prior {inside} of {of_inside}",
        count(of, "run")
    );
    let severity = if runs.trained || many { Severity::Reservation } else { Severity::Note };
    let figure = if runs.trained { invalid as f64 / of as f64 } else { share };
    Some(Finding::new((INVALID, ""), (figure, INVALID_SHARE), severity, message, VALIDITY))
}

/// Finding about runs without a usable response, out of all runs.
pub fn failed(failed: usize, of: usize) -> Option<Finding> {
    if failed == 0 {
        return None;
    }
    let share = failed as f64 / of.max(1) as f64;
    let severity = match share {
        _ if share < FAILED_SHARE.0 => Severity::Note,
        _ if share < FAILED_SHARE.1 => Severity::Reservation,
        _ => Severity::Failure,
    };
    let verb = if failed == 1 { "has" } else { "have" };
    let message = format!(
        "{failed} of {} {verb} no usable response and {} excluded",
        count(of, "simulation run"),
        if failed == 1 { "is" } else { "are" }
    );
    Some(Finding::new((FAILED, ""), (share, FAILED_SHARE.0), severity, message, REPEAT))
}

/// Finding about a parameter that the model does not use.
pub fn idle(name: &str) -> Finding {
    let message =
        String::from("the model does not use this parameter: its posterior equals its prior");
    Finding::new((IDLE, name), (0.0, 0.0), Severity::Reservation, message, REMOVE)
}
