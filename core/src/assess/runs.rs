//! The simulation runs: are there enough of them where the answer lies, and are they what the study says.

use super::words::{count, names, percent, short};
use super::{Finding, Rule, Severity};

const FEW: &str = "few_runs_near_posterior";
const OUTSIDE: &str = "runs_outside_design";
const INVALID: &str = "runs_invalid";
const FAILED: &str = "failed_runs";
const IDLE: &str = "idle_parameter";
const EDGE: &str = "no_margin";

/// So many runs for each parameter are a rule of thumb for an emulator (Loeppky, Sacks and Welch, Technometrics 51
/// (2009) 366).
const RUNS_PER_PARAMETER: usize = 10;
/// An emulator's error that moves estimates by less than this many standard deviations needs no further runs.
const NEGLIGIBLE: f64 = 0.1;
/// How many times farther than usual the runs nearest to the posterior may be. In a corner of a design that is filled
/// evenly they are twice as far.
const SPARSE: f64 = 2.5;
/// The share of draws beyond all runs that is a reservation, and a failure.
const BEYOND: (f64, f64) = (0.05, 0.5);
/// How near to the end of the runs, as a share of their range, draws lie at their edge, and how far runs reach beyond the prior
/// where they have a margin.
pub const AT_EDGE: (f64, f64) = (0.1, 0.03);
/// The share of draws at an edge of the runs that is told, where the emulator's error moves estimates by so many posterior
/// standard deviations.
const EDGE_SHARE: (f64, f64) = (0.5, 0.3);
/// The share of runs inside the prior that the model calls invalid: a reservation.
const INVALID_SHARE: f64 = 0.05;
/// The share of failed runs that is a reservation, and a failure.
const FAILED_SHARE: (f64, f64) = (0.1, 0.5);

const MORE_RUNS: &str = "raise `[design] runs`, narrow a `design` that is much wider than the `prior`, or add runs near \
                         the posterior with `[surrogate] refine`";
const NARROW_PRIOR: &str =
    "make runs on the whole `prior`, a margin beyond it included, or narrow the `prior`";
const CORRECT_DESIGN: &str = "correct the `design` of the parameters or the table of runs";
const VALIDITY: &str = "narrow `design` and `prior` to where the model holds";
const REPEAT: &str = "look at why they failed and make them again: `lacuna campaign retry RUN`";
const MARGIN: &str = "let the runs reach beyond the prior where the model has answers there: `[design] margin = 0.1`, or a wider \
                      `design` of the parameter; where it has none, add runs near the posterior with `[surrogate] refine`";
const REMOVE: &str = "take the parameter out of the study, or connect it with the model";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: FEW,
            looks_at: format!(
                "training runs inside the prior's central 99 %, against {RUNS_PER_PARAMETER} a \
                 parameter; the share of posterior draws beyond all training runs, by parameter; the distance from \
                 the posterior mean to its nearest runs, over the median of the same distance from run to run"
            ),
            threshold: format!(
                "fewer than {RUNS_PER_PARAMETER} runs a parameter: reservation; no more runs than \
                 parameters: failure; silent where the emulator's error moves no estimate by {NEGLIGIBLE} sd. \
                 {} of the draws beyond all runs: reservation; {}: failure. Nearest runs {SPARSE} times as far as usual: \
                 reservation (twice is usual in a corner), silent likewise",
                percent(BEYOND.0),
                percent(BEYOND.1)
            ),
            why: "the emulator's error is learned where the runs are; a posterior elsewhere is extrapolated \
                  (ten runs a parameter: Loeppky, Sacks and Welch 2009)",
            action: MORE_RUNS,
        },
        Rule {
            code: OUTSIDE,
            looks_at:
                "runs outside the declared `design`, to the last digit of the table; unbounded \
                       laws: beyond a tail of 1e-9"
                    .to_owned(),
            threshold: "any: an error of the reading stage; a reservation with \
                        `[simulations] outside_design = \"allow\"`"
                .to_owned(),
            why: "a polynomial expansion is orthogonal on the declared design and is trained elsewhere: \
                  design or table is wrong",
            action: CORRECT_DESIGN,
        },
        Rule {
            code: INVALID,
            looks_at: "runs that the model calls outside its validity, all and inside the prior"
                .to_owned(),
            threshold: format!(
                "left out of the training: note; trained on (`[surrogate] invalid_runs = \"train\"`), or \
                 {} of those inside the prior: reservation",
                percent(INVALID_SHARE)
            ),
            why: "responses outside the model's validity are no physics; where many lie inside the prior, \
                  the prior asks the model what it does not know",
            action: VALIDITY,
        },
        Rule {
            code: FAILED,
            looks_at: "the share of runs without a usable response".to_owned(),
            threshold: format!(
                "any: note; {}: reservation; {}: failure",
                percent(FAILED_SHARE.0),
                percent(FAILED_SHARE.1)
            ),
            why: "runs do not fail at random: the emulator guesses where they failed",
            action: REPEAT,
        },
        Rule {
            code: EDGE,
            looks_at: format!(
                "the share of draws within {} of the range of the training runs from its end, where the runs end with the \
                 prior (reach less than {} of their range beyond it), by parameter",
                percent(AT_EDGE.0),
                percent(AT_EDGE.1)
            ),
            threshold: format!(
                "{}: note; silent where the emulator's error moves no estimate by {} sd",
                percent(EDGE_SHARE.0),
                EDGE_SHARE.1
            ),
            why: "an emulator is worst at the edge of its runs, and what is known of its error there comes from few runs",
            action: MARGIN,
        },
        Rule {
            code: IDLE,
            looks_at: "parameters on which no response depends".to_owned(),
            threshold: "any: reservation".to_owned(),
            why: "the posterior of such a parameter is its prior, whatever was measured",
            action: REMOVE,
        },
    ]
}

/// Too few of `of` training runs inside the prior for this number of parameters; `shift` is what the emulator's error
/// does to the estimates, in posterior standard deviations.
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
        "{inside} of {} are inside the prior, and {} want about {needed}: what the emulator is \
         wrong by where the calibration looks is hardly known",
        count(of, "training run"),
        count(parameters, "parameter")
    );
    Some(Finding::new((FEW, "prior"), (inside as f64, needed as f64), severity, message, MORE_RUNS))
}

/// Posterior draws of a parameter beyond all training runs, which reach from `low` to `high`.
pub fn extrapolated(name: &str, share: f64, (low, high): (f64, f64)) -> Option<Finding> {
    if share < BEYOND.0 {
        return None;
    }
    let severity = if share < BEYOND.1 { Severity::Reservation } else { Severity::Failure };
    let message = format!(
        "{} of the posterior lie beyond all training runs, which reach from {} to {}: there the \
         emulator extrapolates",
        percent(share),
        short(low),
        short(high)
    );
    Some(Finding::new((FEW, name), (share, BEYOND.0), severity, message, NARROW_PRIOR))
}

/// The share of draws at an edge of the runs beyond which none reach although the prior ends there; `shift` as in
/// [`few_in_prior`].
pub fn no_margin(name: &str, share: f64, end: f64, shift: Option<f64>) -> Option<Finding> {
    if share < EDGE_SHARE.0 || shift.is_none_or(|shift| shift < EDGE_SHARE.1) {
        return None;
    }
    let message = format!(
        "{} of the posterior lie at the end of the training runs, {}, and no run is beyond the prior there: an emulator is \
         worst at the edge of its runs",
        percent(share),
        short(end)
    );
    Some(Finding::new((EDGE, name), (share, EDGE_SHARE.0), Severity::Note, message, MARGIN))
}

/// The distance from the posterior to its nearest training runs over what is usual between runs; `shift` as in
/// [`few_in_prior`].
pub fn sparse(ratio: f64, shift: Option<f64>) -> Option<Finding> {
    if ratio.is_nan() || ratio < SPARSE || shift.is_some_and(|shift| shift < NEGLIGIBLE) {
        return None;
    }
    let message = format!(
        "the training runs nearest to the posterior are {} times as far from it as runs are from each other",
        short(ratio)
    );
    let severity = Severity::Reservation;
    Some(Finding::new((FEW, "posterior"), (ratio, SPARSE), severity, message, MORE_RUNS))
}

/// Runs outside the declared design that the study allows, with the parameters concerned.
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

/// Runs that the model calls invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Invalid {
    /// How many, of how many runs.
    pub all: (usize, usize),
    /// The same among runs inside the prior.
    pub in_prior: (usize, usize),
    /// Whether the surrogate was trained on them.
    pub trained: bool,
}

/// See [`Invalid`].
pub fn invalid(runs: &Invalid) -> Option<Finding> {
    let (invalid, of) = runs.all;
    if invalid == 0 {
        return None;
    }
    let (inside, of_inside) = runs.in_prior;
    let share = inside as f64 / of_inside.max(1) as f64;
    let many = share >= INVALID_SHARE;
    let what = if runs.trained { "and the surrogate is trained on them" } else { "and left out" };
    let message = format!(
        "{invalid} of {} are outside the model's validity {what}; inside the prior {inside} of {of_inside}",
        count(of, "run")
    );
    let severity = if runs.trained || many { Severity::Reservation } else { Severity::Note };
    let figure = if runs.trained { invalid as f64 / of as f64 } else { share };
    Some(Finding::new((INVALID, ""), (figure, INVALID_SHARE), severity, message, VALIDITY))
}

/// Runs without a usable response, of all runs.
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
        "{failed} of {} {verb} no usable response and {} left out",
        count(of, "simulation run"),
        if failed == 1 { "is" } else { "are" }
    );
    Some(Finding::new((FAILED, ""), (share, FAILED_SHARE.0), severity, message, REPEAT))
}

/// A parameter that the model does not use.
pub fn idle(name: &str) -> Finding {
    let message = String::from("the model does not use it: its posterior is its prior");
    Finding::new((IDLE, name), (0.0, 0.0), Severity::Reservation, message, REMOVE)
}
