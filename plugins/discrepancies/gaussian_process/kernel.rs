//! Matérn correlations, also as processes in time.
//!
//! A process with a Matérn correlation of half-integer index is a component of a Markov process of its value and
//! first derivatives, each in units of the `rate` (Hartikainen and Särkkä, Kalman filtering and smoothing solutions
//! to temporal Gaussian process regression models (2010)). The only eigenvalue of its drift `F` is -1, so that with
//! `N = F + I`, whose cube is zero,
//!
//! ```text
//! exp(F x) = exp(-x) (I + N x + N^2 x^2 / 2).
//! ```

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Smoothness of a bias (Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), 4.2).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// Matérn with index 3/2: once differentiable.
    #[serde(rename = "matern_3_2")]
    ThreeHalves,
    /// Matérn with index 5/2: twice differentiable.
    #[default]
    #[serde(rename = "matern_5_2")]
    FiveHalves,
}

/// Matrix of a state: value and two derivatives; the last row and column are zero if there is only one derivative.
pub(super) type Square = [[f64; 3]; 3];

impl Kernel {
    /// Returns the factor on distances.
    pub(super) fn rate(self, length: f64) -> f64 {
        match self {
            Self::ThreeHalves => 3.0_f64.sqrt() / length,
            Self::FiveHalves => 5.0_f64.sqrt() / length,
        }
    }

    /// Returns the correlation and `length` times its derivative with respect to the length at `x`, a distance times
    /// the rate, both without their factor `exp(-x)`.
    pub(super) fn factors(self, x: f64) -> (f64, f64) {
        match self {
            Self::ThreeHalves => (1.0 + x, x * x),
            Self::FiveHalves => (1.0 + x + x * x / 3.0, x * x * (1.0 + x) / 3.0),
        }
    }

    /// Returns the correlation at a distance, and its derivative with respect to the length.
    pub(super) fn at(self, distance: f64, length: f64) -> (f64, f64) {
        let x = self.rate(length) * distance;
        let (value, slope) = self.factors(x);
        let e = (-x).exp();
        (value * e, slope * e / length)
    }

    /// Returns the stationary covariance of the state of a process with unit variance.
    pub(super) fn stationary(self) -> Square {
        let third = 1.0 / 3.0;
        match self {
            Self::ThreeHalves => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]],
            Self::FiveHalves => [[1.0, 0.0, -third], [0.0, third, 0.0], [-third, 0.0, 1.0]],
        }
    }

    /// Returns `exp(F x)` and its derivative with respect to `x`.
    pub(super) fn transition(self, x: f64) -> (Square, Square) {
        let (first, second): (Square, Square) = match self {
            Self::ThreeHalves => ([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [0.0; 3]], [[0.0; 3]; 3]),
            Self::FiveHalves => (
                [[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [-1.0, -3.0, -2.0]],
                [[1.0, 2.0, 1.0], [-1.0, -2.0, -1.0], [1.0, 2.0, 1.0]],
            ),
        };
        let e = (-x).exp();
        let (mut value, mut slope) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for i in 0..3 {
            for j in 0..3 {
                let unit = f64::from(u8::from(i == j));
                let (n, nn) = (first[i][j], second[i][j]);
                value[i][j] = e * (unit + x * (n + 0.5 * x * nn));
                slope[i][j] = e * (n + x * nn) - value[i][j];
            }
        }
        (value, slope)
    }
}
