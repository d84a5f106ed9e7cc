//! Least-angle regression with the leave-one-out error of the least-squares fit at every step.
//!
//! The path is that of Efron, Hastie, Johnstone and Tibshirani (2004) on columns of mean zero and
//! length one; no term ever leaves it. At each step the terms so far are refitted by least squares
//! and judged by their corrected leave-one-out error ("hybrid" selection: Blatman and Sudret 2011),
//! which is exactly the error of the final model.
//!
//! What makes it fast: the Gram matrix is shared by all outputs, so that the path never touches the
//! runs; only candidates that can arrive are followed ([`super::candidates`]); the inverse Cholesky
//! factor of the active Gram matrix grows by one column a step; and the orthonormal columns that
//! leverages and residuals need are made for a block of steps at a time by one matrix product.

use lacuna::linalg::{Matrix, PackedUpper, gram, multiply, vector};

use super::candidates::{Arrival, Candidates, Direction};
use super::least_squares::correction;

/// A new column whose share outside the span of the active ones is below this is dependent on them.
const DEPENDENT: f64 = 1e-8;
/// Residuals below this share of the output are round-off: the fit is exact.
const EXACT: f64 = 1e-14;
/// Steps whose leave-one-out errors are computed together.
const BLOCK: usize = 16;

/// The basis functions of one degree at the runs, standardised, with all that outputs share.
pub(super) struct Dictionary {
    /// Standardised basis functions, `terms x runs`; zero for those that are constant over the runs.
    columns: Matrix,
    gram: Matrix,
    means: Vec<f64>,
    /// The length of each centred basis function; zero marks a constant.
    lengths: Vec<f64>,
}

impl Dictionary {
    /// From the basis functions at the runs, `runs x terms`.
    pub fn new(basis: &Matrix) -> Self {
        let mut columns = basis.transposed();
        let runs = columns.columns();
        let (mut means, mut lengths) = (Vec::new(), Vec::new());
        for t in 0..columns.rows() {
            let column = columns.row_mut(t);
            let size = vector::norm(column);
            let mean = column.iter().sum::<f64>() / runs as f64;
            for x in &mut *column {
                *x -= mean;
            }
            let length = vector::norm(column);
            let varies = length > 1e-10 * size;
            for x in column {
                *x = if varies { *x / length } else { 0.0 };
            }
            means.push(mean);
            lengths.push(if varies { length } else { 0.0 });
        }
        let gram = gram(&columns.transposed());
        Self { columns, gram, means, lengths }
    }

    /// The standardised basis functions, `terms x runs`.
    pub fn columns(&self) -> &Matrix {
        &self.columns
    }
}

/// The terms that the path chose for one output, in the order in which they entered.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    /// Their positions in the dictionary, without the constant.
    pub terms: Vec<usize>,
    /// Their corrected relative leave-one-out error.
    pub error: f64,
}

/// The best least-squares fit along the path for one output.
///
/// `centred` holds the output's values less their mean, `correlations` its products with the
/// dictionary's columns. The path ends `window` steps after the best step so far, or when terms, runs
/// or residuals are exhausted.
pub(super) fn best_along_path(
    dictionary: &Dictionary,
    centred: &[f64],
    correlations: &[f64],
    window: usize,
) -> Option<Choice> {
    let mut path = Path::new(dictionary, correlations);
    let mut judge = Judge::new(centred);
    let steps = (centred.len() - 2).min(dictionary.lengths.iter().filter(|l| **l > 0.0).count());
    let mut best: Option<(f64, usize)> = None;
    'path: while path.active.len() < steps {
        let first = path.active.len();
        while path.active.len() < steps.min(first + BLOCK) && path.step() {}
        if path.active.len() == first {
            break;
        }
        let orthonormal = path.orthonormal(first);
        for (i, column) in orthonormal.iter_rows().enumerate() {
            let k = first + i + 1;
            let error = judge.add(column, path.trace(k));
            if best.is_none_or(|(least, _)| error < least) {
                best = Some((error, k));
            }
            if best.is_some_and(|(_, at)| k - at >= window) || judge.exact() {
                break 'path;
            }
        }
    }
    best.map(|(error, k)| Choice { terms: path.active[..k].to_vec(), error })
}

/// The state of the path: which terms are active and where it goes.
struct Path<'a> {
    dictionary: &'a Dictionary,
    candidates: Candidates<'a>,
    /// The common size of the active correlations.
    level: f64,
    active: Vec<usize>,
    signs: Vec<f64>,
    /// The direction as a combination of the active columns: `G^-1 signs`.
    weights: Vec<f64>,
    /// The active columns, `active x runs`.
    columns: Matrix,
    /// The inverse `R^-1` of the Cholesky factor of the active Gram matrix `G = R' R`.
    inverse: PackedUpper,
    /// `tr (Psi' Psi)^-1` after each step, for the basis functions as they are and the constant.
    traces: Vec<f64>,
}

impl<'a> Path<'a> {
    fn new(dictionary: &'a Dictionary, correlations: &[f64]) -> Self {
        let open = dictionary.lengths.iter().map(|length| *length > 0.0);
        let runs = dictionary.columns.columns();
        Self {
            dictionary,
            candidates: Candidates::new(&dictionary.gram, correlations, open),
            level: 0.0,
            active: Vec::new(),
            signs: Vec::new(),
            weights: Vec::new(),
            columns: Matrix::zeros(0, runs),
            inverse: PackedUpper::new(),
            traces: Vec::new(),
        }
    }

    /// Moves to where the next candidate enters and lets it in; false when there is none.
    fn step(&mut self) -> bool {
        loop {
            let Some(arrival) = self.advance() else { return false };
            self.candidates.close(arrival.term);
            if let Some(turn) = self.enter(arrival.term, arrival.correlation.signum()) {
                self.candidates.turn(arrival.term, &self.weights, turn);
                return true;
            }
        }
    }

    /// Moves along the current direction until a candidate is as correlated as the active ones.
    fn advance(&mut self) -> Option<Arrival> {
        if self.active.is_empty() {
            let strongest = self.candidates.strongest()?;
            self.level = strongest.correlation.abs();
            return Some(strongest);
        }
        let arrival = self.candidates.advance(&Direction {
            active: &self.active,
            weights: &self.weights,
            level: self.level,
        })?;
        self.level -= arrival.distance;
        Some(arrival)
    }

    /// Adds a term to the active set and says by what length the direction turns; none when the term
    /// depends linearly on those there.
    fn enter(&mut self, term: usize, sign: f64) -> Option<f64> {
        let gram = self.dictionary.gram.row(term);
        let products: Vec<f64> = self.active.iter().map(|&t| gram[t]).collect();
        let projections = self.inverse.transposed_multiply(&products);
        let outside = 1.0 - vector::dot(&projections, &projections);
        if outside < DEPENDENT {
            return None;
        }
        let scale = outside.sqrt().recip();
        let mut next = self.inverse.multiply(&projections);
        for x in &mut next {
            *x *= -scale;
        }
        next.push(scale);

        self.active.push(term);
        self.signs.push(sign);
        self.columns.push_row(self.dictionary.columns.row(term));
        self.weights.push(0.0);
        // G^-1 s = R^-1 (R^-T s): the new column of R^-1 adds one entry of R^-T s and nothing else.
        let entry = vector::dot(&next, &self.signs);
        vector::add_scaled(&mut self.weights, entry, &next);
        self.traces.push(self.traces.last().copied().unwrap_or(0.0) + self.trace_of(&next));
        self.inverse.push(&next);
        Some(entry)
    }

    /// What one column of `R^-1` adds to `tr (Psi' Psi)^-1` of the basis functions as they are.
    ///
    /// With `D` the lengths and `m` the means of the centred functions, the inverse Gram matrix with
    /// the constant has the trace `1/N + |D^-1 R^-1|^2 + |m' D^-1 R^-1|^2`.
    fn trace_of(&self, column: &[f64]) -> f64 {
        let (mut squares, mut shift) = (0.0, 0.0);
        for (x, &t) in column.iter().zip(&self.active) {
            let scaled = x / self.dictionary.lengths[t];
            squares += scaled * scaled;
            shift += scaled * self.dictionary.means[t];
        }
        squares + shift * shift
    }

    /// `tr (Psi' Psi)^-1` of the first `k` active terms and the constant.
    fn trace(&self, k: usize) -> f64 {
        1.0 / self.columns.columns() as f64 + self.traces[k - 1]
    }

    /// The orthonormal columns that the steps from `first` on added, one a row.
    fn orthonormal(&self, first: usize) -> Matrix {
        let k = self.active.len();
        let mut block = Matrix::zeros(k - first, k);
        for i in first..k {
            block.row_mut(i - first)[..=i].copy_from_slice(self.inverse.column(i));
        }
        multiply(&block, &self.columns)
    }
}

/// Keeps leverages and residuals of the least-squares fit while terms are added.
struct Judge {
    residual: Vec<f64>,
    /// One less the leverage of each run.
    freedom: Vec<f64>,
    /// The sum of squares of the centred output.
    total: f64,
    terms: usize,
}

impl Judge {
    fn new(centred: &[f64]) -> Self {
        let n = centred.len();
        Self {
            residual: centred.to_vec(),
            freedom: vec![1.0 - 1.0 / n as f64; n],
            total: vector::dot(centred, centred),
            terms: 1,
        }
    }

    /// Adds one orthonormal column; the corrected leave-one-out error relative to the variance.
    fn add(&mut self, column: &[f64], trace: f64) -> f64 {
        self.terms += 1;
        // The projection of the residual, not of the output: what round-off left in the columns
        // already there is not projected twice.
        let projection = vector::dot(column, &self.residual);
        vector::add_scaled(&mut self.residual, -projection, column);
        for (d, q) in self.freedom.iter_mut().zip(column) {
            *d -= q * q;
        }
        let squares = vector::sum_squared_ratios(&self.residual, &self.freedom);
        let error = squares / self.total * correction(column.len(), self.terms, trace);
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// Whether nothing is left but round-off.
    fn exact(&self) -> bool {
        vector::dot(&self.residual, &self.residual) <= EXACT * EXACT * self.total
    }
}
