//! Directions of a covariance that is a sum over replicates.

use lacuna_linalg::Matrix;

/// Number of replicates from which on their directions are reduced to as many as there are outputs.
const MANY: usize = 4096;

/// Number of directions, in terms of the outputs, that are reduced together.
const TOGETHER: usize = 4;

/// Vectors whose outer products sum to a covariance.
///
/// More vectors than outputs are reduced to the rows of the triangular factor of their QR decomposition, whose outer products
/// have the same sum; vectors that were reduced are not held.
pub(super) struct Directions {
    outputs: usize,
    rows: Matrix,
    /// Number of rows at which they are reduced.
    most: usize,
    is_reduced: bool,
}

impl Directions {
    /// No vector of this number of outputs.
    pub fn of(outputs: usize) -> Self {
        Self::reduced_from(MANY.max((TOGETHER + 1) * outputs), outputs)
    }

    fn reduced_from(most: usize, outputs: usize) -> Self {
        Self { outputs, rows: Matrix::zeros(0, outputs), most, is_reduced: false }
    }

    /// Adds a vector.
    pub fn add(&mut self, direction: &[f64]) {
        self.rows.push_row(direction);
        if self.rows.rows() < self.most {
            return;
        }
        self.reduce();
        self.is_reduced = true;
        self.most = self.rows.rows() + (TOGETHER * self.outputs).max(1);
    }

    fn reduce(&mut self) {
        // Vectors that cannot be reduced are kept as they are.
        if let Ok(factor) = lacuna_linalg::triangular_factor(&self.rows) {
            self.rows = factor;
        }
    }

    /// The vectors.
    pub fn into_columns(mut self) -> impl Iterator<Item = Vec<f64>> {
        if self.is_reduced {
            self.reduce();
        }
        let rows: Vec<Vec<f64>> = self.rows.iter_rows().map(<[f64]>::to_vec).collect();
        rows.into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::{Stream, normal};

    /// Sum of the outer products.
    fn covariance(rows: &[Vec<f64>], outputs: usize) -> Matrix {
        let product = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum();
        Matrix::from_fn(outputs, outputs, product)
    }

    #[test]
    fn reduced_directions_have_the_same_covariance() {
        let outputs = 7;
        let mut rng = Stream::root(3).generator();
        let all: Vec<Vec<f64>> =
            (0..500).map(|_| (0..outputs).map(|_| normal(&mut rng)).collect()).collect();
        for (most, left) in [(1000, 500), (40, outputs), (500, outputs)] {
            let mut directions = Directions::reduced_from(most, outputs);
            for row in &all {
                directions.add(row);
            }
            let found: Vec<Vec<f64>> = directions.into_columns().collect();
            assert_eq!(found.len(), left);
            let (found, expected) = (covariance(&found, outputs), covariance(&all, outputs));
            for (a, b) in found.as_slice().iter().zip(expected.as_slice()) {
                // A sum of 500 products of the size of one; rounding of the decomposition and of the sum.
                assert!((a - b).abs() < 1e-11, "{a} and {b}");
            }
        }
    }
}
