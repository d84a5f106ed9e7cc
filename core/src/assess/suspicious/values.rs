//! Single values of a curve that look like typing errors: a run that is sound but for one output.

use super::{Fit, LeftOut, ROUNDING, sizes};
use crate::assess::words::short;
use crate::assess::{Finding, Severity};
use crate::linalg::Matrix;

/// How many times the root mean square of the other runs at the same output a jack-knife residual may be.
pub(super) const SCORE: f64 = 15.0;
/// More such values are the shape of the response, such as a front that arrives at another time.
pub(super) const MOST: usize = 3;

/// A value that looks like a typing error.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// The run's row.
    pub run: usize,
    /// The output.
    pub output: usize,
    /// Its jack-knife residual over those of the other runs.
    pub score: f64,
    /// What the other runs let expect.
    pub expected: f64,
}

/// The suspicious values of runs at points of the unit cube; `left_out` as in [`super::suspects`].
pub fn values(points: &Matrix, responses: &Matrix, left_out: Option<&LeftOut>) -> Vec<Value> {
    let Some(fit) = Fit::best(points, responses) else { return Vec::new() };
    let sizes = sizes(responses);
    let alone = |i: usize| (1.0 - fit.leverage[i]).max(1e-6);
    let mut found: Vec<Value> = Vec::new();
    for (j, &size) in sizes.iter().enumerate().filter(|(_, size)| **size > 0.0) {
        let own: Vec<f64> = (0..points.rows()).map(|i| fit.residuals[(i, j)] / alone(i)).collect();
        let ones = vec![1.0; points.rows()];
        let emulator = left_out.map(|all| (all.errors.column(j), &all.sizes));
        let mut worst: Option<Value> = None;
        // The emulator comes last: what it expects is better known than what a polynomial does.
        for (errors, expected) in std::iter::once((own, &ones)).chain(emulator) {
            let square = |i: usize| (errors[i] / expected[i]).powi(2) * alone(i);
            let total: f64 = (0..errors.len()).map(square).sum();
            let others = (errors.len() - 1) as f64;
            for i in 0..errors.len() {
                let rest = ((total - square(i)) / others).max((ROUNDING * size).powi(2));
                let score = (square(i) / rest).sqrt();
                if score > SCORE && worst.as_ref().is_none_or(|w| score > w.score) {
                    let expected = responses[(i, j)] - errors[i];
                    worst = Some(Value { run: i, output: j, score, expected });
                }
            }
        }
        found.extend(worst);
        if found.len() > MOST {
            return Vec::new();
        }
    }
    // Several in one run are how the run goes.
    let of_run = |run: usize| found.iter().filter(|value| value.run == run).count();
    found.iter().filter(|value| of_run(value.run) == 1).cloned().collect()
}

/// A suspicious value in words.
pub fn suspicious(run: &str, place: &str, found: f64, value: &Value) -> Finding {
    let message = format!(
        "its value {} at {place} is {} times as far from {}, which the other runs let expect, as theirs are: it \
         looks like a typing error",
        short(found),
        short(value.score),
        short(value.expected)
    );
    let figures = (value.score, SCORE);
    let place = format!("run {run}");
    Finding::new((super::CODE, &place), figures, Severity::Reservation, message, super::CORRECT)
}
