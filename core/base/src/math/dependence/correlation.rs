//! Correlation matrices.

use serde::{Serialize, Serializer};

/// A positive definite correlation matrix with what densities and draws need of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// The matrix, by rows.
    rows: Vec<Vec<f64>>,
    /// Lower triangular Cholesky factor, by rows.
    factor: Vec<Vec<f64>>,
}

impl Correlation {
    /// The matrix of these rows, which is symmetric with ones on the diagonal; `None` if it is not positive definite.
    pub fn new(rows: Vec<Vec<f64>>) -> Option<Self> {
        let mut factor: Vec<Vec<f64>> = Vec::new();
        for (i, row) in rows.iter().enumerate() {
            let mut own: Vec<f64> = Vec::new();
            for j in 0..i {
                let product: f64 = own.iter().zip(&factor[j]).map(|(a, b)| a * b).sum();
                own.push((row[j] - product) / factor[j][j]);
            }
            let rest = row[i] - own.iter().map(|a| a * a).sum::<f64>();
            // A smaller rest is rounding of a singular matrix.
            if rest.is_nan() || rest < 1e-12 {
                return None;
            }
            own.push(rest.sqrt());
            factor.push(own);
        }
        Some(Self { rows, factor })
    }

    /// The matrix of two numbers with this correlation, which lies between -1 and 1.
    pub fn of_two(correlation: f64) -> Option<Self> {
        Self::new(vec![vec![1.0, correlation], vec![correlation, 1.0]])
    }

    /// The matrix, by rows.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.rows
    }

    /// Logarithm of the determinant.
    pub fn log_determinant(&self) -> f64 {
        2.0 * self.factor.iter().enumerate().map(|(i, row)| row[i].ln()).sum::<f64>()
    }

    /// The inverse matrix times a vector.
    pub fn solve(&self, vector: &[f64]) -> Vec<f64> {
        let n = vector.len();
        let mut x = self.whiten(vector);
        for i in (0..n).rev() {
            let above: f64 = (i + 1..n).map(|k| self.factor[k][i] * x[k]).sum();
            x[i] = (x[i] - above) / self.factor[i][i];
        }
        x
    }

    /// The inverse of the factor times a vector: independent numbers of variance one from correlated ones.
    pub fn whiten(&self, vector: &[f64]) -> Vec<f64> {
        let mut x: Vec<f64> = Vec::new();
        for (row, value) in self.factor.iter().zip(vector) {
            let before: f64 = row.iter().zip(&x).map(|(a, b)| a * b).sum();
            x.push((value - before) / row[x.len()]);
        }
        x
    }

    /// The factor times a vector: correlated numbers from independent ones.
    pub fn colour(&self, white: &[f64]) -> Vec<f64> {
        self.factor.iter().map(|row| row.iter().zip(white).map(|(a, b)| a * b).sum()).collect()
    }
}

impl Serialize for Correlation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.rows.serialize(serializer)
    }
}
