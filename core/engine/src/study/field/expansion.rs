//! The eigenvalues and eigenfunctions of a covariance on a grid of places.
//!
//! The integral equation `∫ c(x, y) φ(y) dy = λ φ(x)` is discretised by Nyström's method with the weights `w` of the trapezoidal
//! rule: the eigenvectors `v` of `√w_i c(x_i, x_j) √w_j` give `φ(x_i) = v_i / √w_i` (Press et al., Numerical Recipes, 3rd ed.
//! (2007), 19.1; Betz, Papaioannou and Straub, Computer Methods in Applied Mechanics and Engineering 271 (2014) 109). With all
//! terms the covariance at the places is exact, whatever the grid.

use lacuna_linalg::{Error, Matrix, symmetric_eigen};

/// Number of terms to be kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Keep {
    /// This many.
    Terms(usize),
    /// As many as this share of the variance needs.
    Variance(f64),
}

/// The leading terms of an expansion with unit variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Expansion {
    /// Eigenvalues, the largest first.
    pub values: Vec<f64>,
    /// Eigenfunctions at the places, `terms x places`, with unit integral of their squares. The leftmost high peak is positive.
    pub functions: Matrix,
    /// Share of the sum of all eigenvalues.
    pub kept: f64,
}

/// Weights of the trapezoidal rule for these places.
fn weights(at: &[f64]) -> Vec<f64> {
    let last = at.len() - 1;
    let weight = |i: usize| 0.5 * (at[(i + 1).min(last)] - at[i.saturating_sub(1)]);
    (0..at.len()).map(weight).collect()
}

impl Expansion {
    /// The expansion for at least two increasing places and a correlation as a function of the distance.
    pub fn new(at: &[f64], correlation: impl Fn(f64) -> f64, keep: Keep) -> Result<Self, Error> {
        let roots: Vec<f64> = weights(at).into_iter().map(f64::sqrt).collect();
        let count = at.len();
        let covariance = Matrix::from_fn(count, count, |i, j| {
            roots[i] * correlation((at[i] - at[j]).abs()) * roots[j]
        });
        let eigen = symmetric_eigen(&covariance)?;
        // Values that are negative by rounding are zero. The largest come first; equal ones keep their order.
        let value = |k: usize| eigen.values[k].max(0.0);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| value(b).total_cmp(&value(a)).then(a.cmp(&b)));
        let total: f64 = order.iter().map(|&k| value(k)).sum();
        let terms = match keep {
            Keep::Terms(terms) => terms.min(count),
            Keep::Variance(share) => {
                let mut sum = 0.0;
                let enough = order.iter().position(|&k| {
                    sum += value(k);
                    sum >= share * total
                });
                enough.map_or(count, |last| last + 1)
            }
        };
        order.truncate(terms);
        let values: Vec<f64> = order.iter().map(|&k| value(k)).collect();
        let mut functions =
            Matrix::from_fn(terms, count, |k, i| eigen.vectors[(i, order[k])] / roots[i]);
        for k in 0..terms {
            let row = functions.row_mut(k);
            let highest = row.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let peak = row.iter().find(|x| x.abs() >= 0.5 * highest);
            if peak.is_some_and(|peak| *peak < 0.0) {
                for x in row {
                    *x = -*x;
                }
            }
        }
        Ok(Self { kept: values.iter().sum::<f64>() / total, values, functions })
    }
}

#[cfg(test)]
mod tests;
