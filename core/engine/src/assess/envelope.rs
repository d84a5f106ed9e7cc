//! Data outside the range of all runs.

use super::words::{percent, short};
use super::{Finding, Rule, Severity};

const CODE: &str = "data_outside_runs";
const UNANSWERED: &str = "model_without_answer";

/// Fractions of a curve's values outside the range of all runs that give a reservation and a failure.
const SHARE: (f64, f64) = (0.1, 0.5);
/// Tolerance beyond the range of the runs, in standard deviations of the noise.
const NOISES: f64 = 3.0;
/// Factor by which the values of a curve may be larger or smaller than those of all runs.
const FACTOR: f64 = 5.0;
/// Factor within which a ratio counts as a power of ten.
const NEAR: f64 = 1.6;

const WIDEN: &str = "compare data and model: a sign, an offset, a delay, a unit, or missing physics (`lacuna gap \
                     STUDY`); widen the design if the parameters may lie outside it";
const RESTRICT: &str =
    "narrow the prior to the region where the model can be evaluated, or repair the model";
const UNIT: &str = "check the unit of the measurements and of the model's response";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: CODE,
            looks_at: format!(
                "by curve, the fraction of the replicates' means outside the range of all runs (without runs: of \
                 the model at prior draws) by more than {NOISES} standard errors, without replicates of the stated noise or of the \
                 scatter along the curve; the root mean square of the data \
                 relative to that of every run"
            ),
            threshold: format!(
                "{} of a curve: reservation; {}: failure; {FACTOR} times larger or smaller than every run: failure",
                percent(SHARE.0),
                percent(SHARE.1)
            ),
            why: "a calibration can only interpolate between the runs; data outside all of them drive every \
                  parameter to an edge",
            action: WIDEN,
        },
        Rule {
            code: UNANSWERED,
            looks_at:
                "draws from the prior at which a model without a surrogate cannot be evaluated"
                    .to_owned(),
            threshold: format!(
                "any: note; {}: reservation; {}: failure",
                percent(SHARE.0),
                percent(SHARE.1)
            ),
            why: "a point without a response has zero posterior density, whatever the reason",
            action: RESTRICT,
        },
    ]
}

/// One measured curve compared with the runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Beside {
    /// Name of the curve's group.
    pub name: String,
    /// Mean of the replicates and its standard error, for each value.
    pub data: Vec<(f64, f64)>,
    /// Smallest and largest response of the runs, for each value.
    pub runs: Vec<(f64, f64)>,
    /// Root mean square response of each run over the curve's values.
    pub sizes: Vec<f64>,
}

/// Finding about a curve outside the range of the runs.
pub fn outside(curve: &Beside) -> Option<Finding> {
    if curve.data.is_empty() || curve.sizes.is_empty() {
        return None;
    }
    if let Some(finding) = other_size(curve) {
        return Some(finding);
    }
    let own = size(&curve.data);
    let beyond = |&(&(y, error), &(low, high)): &(&(f64, f64), &(f64, f64))| {
        // Where the response of all runs is constant (before a wave arrives), their range is rounding error and says
        // nothing.
        let slack = NOISES * error + 0.02 * (high - low) + 1e-3 * own;
        y < low - slack || y > high + slack
    };
    let count = curve.data.iter().zip(&curve.runs).filter(beyond).count();
    let share = count as f64 / curve.data.len() as f64;
    if share < SHARE.0 || curve.data.len() == 1 && count == 0 {
        return None;
    }
    let severity = if share < SHARE.1 { Severity::Reservation } else { Severity::Failure };
    let message =
        format!("{} of the measured values lie outside the range of all runs", percent(share));
    Some(Finding::new((CODE, &curve.name), (share, SHARE.0), severity, message, WIDEN))
}

fn size(data: &[(f64, f64)]) -> f64 {
    (data.iter().map(|(y, _)| y * y).sum::<f64>() / data.len() as f64).sqrt()
}

fn other_size(curve: &Beside) -> Option<Finding> {
    let own = size(&curve.data);
    let noise =
        (curve.data.iter().map(|(_, e)| e * e).sum::<f64>() / curve.data.len() as f64).sqrt();
    let mut sizes = curve.sizes.clone();
    sizes.sort_by(f64::total_cmp);
    let (least, most) = (sizes[0], sizes[sizes.len() - 1]);
    let typical = sizes[sizes.len() / 2];
    // A curve that consists of noise only has no scale of its own.
    if own <= NOISES * noise || typical <= 0.0 || own <= 0.0 {
        return None;
    }
    let (word, factor) = if own > FACTOR * most {
        ("large", own / typical)
    } else if own < least / FACTOR {
        ("small", typical / own)
    } else {
        return None;
    };
    let power = 10_f64.powf(factor.log10().round());
    let ratio = (factor / power).max(power / factor);
    let (times, hint) = if ratio <= NEAR && power >= 10.0 {
        (format!("{power:.0}"), ": check the unit")
    } else {
        (short(factor), "")
    };
    let message = format!("the data are about {times} times too {word} for the model{hint}");
    let figures = (factor, FACTOR);
    Some(Finding::new((CODE, &curve.name), figures, Severity::Failure, message, UNIT))
}

/// Finding about points of the prior at which the model has no response.
pub fn unanswered(without: usize, of: usize) -> Option<Finding> {
    if without == 0 {
        return None;
    }
    let share = without as f64 / of as f64;
    let severity = match share {
        _ if share < SHARE.0 => Severity::Note,
        _ if share < SHARE.1 => Severity::Reservation,
        _ => Severity::Failure,
    };
    let message = format!(
        "the model cannot be evaluated at {without} of {of} points of the prior, which therefore have zero \
         posterior density"
    );
    Some(Finding::new((UNANSWERED, "prior"), (share, SHARE.0), severity, message, RESTRICT))
}
