//! Inner products of the standardised basis functions: all of them at once, or row by row as terms are selected.
//!
//! A sparse solver needs the rows of the terms that it selects, which are at most as many as there are runs. With few
//! runs or many parameters most candidates are never selected, and the complete Gram matrix would take most of the
//! memory and of the time. With many outputs nearly every row is needed in the end, and one matrix product is faster.

use std::sync::OnceLock;

use lacuna_linalg::{Matrix, vector};

use super::columns::Columns;

/// Number of terms up to which the complete matrix is computed at once: it costs next to nothing.
const FEW: usize = 256;
/// Number of terms above which the complete matrix is never computed: it would take more than 128 MiB.
const MANY: usize = 4096;

/// Inner products of the columns of a dictionary with each other (`terms x terms`).
pub(super) enum Gram {
    /// All products.
    Whole(Matrix),
    /// Rows that are computed when they are first needed.
    Rows(Vec<OnceLock<Vec<f64>>>),
}

impl Gram {
    /// Returns true if fits of `outputs` outputs to `runs` runs are likely to need most rows of `terms` terms.
    pub fn needs_all(terms: usize, runs: usize, outputs: usize) -> bool {
        let most = terms <= 2 * runs || outputs.saturating_mul(runs) >= 2 * terms;
        terms <= FEW || (most && terms <= MANY)
    }

    /// Computes all products of the columns.
    pub fn whole(columns: &Columns) -> Self {
        Self::Whole(columns.gram())
    }

    /// Prepares rows for this number of terms.
    pub fn rows(terms: usize) -> Self {
        Self::Rows((0..terms).map(|_| OnceLock::new()).collect())
    }

    /// Returns the products of one column with all columns.
    pub fn row<'a>(&'a self, columns: &Columns, term: usize) -> &'a [f64] {
        match self {
            Self::Whole(matrix) => matrix.row(term),
            // A row is a function of the columns alone, whichever thread computes it.
            Self::Rows(rows) => rows[term].get_or_init(|| columns.products(term)),
        }
    }

    /// Writes the first entries of `sum_i weights[i] * row(terms[i])` to `out`.
    pub fn combine(&self, columns: &Columns, terms: &[usize], weights: &[f64], out: &mut [f64]) {
        match self {
            Self::Whole(matrix) => vector::combine_rows(matrix, terms, weights, out),
            Self::Rows(_) => {
                out.fill(0.0);
                for (&term, &weight) in terms.iter().zip(weights) {
                    let row = &self.row(columns, term)[..out.len()];
                    vector::add_scaled(out, weight, row);
                }
            }
        }
    }

    /// Two combinations of the same rows.
    pub fn combine_twice(
        &self,
        columns: &Columns,
        terms: &[usize],
        weights: [&[f64]; 2],
        out: [&mut [f64]; 2],
    ) {
        match self {
            Self::Whole(matrix) => vector::combine_rows_twice(matrix, terms, weights, out),
            Self::Rows(_) => {
                for (weights, out) in weights.into_iter().zip(out) {
                    self.combine(columns, terms, weights, out);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::{Stream, normal};

    #[test]
    fn rows_on_demand_are_those_of_the_whole_matrix() {
        let mut rng = Stream::root(4).generator();
        let values = Matrix::from_fn(30, 17, |_, _| normal(&mut rng));
        let columns = Columns::new(values, None);
        let (whole, rows) = (Gram::whole(&columns), Gram::rows(30));
        let terms = [3, 28, 0, 11, 7];
        let weights = [0.5, -2.0, 1.0, 3.0, -0.25];
        for term in terms {
            for (a, b) in whole.row(&columns, term).iter().zip(rows.row(&columns, term)) {
                assert!((a - b).abs() < 1e-12, "{a} {b}");
            }
        }
        let both = [&whole, &rows].map(|gram| {
            let mut out = vec![vec![0.0; 30]; 3];
            let [one, first, second] = &mut out[..] else { return out };
            gram.combine(&columns, &terms, &weights, one);
            gram.combine_twice(&columns, &terms, [&[1.0; 5], &weights], [first, second]);
            out
        });
        for (a, b) in both[0].iter().flatten().zip(both[1].iter().flatten()) {
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
        assert_eq!(both[1][0], both[1][2]);
    }

    #[test]
    fn the_whole_matrix_is_for_many_outputs_or_few_terms() {
        assert!(Gram::needs_all(200, 20, 1));
        assert!(!Gram::needs_all(3003, 20, 1));
        assert!(!Gram::needs_all(5151, 300, 1));
        assert!(Gram::needs_all(1771, 480, 1000));
        assert!(!Gram::needs_all(20_000, 480, 1000));
    }
}
