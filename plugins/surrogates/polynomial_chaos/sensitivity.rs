//! Moments and Sobol' indices from the coefficients (Sudret 2008).

use lacuna::plugin::surrogate::{Indices, Sensitivity};
use lacuna_linalg::Matrix;

use super::terms::Terms;

/// Returns moments and Sobol' indices of an expansion with these coefficients (`terms x outputs`).
///
/// Since the basis is orthonormal, the variance is the sum of the squared coefficients of all terms except the
/// constant, and each partial variance is the sum over the terms in which exactly these parameters appear.
pub(super) fn sensitivity(terms: &Terms, coefficients: &Matrix, dimension: usize) -> Sensitivity {
    let pairs: Vec<[usize; 2]> =
        (0..dimension).flat_map(|i| (i + 1..dimension).map(move |j| [i, j])).collect();
    let outputs = coefficients.columns();
    let mut mean = vec![0.0; outputs];
    let mut variance = Matrix::zeros(outputs, 1);
    let mut sums = Indices {
        first: Matrix::zeros(outputs, dimension),
        total: Matrix::zeros(outputs, dimension),
        pairs: Matrix::zeros(outputs, pairs.len()),
    };
    for (t, row) in coefficients.iter_rows().enumerate() {
        let active: Vec<usize> = (0..dimension).filter(|&i| terms.term(t)[i] > 0).collect();
        if active.is_empty() {
            mean.copy_from_slice(row);
            continue;
        }
        add_squares(&mut variance, 0, row);
        for &i in &active {
            add_squares(&mut sums.total, i, row);
        }
        match active[..] {
            [i] => add_squares(&mut sums.first, i, row),
            [i, j] => {
                if let Some(pair) = pairs.iter().position(|p| *p == [i, j]) {
                    add_squares(&mut sums.pairs, pair, row);
                }
            }
            _ => {}
        }
    }
    let variance = variance.into_vec();
    let aggregated = sums.map(|m| shares(&column_sums(m), &[variance.iter().sum()]));
    let outputs = sums.map(|m| shares(m, &variance));
    Sensitivity { mean, variance, pairs, outputs, aggregated }
}

/// Like [`sensitivity`], with the coefficients of some outputs at a time.
pub(super) fn of_blocks(
    terms: &Terms,
    blocks: impl Iterator<Item = Matrix>,
    dimension: usize,
) -> Sensitivity {
    let mut all: Option<Sensitivity> = None;
    for coefficients in blocks {
        let block = sensitivity(terms, &coefficients, dimension);
        match &mut all {
            Some(all) => append(all, block),
            None => all = Some(block),
        }
    }
    let mut all = all.unwrap_or_default();
    let Sensitivity { outputs, variance, .. } = &all;
    // The sum over the outputs of variances that belong to some terms.
    let sum = |m: &Matrix| {
        let one = |j: usize| (0..m.rows()).map(|i| m[(i, j)] * variance[i]).sum::<f64>();
        let sums = Matrix::from_fn(1, m.columns(), |_, j| one(j));
        shares(&sums, &[variance.iter().sum()])
    };
    all.aggregated = outputs.map(sum);
    all
}

/// Appends the outputs of another block.
fn append(all: &mut Sensitivity, block: Sensitivity) {
    all.mean.extend(block.mean);
    all.variance.extend(block.variance);
    let pairs = [
        (&mut all.outputs.first, block.outputs.first),
        (&mut all.outputs.total, block.outputs.total),
        (&mut all.outputs.pairs, block.outputs.pairs),
    ];
    for (whole, part) in pairs {
        part.iter_rows().for_each(|row| whole.push_row(row));
    }
}

/// Adds the squares of one term's coefficients to a column.
fn add_squares(sums: &mut Matrix, column: usize, coefficients: &[f64]) {
    for (o, c) in coefficients.iter().enumerate() {
        sums[(o, column)] += c * c;
    }
}

fn column_sums(m: &Matrix) -> Matrix {
    Matrix::from_fn(1, m.columns(), |_, j| (0..m.rows()).map(|i| m[(i, j)]).sum())
}

fn shares(sums: &Matrix, variance: &[f64]) -> Matrix {
    Matrix::from_fn(sums.rows(), sums.columns(), |i, j| {
        if variance[i] > 0.0 { sums[(i, j)] / variance[i] } else { 0.0 }
    })
}

trait Map {
    fn map(&self, f: impl Fn(&Matrix) -> Matrix) -> Self;
}

impl Map for Indices {
    fn map(&self, f: impl Fn(&Matrix) -> Matrix) -> Self {
        Self { first: f(&self.first), total: f(&self.total), pairs: f(&self.pairs) }
    }
}
