//! Assessment of a set of terms for an output.

use lacuna::math::random::{Stream, permutation};
use lacuna_linalg::{Cholesky, Matrix, vector};

use super::by_run::ByRun;
use super::dictionary::ActiveSet;
use super::options::Selection;

/// Size of the residuals relative to the output below which they are rounding errors and the fit is exact.
const EXACT: f64 = 1e-14;
/// Maximum number of steps whose errors are computed together.
const BLOCK: usize = 32;

/// Error by which sets of terms are compared.
pub(super) enum Criterion {
    /// Leave-one-out error, corrected for the number of terms.
    LeaveOneOut,
    /// Cross-validation error with these groups of runs left out in turn.
    Folds(Vec<Vec<usize>>),
    /// Error of the values at runs that are left out one after the other, each with its slopes by this number of
    /// parameters, corrected for the number of terms.
    ByRun {
        /// Number of runs.
        runs: usize,
        /// Number of parameters.
        dimension: usize,
        /// Number of values and known slopes.
        known: usize,
    },
}

impl Criterion {
    /// Returns the criterion that the options request, for `runs` runs.
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

/// Returns `N / (N - P) (1 + tr (Psi' Psi)^-1)`, the correction of the leave-one-out error for the number of terms
/// (Chapelle, Vapnik and Bengio 2002; Blatman and Sudret 2011). Infinite if `P >= N`.
pub(super) fn correction(runs: usize, terms: usize, trace: f64) -> f64 {
    if terms >= runs {
        return f64::INFINITY;
    }
    runs as f64 / (runs - terms) as f64 * (1.0 + trace)
}

/// Terms chosen for one output, in the order in which they entered.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    /// Indices in the dictionary, without the constant.
    pub terms: Vec<usize>,
    /// Error relative to the output's variance.
    pub error: f64,
}

impl Choice {
    /// Keeps the better of two choices; returns true if it is `other`.
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
    /// Adds the next term; returns false if there is none.
    fn step(&mut self) -> bool;

    /// Returns the terms so far, which may be some already before the first step.
    fn active(&mut self) -> &mut ActiveSet<'a>;
}

/// Returns the best least-squares fit along a path for one output, given as its values minus their mean.
///
/// The path ends `window` steps after the best step so far, after `most` steps, or when terms or residuals are
/// exhausted.
pub(super) fn best_along<'a>(
    path: &mut impl Path<'a>,
    centred: &[f64],
    criterion: &Criterion,
    most: usize,
    window: usize,
) -> Option<Choice> {
    let mut judge = Judge::new(centred, criterion);
    let mut best: Option<(f64, usize)> = None;
    let mut first = 0;
    'path: while first < most {
        // A block ends no later than the path is known to continue, so that no step is wasted.
        let known = best.map_or(usize::MAX, |(_, at)| at.saturating_add(window));
        let end = most.min(first + BLOCK).min(known);
        while path.active().terms().len() < end && path.step() {}
        let active = path.active();
        let last = end.min(active.terms().len());
        if last <= first {
            break;
        }
        active.orthonormalise();
        for k in first + 1..=last {
            judge.add(active.orthonormal(k - 1));
            let error = judge.error(active.trace(k));
            if best.is_none_or(|(least, _)| error < least) {
                best = Some((error, k));
            }
            if best.is_some_and(|(_, at)| k - at >= window) || judge.exact() {
                break 'path;
            }
        }
        first = last;
    }
    best.map(|(error, k)| Choice { terms: path.active().terms()[..k].to_vec(), error })
}

/// Assesses the least-squares fit on a whole set of terms.
pub(super) fn judged(mut active: ActiveSet<'_>, centred: &[f64], criterion: &Criterion) -> Choice {
    let mut judge = Judge::new(centred, criterion);
    active.orthonormalise();
    (0..active.terms().len()).for_each(|i| judge.add(active.orthonormal(i)));
    let terms = active.terms().to_vec();
    Choice { error: judge.error(active.trace(terms.len())), terms }
}

/// Leverages and residuals of the least-squares fit, updated as terms are added.
struct Judge<'a> {
    residual: Vec<f64>,
    /// One minus the leverage of each run.
    freedom: Vec<f64>,
    /// Runs of each fold and their block of `1 - H`, with `H` the hat matrix.
    folds: Vec<(&'a [usize], Matrix)>,
    /// Sum of squares of the centred output.
    total: f64,
    /// Sums of squares of the residuals, and of the leave-one-out residuals (the residuals divided by `freedom`).
    squares: [f64; 2],
    terms: usize,
    /// Leave-one-run-out errors, if there are slopes, and the sum of squares of the centred values.
    by_run: Option<(ByRun, f64)>,
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
            Criterion::LeaveOneOut | Criterion::ByRun { .. } => Vec::new(),
            Criterion::Folds(folds) => folds.iter().map(block).collect(),
        };
        let by_run = match *criterion {
            Criterion::ByRun { runs, dimension, known } => {
                let values = &centred[..runs];
                Some((ByRun::new(runs, dimension, known), vector::dot(values, values)))
            }
            _ => None,
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
            by_run,
        }
    }

    /// Adds one orthonormal column.
    fn add(&mut self, column: &[f64]) {
        self.terms += 1;
        // The residual is projected and not the output: rounding errors of earlier columns are then not projected
        // twice.
        let projection = vector::dot(column, &self.residual);
        self.squares = vector::take_out(column, projection, &mut self.residual, &mut self.freedom);
        for (runs, block) in &mut self.folds {
            for (i, &a) in runs.iter().enumerate() {
                let row = block.row_mut(i);
                row.iter_mut().zip(*runs).for_each(|(x, &b)| *x -= column[a] * column[b]);
            }
        }
        if let Some((by_run, _)) = &mut self.by_run {
            by_run.add(column);
        }
    }

    /// Returns the error relative to the variance; `trace` is `tr (Psi' Psi)^-1`. Infinite for a set that is passed over.
    fn error(&mut self, trace: f64) -> f64 {
        let exact = self.exact();
        let error = if let Some((by_run, total)) = &mut self.by_run {
            let squares = by_run.squares(&self.residual, self.terms, trace, exact);
            squares.map_or(f64::INFINITY, |squares| squares / *total)
        } else if self.folds.is_empty() {
            self.squares[1] / self.total * correction(self.residual.len(), self.terms, trace)
        } else {
            let squares = self.folds.iter().map(|(runs, b)| left_out(runs, b, &self.residual));
            squares.sum::<f64>() / self.total
        };
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// Returns true if only rounding errors are left.
    fn exact(&self) -> bool {
        self.squares[0] <= EXACT * EXACT * self.total
    }
}

/// Returns the sum of squared residuals of some runs for the fit without them: `(1 - H)^-1 r` with their rows and
/// columns of the hat matrix. Infinite if the other runs do not determine the fit.
pub(super) fn left_out(runs: &[usize], block: &Matrix, residual: &[f64]) -> f64 {
    let mut own: Vec<f64> = runs.iter().map(|&i| residual[i]).collect();
    let Ok(factor) = Cholesky::new(block) else { return f64::INFINITY };
    factor.solve(&mut own);
    vector::dot(&own, &own)
}
