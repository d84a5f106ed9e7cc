//! Basis functions at the runs, and sets of them that grow one by one.

use std::borrow::Cow;

use lacuna_linalg::{Matrix, PackedUpper, multiply, vector};

use super::columns::{Columns, SlopeColumns};
use super::gram::Gram;

/// Squared fraction of a new column outside the span of the active ones below which it counts as dependent.
const DEPENDENT: f64 = 1e-8;

/// Basis functions of one set at the runs, standardised, with everything that the outputs share.
pub(super) struct Dictionary {
    /// Standardised basis functions; zero for those that are constant over the runs.
    columns: Columns,
    gram: Gram,
    means: Vec<f64>,
    /// Length of each basis function with centred values; zero for a constant.
    lengths: Vec<f64>,
}

impl Dictionary {
    /// Standardises the basis functions at the runs (`runs x terms`), with their slopes if those of the responses are
    /// known. All inner products are computed at once if `whole`, otherwise those of the selected terms.
    pub fn new(basis: &Matrix, slopes: Option<SlopeColumns>, whole: bool) -> Self {
        let (mut values, mut slopes) = (basis.transposed(), slopes);
        let runs = values.columns();
        let (mut means, mut lengths) = (Vec::new(), Vec::new());
        for t in 0..values.rows() {
            let column = values.row_mut(t);
            let size = vector::norm(column);
            let mean = column.iter().sum::<f64>() / runs as f64;
            for x in &mut *column {
                *x -= mean;
            }
            let mut length = vector::norm(column);
            let mut varies = length > 1e-10 * size;
            if let Some(slopes) = &mut slopes {
                let squares: f64 = slopes
                    .entries(t)
                    .map(|i| vector::dot(slopes.slopes.row(i), slopes.slopes.row(i)))
                    .sum();
                length = (length * length + squares).sqrt();
                varies |= squares > 0.0;
                let scale = if varies { length.recip() } else { 0.0 };
                for i in slopes.entries(t) {
                    slopes.slopes.row_mut(i).iter_mut().for_each(|x| *x *= scale);
                }
            }
            for x in column {
                *x = if varies { *x / length } else { 0.0 };
            }
            means.push(mean);
            lengths.push(if varies { length } else { 0.0 });
        }
        let columns = Columns::new(values, slopes);
        let gram = if whole { Gram::whole(&columns) } else { Gram::rows(columns.terms()) };
        Self { columns, gram, means, lengths }
    }

    /// Returns the values of the standardised basis functions (`terms x runs`).
    pub fn columns(&self) -> &Matrix {
        self.columns.values()
    }

    /// Returns the inner products of outputs, one per row, with all basis functions (`outputs x terms`).
    pub fn correlations(&self, outputs: &Matrix) -> Matrix {
        self.columns.correlations(outputs)
    }

    /// Returns the inner products of one basis function with all of them.
    pub fn products(&self, term: usize) -> &[f64] {
        self.gram.row(&self.columns, term)
    }

    /// Returns all inner products (`terms x terms`), which are computed now if they are not known.
    pub fn gram(&self) -> Cow<'_, Matrix> {
        match &self.gram {
            Gram::Whole(matrix) => Cow::Borrowed(matrix),
            Gram::Rows(_) => Cow::Owned(self.columns.gram()),
        }
    }

    /// Writes the first entries of `sum_i weights[i] * products(terms[i])` to `out`.
    pub fn combine(&self, terms: &[usize], weights: &[f64], out: &mut [f64]) {
        self.gram.combine(&self.columns, terms, weights, out);
    }

    /// Two combinations of the same rows of inner products, or of their first entries.
    pub fn combine_twice(&self, terms: &[usize], weights: [&[f64]; 2], out: [&mut [f64]; 2]) {
        self.gram.combine_twice(&self.columns, terms, weights, out);
    }

    /// Tells for each basis function if it varies over the runs.
    pub fn varies(&self) -> impl Iterator<Item = bool> {
        self.lengths.iter().map(|length| *length > 0.0)
    }

    /// Returns the maximum number of terms of a fit besides the constant, with one run to spare; with slopes half the
    /// number of rows, because the slopes of one run say less than other runs.
    pub fn most_terms(&self) -> usize {
        let (runs, rows) = (self.columns().columns(), self.columns.height());
        let most = if rows > runs { rows / 2 } else { runs.saturating_sub(2) };
        most.min(self.varies().filter(|varies| *varies).count())
    }

    /// Returns the columns with these indices that vary over the runs.
    pub fn subset(&self, members: &[usize]) -> Subset {
        let end = members.iter().max().map_or(0, |last| last + 1);
        let mut closed = vec![f64::INFINITY; end];
        let open = members.iter().filter(|&&t| self.lengths[t] > 0.0);
        open.for_each(|&t| closed[t] = 0.0);
        Subset { closed }
    }

    /// Returns the maximum number of terms of a greedy choice: half the number of runs, or of rows with slopes. Each greedy term also fits
    /// the noise that the previous ones have left, so that the leave-one-out error is misleading if there are nearly
    /// as many terms as runs.
    pub fn most_greedy_terms(&self) -> usize {
        self.most_terms().min((self.columns.height() / 2).max(1))
    }
}

/// Columns of a dictionary from which a path may choose.
pub(super) struct Subset {
    /// Zero for each of these columns and infinity for the others, up to the last of them.
    pub closed: Vec<f64>,
}

impl Subset {
    /// Returns true if a column is one of these.
    pub fn holds(&self, term: usize) -> bool {
        self.closed.get(term).is_some_and(|closed| *closed == 0.0)
    }

    /// Returns the number of columns.
    pub fn count(&self) -> usize {
        self.closed.iter().filter(|closed| **closed == 0.0).count()
    }
}

/// Selected columns of a dictionary and the inverse factor of their Gram matrix, updated as columns are added.
#[derive(Clone)]
pub(super) struct ActiveSet<'a> {
    dictionary: &'a Dictionary,
    terms: Vec<usize>,
    /// The active columns (`active x rows`).
    columns: Matrix,
    /// Orthonormal columns of the first terms, as far as they were asked for (`steps x rows`).
    orthonormal: Matrix,
    /// Inverse `R^-1` of the Cholesky factor of the active Gram matrix `G = R' R`.
    inverse: PackedUpper,
    /// `tr (Psi' Psi)^-1` after each step, for the basis functions without standardisation and the constant.
    traces: Vec<f64>,
    /// Scratch memory for the products of the entering column with the active ones and for its column of `R^-1`.
    products: Vec<f64>,
    next: Vec<f64>,
}

impl<'a> ActiveSet<'a> {
    pub fn new(dictionary: &'a Dictionary) -> Self {
        Self {
            dictionary,
            terms: Vec::new(),
            columns: Matrix::zeros(0, dictionary.columns.height()),
            orthonormal: Matrix::zeros(0, dictionary.columns.height()),
            inverse: PackedUpper::new(),
            traces: Vec::new(),
            products: Vec::new(),
            next: Vec::new(),
        }
    }

    /// Returns the active terms in the order in which they entered.
    pub fn terms(&self) -> &[usize] {
        &self.terms
    }

    /// Adds a term; returns false if it depends linearly on the active ones.
    pub fn enter(&mut self, term: usize) -> bool {
        let gram = self.dictionary.products(term);
        let Self { products, next, inverse, .. } = self;
        products.clear();
        products.extend(self.terms.iter().map(|&t| gram[t]));
        let outside = 1.0 - inverse.square_multiply(products, next);
        if outside < DEPENDENT {
            return false;
        }
        let scale = outside.sqrt().recip();
        for x in &mut *next {
            *x *= -scale;
        }
        next.push(scale);
        inverse.push(next);

        self.terms.push(term);
        self.columns.push_row(&self.dictionary.columns.column(term));
        self.traces.push(self.traces.last().copied().unwrap_or(0.0) + self.trace_of(&self.next));
        true
    }

    /// Returns the column of `R^-1` that the last term added.
    ///
    /// # Panics
    ///
    /// If there is no term.
    pub fn last_column(&self) -> &[f64] {
        self.inverse.column(self.terms.len() - 1)
    }

    /// Returns the contribution of one column of `R^-1` to `tr (Psi' Psi)^-1` of the basis functions without
    /// standardisation.
    ///
    /// With `D` the lengths and `m` the means of the centred functions, the inverse Gram matrix with the constant has
    /// the trace `1/N + |D^-1 R^-1|^2 + |m' D^-1 R^-1|^2`.
    fn trace_of(&self, column: &[f64]) -> f64 {
        let (mut squares, mut shift) = (0.0, 0.0);
        for (x, &t) in column.iter().zip(&self.terms) {
            let scaled = x / self.dictionary.lengths[t];
            squares += scaled * scaled;
            shift += scaled * self.dictionary.means[t];
        }
        squares + shift * shift
    }

    /// Returns `tr (Psi' Psi)^-1` of the first `k` active terms and the constant.
    pub fn trace(&self, k: usize) -> f64 {
        1.0 / self.dictionary.columns().columns() as f64
            + if k == 0 { 0.0 } else { self.traces[k - 1] }
    }

    /// Computes the orthonormal columns that the steps added, all those that are not known yet by one product.
    pub fn orthonormalise(&mut self) {
        let (known, k) = (self.orthonormal.rows(), self.terms.len());
        if known == k {
            return;
        }
        let mut block = Matrix::zeros(k - known, k);
        for i in known..k {
            block.row_mut(i - known)[..=i].copy_from_slice(self.inverse.column(i));
        }
        let columns = multiply(&block, &self.columns);
        columns.iter_rows().for_each(|column| self.orthonormal.push_row(column));
    }

    /// Returns the orthonormal column that step `i` added.
    ///
    /// # Panics
    ///
    /// If it has not been computed.
    pub fn orthonormal(&self, i: usize) -> &[f64] {
        self.orthonormal.row(i)
    }

    /// Removes all but the first `count` terms.
    pub fn truncate(&mut self, count: usize) {
        self.terms.truncate(count);
        self.columns.truncate_rows(count);
        self.orthonormal.truncate_rows(count);
        self.inverse.truncate(count);
        self.traces.truncate(count);
    }

    /// Returns `G^-1 x` with the Gram matrix `G` of the active columns.
    pub fn solve_gram(&self, x: &[f64]) -> Vec<f64> {
        let mut solution = Vec::new();
        self.inverse.square_multiply(&mut x.to_vec(), &mut solution);
        solution
    }

    /// Returns the least-squares weights of the active columns for an output with these products with all columns,
    /// and the sum of squares that they explain.
    pub fn solve(&self, correlations: &[f64]) -> (Vec<f64>, f64) {
        let mut own: Vec<f64> = self.terms.iter().map(|&t| correlations[t]).collect();
        let mut weights = Vec::new();
        let explained = self.inverse.square_multiply(&mut own, &mut weights);
        (weights, explained)
    }
}
