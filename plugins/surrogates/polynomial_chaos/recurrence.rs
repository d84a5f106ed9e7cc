//! Orthonormal polynomials by their three-term recurrence.

use lacuna_linalg::{Matrix, symmetric_eigen};
use serde::{Deserialize, Serialize};

/// The recurrence `sizes[n] psi_{n+1} = (z - centres[n]) psi_n - sizes[n-1] psi_{n-1}`, `psi_0 = 1`: the entries on
/// and next to the diagonal of the distribution's Jacobi matrix (Gautschi, *Orthogonal Polynomials*, 2004, 1.3).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Recurrence {
    /// `a_n`.
    pub centres: Vec<f64>,
    /// `sqrt(b_{n+1})`.
    pub sizes: Vec<f64>,
}

impl Recurrence {
    fn from_fns(degree: usize, a: impl Fn(f64) -> f64, b: impl Fn(f64) -> f64) -> Self {
        Self {
            centres: (0..degree).map(|n| a(n as f64)).collect(),
            sizes: (1..=degree).map(|n| b(n as f64).sqrt()).collect(),
        }
    }

    /// Legendre: the uniform distribution on (-1, 1).
    pub fn legendre(degree: usize) -> Self {
        Self::from_fns(degree, |_| 0.0, |n| n * n / (4.0 * n * n - 1.0))
    }

    /// Hermite: the standard normal distribution.
    pub fn hermite(degree: usize) -> Self {
        Self::from_fns(degree, |_| 0.0, |n| n)
    }

    /// Laguerre: the gamma distribution with this shape and scale 1.
    pub fn laguerre(degree: usize, shape: f64) -> Self {
        Self::from_fns(degree, |n| 2.0 * n + shape, |n| n * (n + shape - 1.0))
    }

    /// Jacobi: the beta distribution on (-1, 1) with the density `(1 + z)^(a - 1) (1 - z)^(b - 1)`.
    pub fn jacobi(degree: usize, a: f64, b: f64) -> Self {
        let sum = a + b - 2.0;
        let centre = |n: f64| {
            if n == 0.0 {
                return (a - b) / (a + b);
            }
            (a - b) * sum / ((2.0 * n + sum) * (2.0 * n + sum + 2.0))
        };
        let square = |n: f64| {
            if n == 1.0 {
                return 4.0 * a * b / ((a + b).powi(2) * (a + b + 1.0));
            }
            let m = 2.0 * n + sum;
            4.0 * n * (n + a - 1.0) * (n + b - 1.0) * (n + sum) / (m * m * (m + 1.0) * (m - 1.0))
        };
        Self::from_fns(degree, centre, square)
    }

    /// Stieltjes-Wigert: the log-normal distribution with median 1 (Szegő, *Orthogonal Polynomials*, 2.7).
    pub fn stieltjes_wigert(degree: usize, sigma: f64) -> Self {
        // Written with logarithms of q = exp(-sigma^2), the large powers keep their digits.
        let power = |n: f64| (-sigma * sigma * n).exp();
        let centre = |n: f64| power(-2.0 * n - 0.5) * (1.0 + power(1.0) - power(n + 1.0));
        let square = |n: f64| power(2.0 - 4.0 * n) * -(-sigma * sigma * n).exp_m1();
        Self::from_fns(degree, centre, square)
    }

    /// Returns the polynomials of a discrete distribution with these nodes and weights, by the Stieltjes procedure in
    /// the form of Lanczos: vectors `sqrt(weight) psi_n` of length one, each orthogonalised twice against all
    /// previous ones (Gautschi 2004, 2.2.3).
    pub fn stieltjes(degree: usize, nodes: &[f64], weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let mut vectors = vec![weights.iter().map(|w| (w / total).sqrt()).collect::<Vec<f64>>()];
        let mut recurrence = Self::default();
        for n in 0..degree {
            let mut next: Vec<f64> = nodes.iter().zip(&vectors[n]).map(|(z, v)| z * v).collect();
            recurrence.centres.push(dot(&next, &vectors[n]));
            for _ in 0..2 {
                for vector in vectors.iter().rev() {
                    let share = dot(&next, vector);
                    next.iter_mut().zip(vector).for_each(|(x, v)| *x -= share * v);
                }
            }
            let size = dot(&next, &next).sqrt();
            recurrence.sizes.push(size);
            for x in &mut next {
                *x /= size;
            }
            vectors.push(next);
        }
        recurrence
    }

    /// Returns the largest degree available.
    pub fn degree(&self) -> usize {
        self.sizes.len()
    }

    /// Computes the polynomials of degree `0..values.len()` at `z`.
    pub fn values(&self, z: f64, values: &mut [f64]) {
        for n in 0..values.len() {
            values[n] = match n {
                0 => 1.0,
                1 => (z - self.centres[0]) / self.sizes[0],
                _ => {
                    let ahead = (z - self.centres[n - 1]) * values[n - 1];
                    (ahead - self.sizes[n - 2] * values[n - 2]) / self.sizes[n - 1]
                }
            };
        }
    }

    /// Computes the polynomials and their derivatives with respect to `z`.
    pub fn derivatives(&self, z: f64, values: &mut [f64], derivatives: &mut [f64]) {
        self.values(z, values);
        for n in 0..derivatives.len() {
            derivatives[n] = match n {
                0 => 0.0,
                1 => 1.0 / self.sizes[0],
                _ => {
                    let ahead = values[n - 1] + (z - self.centres[n - 1]) * derivatives[n - 1];
                    (ahead - self.sizes[n - 2] * derivatives[n - 2]) / self.sizes[n - 1]
                }
            };
        }
    }

    /// Returns the nodes, in increasing order, and the weights of the Gauss rule with `count` nodes: the eigenvalues
    /// of the Jacobi matrix (Golub and Welsch 1969), improved by Newton steps, and `1 / sum_k psi_k(node)^2`. `None`
    /// if the recurrence is too short or the eigenvalues are not found.
    pub fn gauss(&self, count: usize) -> Option<Vec<(f64, f64)>> {
        if count > self.degree() {
            return None;
        }
        let jacobi = Matrix::from_fn(count, count, |i, j| match i.abs_diff(j) {
            0 => self.centres[i],
            1 => self.sizes[i.min(j)],
            _ => 0.0,
        });
        let (mut values, mut slopes) = (vec![0.0; count + 1], vec![0.0; count + 1]);
        let node = |mut z: f64| {
            for _ in 0..2 {
                self.derivatives(z, &mut values, &mut slopes);
                z -= values[count] / slopes[count];
            }
            self.values(z, &mut values);
            (z, values[..count].iter().map(|p| p * p).sum::<f64>().recip())
        };
        Some(symmetric_eigen(&jacobi).ok()?.values.into_iter().map(node).collect())
    }
}
