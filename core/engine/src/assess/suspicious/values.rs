//! Single values of a curve that look like typing errors, in a run whose other outputs are correct.

use lacuna_linalg::Matrix;

use super::{Fit, LeftOut, ROUNDING, sizes};
use crate::assess::words::short;
use crate::assess::{Finding, Severity};

/// Ratio of a jack-knife residual to the root mean square of the other runs at the same output from which on a value is
/// suspicious.
pub(super) const SCORE: f64 = 15.0;
/// Largest number of such values; more are a property of the response, such as a front that arrives at another time.
pub(super) const MOST: usize = 3;

/// A value that looks like a typing error.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// Row of the run.
    pub run: usize,
    /// Index of the output.
    pub output: usize,
    /// Ratio of its jack-knife residual to those of the other runs.
    pub score: f64,
    /// Value expected from the other runs.
    pub expected: f64,
}

/// Largest ratio of the residuals of its neighbours on the curve to that of a single wrong value: a run that differs
/// over a stretch has several large residuals.
const ALONE: f64 = 1.0 / 3.0;

/// Suspicious values of runs at points of the unit cube; `left_out` as in [`super::suspects`].
pub fn values(points: &Matrix, responses: &Matrix, left_out: Option<&LeftOut>) -> Vec<Value> {
    let Some(fit) = Fit::best(points, responses) else { return Vec::new() };
    let judges = Judges { fit, responses, left_out, sizes: sizes(responses) };
    let mut found: Vec<Value> = Vec::new();
    for j in 0..responses.columns() {
        found.extend(judges.worst(j).filter(|value| judges.is_alone(value)));
        if found.len() > MOST {
            return Vec::new();
        }
    }
    // Several such values in one run are a property of the run.
    let of_run = |run: usize| found.iter().filter(|value| value.run == run).count();
    found.iter().filter(|value| of_run(value.run) == 1).cloned().collect()
}

/// Fits that judge single values.
struct Judges<'a> {
    fit: Fit,
    responses: &'a Matrix,
    left_out: Option<&'a LeftOut>,
    sizes: Vec<f64>,
}

impl Judges<'_> {
    /// Errors at an output from the polynomials and, last, from the emulator, whose expectation is more accurate; with
    /// the score of each run.
    fn of_output(&self, j: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
        let runs = self.responses.rows();
        let alone = |i: usize| (1.0 - self.fit.leverage[i]).max(1e-6);
        let own: Vec<f64> = (0..runs).map(|i| self.fit.residuals[(i, j)] / alone(i)).collect();
        let emulator = self.left_out.map(|all| (all.errors.column(j), all.sizes.clone()));
        let scored = |(errors, expected): (Vec<f64>, Vec<f64>)| {
            let square = |i: usize| (errors[i] / expected[i]).powi(2) * alone(i);
            let total: f64 = (0..runs).map(square).sum();
            let floor = (ROUNDING * self.sizes[j]).powi(2);
            let rest = |i: usize| ((total - square(i)) / (runs - 1) as f64).max(floor);
            let scores = (0..runs).map(|i| (square(i) / rest(i)).sqrt()).collect();
            (errors, scores)
        };
        std::iter::once((own, vec![1.0; runs])).chain(emulator).map(scored).collect()
    }

    /// The most suspicious value of an output, if there is one.
    fn worst(&self, j: usize) -> Option<Value> {
        if self.sizes[j] <= 0.0 {
            return None;
        }
        let mut worst: Option<Value> = None;
        for (errors, scores) in self.of_output(j) {
            for (i, &score) in scores.iter().enumerate() {
                if score > SCORE && worst.as_ref().is_none_or(|w| score > w.score) {
                    let expected = self.responses[(i, j)] - errors[i];
                    worst = Some(Value { run: i, output: j, score, expected });
                }
            }
        }
        worst
    }

    /// Returns true unless the neighbouring outputs of the run have large residuals too.
    fn is_alone(&self, value: &Value) -> bool {
        let beside = [value.output.checked_sub(1), Some(value.output + 1)];
        let there = beside.into_iter().flatten().filter(|&j| j < self.sizes.len());
        let scores = there.filter(|&j| self.sizes[j] > 0.0).flat_map(|j| self.of_output(j));
        scores.into_iter().all(|(_, scores)| scores[value.run] < ALONE * value.score)
    }
}

/// Finding about a suspicious value.
pub fn suspicious(run: &str, place: &str, found: f64, value: &Value) -> Finding {
    let message = format!(
        "the deviation of its value {} at {place} from the predicted {} is {} times the usual one of the other \
         runs: it looks like a typing error",
        short(found),
        short(value.expected),
        short(value.score)
    );
    let figures = (value.score, SCORE);
    let place = format!("run {run}");
    Finding::new((super::CODE, &place), figures, Severity::Reservation, message, super::CORRECT)
}
