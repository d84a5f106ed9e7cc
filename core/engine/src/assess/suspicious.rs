//! Runs that look like typing errors.
//!
//! Two fits judge every run without using it: polynomials of the parameters, whose leverages are known, and the
//! emulator by its leave-one-out residuals. A run is suspicious if its jack-knife residual, over all outputs, is far
//! beyond those of all other runs (Cook and Weisberg, Residuals and Influence in Regression, 1982, chapter 2). A smooth
//! function that the polynomials cannot represent leaves residuals of similar size at many runs; a typing error leaves
//! a large one at a single run. More than a few such runs are not typing errors.

pub mod values;

use std::borrow::Cow;

use lacuna_linalg::{Matrix, multiply, thin_qr, transposed_multiply};

use super::words::{percent, short};
use super::{Finding, Rule, Severity};

const CODE: &str = "suspicious_run";

/// Ratio of a run's jack-knife residual to the root mean square of all other runs from which on it is suspicious.
const SCORE: f64 = 10.0;
/// Largest number and largest fraction of runs that are called typing errors.
const MOST: (usize, f64) = (3, 0.05);
/// Smallest number of runs that are judged.
const FEWEST: usize = 8;
/// Smallest number of runs per term of a polynomial.
const PER_TERM: usize = 3;
/// Highest total degree of the polynomials.
const DEGREE: usize = 4;
/// Fraction of the output's own size below which a scale counts as rounding.
const ROUNDING: f64 = 1e-6;

const CORRECT: &str =
    "compare the run with its input and output files; correct the table or remove the run";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "each run's jack-knife residual, scaled by its leverage, relative to the root mean square of \
                   those of all other runs, for polynomials of the parameters and for the emulator (its errors \
                   relative to their stated size); the same for each value"
            .to_owned(),
        threshold: format!(
            "{SCORE}: reservation, at most {} runs or {} of them; single values of a curve: {}, at most {}, one per \
             run and isolated",
            MOST.0,
            percent(MOST.1),
            values::SCORE,
            values::MOST
        ),
        why: "one wrong number distorts the emulator everywhere; normal residuals do not reach 10, and of 400 \
              correct ensembles of smooth functions at most 1 % have a run above it (counted by a test)",
        action: CORRECT,
    }]
}

/// A run that looks like a typing error.
#[derive(Debug, Clone, PartialEq)]
pub struct Suspect {
    /// Row of the run.
    pub run: usize,
    /// Ratio of its jack-knife residual to that of the others.
    pub score: f64,
    /// Ratio of its response to the expected one, if that is one factor for all outputs.
    pub factor: Option<f64>,
    /// Index of a parameter, and the value on the unit scale that would explain the response.
    pub parameter: Option<(usize, f64)>,
}

/// Leave-one-out errors of the emulator.
#[derive(Debug, Clone)]
pub struct LeftOut {
    /// Response minus emulator, `runs x outputs`.
    pub errors: Matrix,
    /// Expected size of the emulator's error at each run, relative to the others; ones if the emulator does not state
    /// it. An emulator may have a large error far from other runs without any wrong number.
    pub sizes: Vec<f64>,
}

/// Suspicious runs among runs at points of the unit cube (`runs x parameters`), the most suspicious first.
pub fn suspects(points: &Matrix, responses: &Matrix, left_out: Option<&LeftOut>) -> Vec<Suspect> {
    if points.rows() < FEWEST {
        return Vec::new();
    }
    let most = MOST.0.min((MOST.1 * points.rows() as f64).ceil() as usize);
    let mut kept: Vec<usize> = (0..points.rows()).collect();
    let mut found: Vec<Suspect> = Vec::new();
    while let Some((row, score)) = worst(points, responses, left_out, &kept) {
        if found.len() == most {
            // This many outliers are a property of the function, not typing errors.
            return Vec::new();
        }
        let run = kept.remove(row);
        let (factor, parameter) = explain(points, responses, &kept, run);
        found.push(Suspect { run, score, factor, parameter });
        if kept.len() < FEWEST {
            break;
        }
    }
    found
}

/// The most suspicious of some runs, as its index among them with its score.
fn worst(
    points: &Matrix,
    responses: &Matrix,
    left_out: Option<&LeftOut>,
    kept: &[usize],
) -> Option<(usize, f64)> {
    // Of many runs a copy of all responses would take hundreds of megabytes.
    let responses = if kept.len() == responses.rows() {
        Cow::Borrowed(responses)
    } else {
        Cow::Owned(responses.select_rows(kept))
    };
    let fit = Fit::best(&points.select_rows(kept), &responses)?;
    let sizes = sizes(&responses);
    let mut scores = scores(|i, j| fit.residuals[(i, j)], &fit.leverage, &sizes);
    if let Some(LeftOut { errors, sizes: expected }) = left_out {
        // The emulator was fitted with all runs, so only the first outlier is judged by it.
        if kept.len() == errors.rows() {
            let scaled =
                |i: usize, j: usize| errors[(i, j)] / expected[i] * (1.0 - fit.leverage[i]);
            let emulator = self::scores(scaled, &fit.leverage, &sizes);
            for (score, other) in scores.iter_mut().zip(emulator) {
                *score = score.max(other);
            }
        }
    }
    let row = (0..scores.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
    (scores[row] > SCORE).then_some((row, scores[row]))
}

/// Root mean square of each output about its mean.
fn sizes(responses: &Matrix) -> Vec<f64> {
    let count = responses.rows() as f64;
    let size = |j: usize| {
        let column = responses.column(j);
        let mean = column.iter().sum::<f64>() / count;
        let square = column.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / count;
        (square.sqrt(), (square + mean * mean).sqrt())
    };
    (0..responses.columns())
        .map(|j| {
            let (sd, whole) = size(j);
            if sd > 1e-12 * whole { sd } else { 0.0 }
        })
        .collect()
}

/// Residual of each run, scaled by its leverage, relative to the root mean square of all others; all outputs together,
/// each in units of its own residuals.
fn scores(residual: impl Fn(usize, usize) -> f64, leverage: &[f64], sizes: &[f64]) -> Vec<f64> {
    let n = leverage.len();
    let mut square = vec![0.0; n];
    for (j, &size) in sizes.iter().enumerate().filter(|(_, size)| **size > 0.0) {
        let scaled = |i: usize| residual(i, j).powi(2) / (1.0 - leverage[i]).max(1e-6);
        let mut all: Vec<f64> = (0..n).map(scaled).collect();
        let floor = (ROUNDING * size).powi(2);
        let unit = {
            let mut sorted = all.clone();
            sorted.sort_by(f64::total_cmp);
            // Mean square without the largest tenth, which a single wrong run and its neighbours may dominate.
            let inner = &sorted[..(9 * n).div_ceil(10)];
            (inner.iter().sum::<f64>() / inner.len() as f64).max(floor)
        };
        for s in &mut *all {
            *s /= unit;
        }
        square.iter_mut().zip(&all).for_each(|(sum, s)| *sum += s);
    }
    let total: f64 = square.iter().sum();
    let outputs = sizes.iter().filter(|size| **size > 0.0).count() as f64;
    square
        .iter()
        .map(|own| (own / ((total - own) / (n as f64 - 1.0)).max(outputs * 0.5)).sqrt())
        .collect()
}

/// A polynomial fit.
struct Fit {
    residuals: Matrix,
    leverage: Vec<f64>,
    coefficients: (usize, Matrix),
}

impl Fit {
    /// The fit of the total degree with the smallest sum of squared jack-knife residuals, each output in units of its
    /// size.
    fn best(points: &Matrix, responses: &Matrix) -> Option<Self> {
        let sizes = sizes(responses);
        let mut best: Option<(f64, Self)> = None;
        for degree in 0..=DEGREE {
            let terms = count(points.columns(), degree);
            if degree > 1 && PER_TERM * terms > points.rows() || terms + 2 > points.rows() {
                break;
            }
            let terms = basis(points, degree);
            let fit = Self::of(&terms, responses, degree)?;
            let press = fit.press(&sizes);
            if best.as_ref().is_none_or(|(least, _)| press < *least) {
                best = Some((press, fit));
            }
        }
        best.map(|(_, fit)| fit)
    }

    fn of(terms: &Matrix, responses: &Matrix, degree: usize) -> Option<Self> {
        let qr = thin_qr(terms).ok()?;
        let leverage: Vec<f64> =
            qr.q.iter_rows().map(|row| row.iter().map(|q| q * q).sum::<f64>().min(1.0)).collect();
        let projected = transposed_multiply(&qr.q, responses);
        let mut residuals = multiply(&qr.q, &projected);
        let pairs = residuals.as_mut_slice().iter_mut().zip(responses.as_slice());
        pairs.for_each(|(fitted, response)| *fitted = response - *fitted);
        let mut coefficients = projected;
        lacuna_linalg::solve_upper_matrix(&qr.r, &mut coefficients);
        Some(Self { residuals, leverage, coefficients: (degree, coefficients) })
    }

    fn press(&self, sizes: &[f64]) -> f64 {
        let outputs = sizes.iter().enumerate().filter(|(_, size)| **size > 0.0);
        let one = |(j, size): (usize, &f64)| -> f64 {
            let each = self.leverage.iter().enumerate();
            each.map(|(i, h)| (self.residuals[(i, j)] / (1.0 - h).max(1e-6) / size).powi(2)).sum()
        };
        outputs.map(one).sum()
    }

    fn predict(&self, points: &Matrix) -> Matrix {
        multiply(&basis(points, self.coefficients.0), &self.coefficients.1)
    }
}

/// Number of monomials of `d` variables up to a total degree.
fn count(d: usize, degree: usize) -> usize {
    (1..=degree).fold(1, |terms, k| terms * (d + k) / k)
}

/// All monomials up to a total degree, in coordinates scaled to -1..1.
fn basis(points: &Matrix, degree: usize) -> Matrix {
    let d = points.columns();
    let mut exponents: Vec<Vec<usize>> = vec![vec![0; d]];
    let mut last = exponents.clone();
    for _ in 0..degree {
        let mut next = Vec::new();
        for term in &last {
            let from = term.iter().rposition(|&e| e > 0).unwrap_or(0);
            for k in from..d {
                let mut more = term.clone();
                more[k] += 1;
                next.push(more);
            }
        }
        exponents.extend(next.iter().cloned());
        last = next;
    }
    Matrix::from_fn(points.rows(), exponents.len(), |i, t| {
        let x = points.row(i).iter().zip(&exponents[t]);
        x.map(|(x, &e)| (2.0 * x - 1.0).powi(e as i32)).product()
    })
}

/// Distance, in residuals of the other runs, below which a response counts as explained.
const EXPLAINED: f64 = 4.0;
/// Fraction of the misfit that may remain for a parameter's best value to explain a run.
const REST: f64 = 0.2;
/// Number of steps into which a parameter's range is divided in the search for the value that fits.
const STEPS: usize = 200;

/// Explanation of a run from a fit to the other runs: one factor on its response, or another value of one parameter.
fn explain(
    points: &Matrix,
    responses: &Matrix,
    kept: &[usize],
    run: usize,
) -> (Option<f64>, Option<(usize, f64)>) {
    let (others, theirs) = (points.select_rows(kept), responses.select_rows(kept));
    let Some(fit) = Fit::best(&others, &theirs) else { return (None, None) };
    let sizes = sizes(&theirs);
    let own = responses.row(run);
    let count = kept.len() as f64;
    let scale: Vec<f64> = (0..own.len())
        .map(|j| {
            let square = fit.residuals.column(j).iter().map(|r| r * r).sum::<f64>() / count;
            square.sqrt().max(ROUNDING * sizes[j])
        })
        .collect();
    let off = |response: &[f64]| {
        let each = response.iter().zip(own).zip(&scale).filter(|(_, s)| **s > 0.0);
        let squares: Vec<f64> = each.map(|((a, b), s)| ((a - b) / s).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    };
    let here = points.select_rows(&[run]);
    let expected = fit.predict(&here);
    let expected = expected.row(0);
    // Factor between the two, by least squares in these units.
    let weighed = own.iter().zip(expected).zip(&scale).filter(|(_, s)| **s > 0.0);
    let (mut both, mut square) = (0.0, 0.0);
    for ((a, b), s) in weighed {
        both += a * b / (s * s);
        square += b * b / (s * s);
    }
    let factor = both / square;
    let multiplied: Vec<f64> = expected.iter().map(|y| factor * y).collect();
    // With one output a factor explains anything: only powers of ten or a change of sign count as typing errors.
    let round = |f: f64| [10.0, 100.0, 1000.0, -1.0].iter().any(|r| (f / r - 1.0).abs() < 0.1);
    let explains = off(&multiplied) < EXPLAINED * factor.abs().max(1.0);
    let factor = (explains && (round(factor) || round(1.0 / factor))).then_some(factor);
    let mut best: Option<(f64, (usize, f64))> = None;
    for k in 0..points.columns() {
        let moved = Matrix::from_fn(STEPS + 1, points.columns(), |i, l| {
            if l == k { i as f64 / STEPS as f64 } else { here[(0, l)] }
        });
        let predicted = fit.predict(&moved);
        for (i, response) in predicted.iter_rows().enumerate() {
            let off = off(response);
            if best.is_none_or(|(least, _)| off < least) {
                best = Some((off, (k, moved[(i, k)])));
            }
        }
    }
    let several = own.len() > 1;
    let parameter =
        best.filter(|(least, _)| several && *least < REST * off(expected)).map(|(_, at)| at);
    (factor, parameter)
}

/// Finding about a suspicious run; `value` holds a parameter's name, its value in the table, and the value that would
/// fit.
pub fn suspicious(run: &str, suspect: &Suspect, value: Option<(&str, f64, f64)>) -> Finding {
    let mut message = format!(
        "the deviation of its response from the prediction of the other runs is {} times their usual deviation: it \
         looks like a typing error",
        short(suspect.score)
    );
    if let Some(factor) = suspect.factor {
        message.push_str(&format!("; the response is {} times the predicted one", short(factor)));
    } else if let Some((name, found, fits)) = value {
        message.push_str(&format!(
            "; `{name}` is {} in the table, and {} would fit",
            short(found),
            short(fits)
        ));
    }
    let place = format!("run {run}");
    Finding::new((CODE, &place), (suspect.score, SCORE), Severity::Reservation, message, CORRECT)
}
