//! How good a set of terms is for an output.

use lacuna::linalg::{Cholesky, Matrix, vector};
use lacuna::math::random::{Stream, permutation};

use super::dictionary::ActiveSet;
use super::options::Selection;

/// Residuals below this share of the output are round-off: the fit is exact.
const EXACT: f64 = 1e-14;
/// The most steps whose errors are computed together.
const BLOCK: usize = 32;

/// The error by which sets of terms are compared.
pub(super) enum Criterion {
    /// Each run is left out once; the error is corrected for the number of terms.
    LeaveOneOut,
    /// Each of these groups of runs is left out once.
    Folds(Vec<Vec<usize>>),
}

impl Criterion {
    /// The criterion that the options ask for, for so many runs.
    pub fn new(selection: Selection, runs: usize, stream: &Stream) -> Self {
        match selection {
            Selection::LeaveOneOut => Self::LeaveOneOut,
            Selection::KFold(folds) => {
                let order = permutation(&mut stream.named("folds").generator(), runs);
                let fold = |f| order.iter().copied().skip(f).step_by(folds).collect();
                Self::Folds((0..folds).map(fold).collect())
            }
        }
    }
}

/// `N / (N - P) (1 + tr (Psi' Psi)^-1)`: corrects the leave-one-out error for the number of terms
/// (Chapelle, Vapnik and Bengio 2002; Blatman and Sudret 2011). Infinite when `P >= N`.
pub(super) fn correction(runs: usize, terms: usize, trace: f64) -> f64 {
    if terms >= runs {
        return f64::INFINITY;
    }
    runs as f64 / (runs - terms) as f64 * (1.0 + trace)
}

/// The terms chosen for one output, in the order in which they entered.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    /// Their positions in the dictionary, without the constant.
    pub terms: Vec<usize>,
    /// Their error relative to the output's variance.
    pub error: f64,
}

impl Choice {
    /// Keeps the better one.
    pub fn improve(best: &mut Option<Self>, other: Self) -> bool {
        let better = best.as_ref().is_none_or(|b| other.error < b.error);
        if better {
            *best = Some(other);
        }
        better
    }
}

/// A method that proposes one term after the other.
pub(super) trait Path<'a> {
    /// Lets the next term in; false when there is none.
    fn step(&mut self) -> bool;

    /// The terms so far.
    fn active(&self) -> &ActiveSet<'a>;
}

/// The best least-squares fit along a path for one output, given as its values less their mean.
///
/// The path ends `window` steps after the best step so far, after `most` steps, or when terms or residuals
/// are exhausted.
pub(super) fn best_along<'a>(
    path: &mut impl Path<'a>,
    centred: &[f64],
    criterion: &Criterion,
    most: usize,
    window: usize,
) -> Option<Choice> {
    let mut judge = Judge::new(centred, criterion);
    let mut best: Option<(f64, usize)> = None;
    'path: while path.active().terms().len() < most {
        let first = path.active().terms().len();
        // No step is taken of which it is not known that the path reaches it.
        let known = best.map_or(usize::MAX, |(_, at)| at.saturating_add(window));
        let end = most.min(first + BLOCK).min(known);
        while path.active().terms().len() < end && path.step() {}
        let active = path.active();
        if active.terms().len() == first {
            break;
        }
        let orthonormal = active.orthonormal(first);
        for (i, column) in orthonormal.iter_rows().enumerate() {
            let k = first + i + 1;
            judge.add(column);
            let error = judge.error(active.trace(k));
            if best.is_none_or(|(least, _)| error < least) {
                best = Some((error, k));
            }
            if best.is_some_and(|(_, at)| k - at >= window) || judge.exact() {
                break 'path;
            }
        }
    }
    best.map(|(error, k)| Choice { terms: path.active().terms()[..k].to_vec(), error })
}

/// The least-squares fit on a whole set of terms.
pub(super) fn judged(active: &ActiveSet<'_>, centred: &[f64], criterion: &Criterion) -> Choice {
    let mut judge = Judge::new(centred, criterion);
    active.orthonormal(0).iter_rows().for_each(|column| judge.add(column));
    let terms = active.terms().to_vec();
    Choice { error: judge.error(active.trace(terms.len())), terms }
}

/// Keeps leverages and residuals of the least-squares fit while terms are added.
struct Judge<'a> {
    residual: Vec<f64>,
    /// One less the leverage of each run.
    freedom: Vec<f64>,
    /// The runs of each fold and their part of `1 - H`, `H` the hat matrix.
    folds: Vec<(&'a [usize], Matrix)>,
    /// The sum of squares of the centred output.
    total: f64,
    /// Those of the residuals, and of these divided by `freedom`: the leave-one-out residuals.
    squares: [f64; 2],
    terms: usize,
}

impl<'a> Judge<'a> {
    fn new(centred: &[f64], criterion: &'a Criterion) -> Self {
        let n = centred.len();
        let block = |fold: &'a Vec<usize>| {
            let m = fold.len();
            let constant = 1.0 / n as f64;
            (&fold[..], Matrix::from_fn(m, m, |i, j| f64::from(u8::from(i == j)) - constant))
        };
        let folds = match criterion {
            Criterion::LeaveOneOut => Vec::new(),
            Criterion::Folds(folds) => folds.iter().map(block).collect(),
        };
        let total = vector::dot(centred, centred);
        let freedom = 1.0 - 1.0 / n as f64;
        Self {
            residual: centred.to_vec(),
            freedom: vec![freedom; n],
            folds,
            total,
            squares: [total, total / (freedom * freedom)],
            terms: 1,
        }
    }

    /// Adds one orthonormal column.
    fn add(&mut self, column: &[f64]) {
        self.terms += 1;
        // The projection of the residual, not of the output: what round-off left in the columns
        // already there is not projected twice.
        let projection = vector::dot(column, &self.residual);
        self.squares = vector::take_out(column, projection, &mut self.residual, &mut self.freedom);
        for (runs, block) in &mut self.folds {
            for (i, &a) in runs.iter().enumerate() {
                let row = block.row_mut(i);
                row.iter_mut().zip(*runs).for_each(|(x, &b)| *x -= column[a] * column[b]);
            }
        }
    }

    /// The error relative to the variance; `trace` is `tr (Psi' Psi)^-1`.
    fn error(&self, trace: f64) -> f64 {
        let error = if self.folds.is_empty() {
            self.squares[1] / self.total * correction(self.residual.len(), self.terms, trace)
        } else {
            let squares = self.folds.iter().map(|(runs, b)| left_out(runs, b, &self.residual));
            squares.sum::<f64>() / self.total
        };
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// Whether nothing is left but round-off.
    fn exact(&self) -> bool {
        self.squares[0] <= EXACT * EXACT * self.total
    }
}

/// The sum of squares of the residuals that some runs have in the fit without them: `(1 - H)^-1 r` of their
/// rows and columns of the hat matrix. Infinite when the rest does not determine the fit.
pub(super) fn left_out(runs: &[usize], block: &Matrix, residual: &[f64]) -> f64 {
    let mut own: Vec<f64> = runs.iter().map(|&i| residual[i]).collect();
    let Ok(factor) = Cholesky::new(block) else { return f64::INFINITY };
    factor.solve(&mut own);
    vector::dot(&own, &own)
}
