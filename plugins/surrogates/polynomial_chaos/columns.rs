//! Standardised basis functions at the runs, with their slopes if the slopes of the responses are known.
//!
//! A slope of a basis function is zero unless its parameter is one of the few that the function depends on, so that only
//! the slopes by these are stored.

use std::borrow::Cow;

use lacuna_linalg::{Matrix, gram, multiply_transposed, vector};

/// Columns of a regression, one per basis function. Their rows are the values at the runs, followed by the slopes by the
/// first parameter at the runs, those by the second, and so on.
pub(super) struct Columns {
    /// Values (`terms x runs`).
    values: Matrix,
    slopes: Option<SlopeColumns>,
}

/// Slopes of basis functions at the runs.
pub(super) struct SlopeColumns {
    /// Number of parameters.
    pub dimension: usize,
    /// Parameters on which each basis function depends, and the end of each function's entries.
    pub parameters: Vec<usize>,
    pub ends: Vec<usize>,
    /// Slopes by these parameters, in the same order (`entries x runs`).
    pub slopes: Matrix,
}

impl SlopeColumns {
    /// Returns the entries of one basis function.
    pub fn entries(&self, term: usize) -> std::ops::Range<usize> {
        let start = if term == 0 { 0 } else { self.ends[term - 1] };
        start..self.ends[term]
    }

    /// Returns the sum over the parameters that two functions share of the products of their slopes.
    fn product(&self, a: usize, b: usize) -> f64 {
        let mut sum = 0.0;
        for i in self.entries(a) {
            // The entries of a function are in the order of the parameters, and there are few.
            let twin = self.entries(b).find(|&k| self.parameters[k] == self.parameters[i]);
            sum += twin.map_or(0.0, |k| vector::dot(self.slopes.row(i), self.slopes.row(k)));
        }
        sum
    }
}

impl Columns {
    /// Combines values (`terms x runs`) and slopes.
    pub fn new(values: Matrix, slopes: Option<SlopeColumns>) -> Self {
        Self { values, slopes }
    }

    /// Returns the values (`terms x runs`).
    pub fn values(&self) -> &Matrix {
        &self.values
    }

    /// Returns the number of basis functions.
    pub fn terms(&self) -> usize {
        self.values.rows()
    }

    /// Returns the number of rows: values and slopes.
    pub fn height(&self) -> usize {
        let runs = self.values.columns();
        self.slopes.as_ref().map_or(runs, |slopes| runs * (1 + slopes.dimension))
    }

    /// Returns the whole column of one basis function.
    pub fn column(&self, term: usize) -> Cow<'_, [f64]> {
        let own = self.values.row(term);
        let Some(slopes) = &self.slopes else { return Cow::Borrowed(own) };
        let mut column = vec![0.0; self.height()];
        column[..own.len()].copy_from_slice(own);
        for i in slopes.entries(term) {
            let first = own.len() * (1 + slopes.parameters[i]);
            column[first..first + own.len()].copy_from_slice(slopes.slopes.row(i));
        }
        Cow::Owned(column)
    }

    /// Returns the inner products of one column with all columns.
    pub fn products(&self, term: usize) -> Vec<f64> {
        let own = self.values.row(term);
        let mut products: Vec<f64> =
            self.values.iter_rows().map(|column| vector::dot(own, column)).collect();
        if let Some(slopes) = &self.slopes {
            for (other, product) in products.iter_mut().enumerate() {
                *product += slopes.product(term, other);
            }
        }
        products
    }

    /// Returns all inner products of the columns (`terms x terms`).
    pub fn gram(&self) -> Matrix {
        let mut products = gram(&self.values.transposed());
        let Some(slopes) = &self.slopes else { return products };
        for parameter in 0..slopes.dimension {
            let entry = |t: usize| {
                slopes.entries(t).find(|&i| slopes.parameters[i] == parameter).map(|i| (t, i))
            };
            let (terms, entries): (Vec<usize>, Vec<usize>) =
                (0..self.terms()).filter_map(entry).unzip();
            let own = gram(&slopes.slopes.select_rows(&entries).transposed());
            for (a, row) in terms.iter().zip(own.iter_rows()) {
                for (b, product) in terms.iter().zip(row) {
                    products[(*a, *b)] += product;
                }
            }
        }
        products
    }

    /// Returns the inner products of outputs (`outputs x rows`) with all columns (`outputs x terms`).
    pub fn correlations(&self, outputs: &Matrix) -> Matrix {
        let Some(slopes) = &self.slopes else { return multiply_transposed(outputs, &self.values) };
        let runs = self.values.columns();
        let part = |first: usize| {
            Matrix::from_rows(runs, outputs.iter_rows().map(|row| &row[first..first + runs]))
        };
        let mut correlations = multiply_transposed(&part(0), &self.values);
        for (o, output) in outputs.iter_rows().enumerate() {
            for t in 0..self.terms() {
                for i in slopes.entries(t) {
                    let first = runs * (1 + slopes.parameters[i]);
                    let own = &output[first..first + runs];
                    correlations[(o, t)] += vector::dot(own, slopes.slopes.row(i));
                }
            }
        }
        correlations
    }
}
