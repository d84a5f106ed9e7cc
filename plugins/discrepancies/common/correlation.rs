//! Correlation functions of a smooth bias and of its slope.
//!
//! With `k(h)` the correlation at a difference `h = x - y`, the covariances of a process `f` of unit variance and of its
//! derivative are (Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), 9.4)
//!
//! ```text
//! cov(f(x), f(y)) = k(h),  cov(f'(x), f(y)) = k'(h),  cov(f(x), f'(y)) = -k'(h),  cov(f'(x), f'(y)) = -k''(h).
//! ```

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Smoothness of a bias (Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), 4.2).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Correlation {
    /// Matérn with index 3/2: once differentiable.
    #[serde(rename = "matern_3_2")]
    ThreeHalves,
    /// Matérn with index 5/2: twice differentiable.
    #[default]
    #[serde(rename = "matern_5_2")]
    FiveHalves,
    /// `exp(-h²/(2 l²))`: infinitely differentiable, so that data at one place determine much elsewhere.
    SquaredExponential,
}

/// A value or a slope of a bias at a place, times a sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Functional {
    /// Value of the axis.
    pub at: f64,
    /// True for the slope, false for the value.
    pub slope: bool,
    /// 1 or -1.
    pub sign: f64,
}

impl Functional {
    /// Returns the value of the bias at a place.
    pub fn value(at: f64) -> Self {
        Self { at, slope: false, sign: 1.0 }
    }
}

impl Correlation {
    /// Returns the function of `u = h / length` and its first three derivatives. The third is continuous only as
    /// `u` times it, which is all that is used.
    fn derivatives(self, u: f64) -> [f64; 4] {
        match self {
            Self::ThreeHalves => {
                let a = 3.0_f64.sqrt();
                let x = a * u.abs();
                let e = (-x).exp();
                let third = 3.0 * a * u.signum() * (2.0 - x) * e;
                [(1.0 + x) * e, -3.0 * u * e, -3.0 * (1.0 - x) * e, third]
            }
            Self::FiveHalves => {
                let x = 5.0_f64.sqrt() * u.abs();
                let e = (-x).exp();
                let third = 5.0 / 3.0;
                [
                    (1.0 + x + x * x / 3.0) * e,
                    -third * u * (1.0 + x) * e,
                    -third * (1.0 + x - x * x) * e,
                    5.0 * third * u * (3.0 - x) * e,
                ]
            }
            Self::SquaredExponential => {
                let e = (-0.5 * u * u).exp();
                [e, -u * e, (u * u - 1.0) * e, u * (3.0 - u * u) * e]
            }
        }
    }

    /// Returns the covariance of two functionals of a process of unit variance, and its derivative with respect to the
    /// length.
    pub fn covariance(self, a: &Functional, b: &Functional, length: f64) -> (f64, f64) {
        let u = (a.at - b.at) / length;
        let [k, first, second, third] = self.derivatives(u);
        let (value, by_length) = match (a.slope, b.slope) {
            (false, false) => (k, -u * first / length),
            (true, true) => {
                let square = length * length;
                (-second / square, (2.0 * second + u * third) / (square * length))
            }
            (of_first, _) => {
                let sign = if of_first { 1.0 } else { -1.0 };
                let value = first / length;
                (sign * value, -sign * (value + u * second / length) / length)
            }
        };
        let sign = a.sign * b.sign;
        (sign * value, sign * by_length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Correlation; 3] =
        [Correlation::ThreeHalves, Correlation::FiveHalves, Correlation::SquaredExponential];

    /// Covariances of slopes are the derivatives of the covariance by its places, and those by the length the
    /// derivatives by the length: central differences with steps of 1e-5 err by about 1e-9.
    #[test]
    fn slopes_have_the_derivatives_of_the_covariance() {
        let value = |at: f64| Functional { sign: -1.0, ..Functional::value(at) };
        let slope = |at: f64| Functional { slope: true, ..value(at) };
        let h = 1e-5;
        for kernel in ALL {
            for (x, y) in [(0.3, 1.1), (1.4, 0.2), (-0.7, 0.9)] {
                let at = |a: &Functional, b: &Functional| kernel.covariance(a, b, 0.8).0;
                let near = |found: f64, expected: f64| {
                    assert!((found - expected).abs() < 1e-7, "{kernel:?} {found} {expected}");
                };
                let by_x =
                    |b: &Functional| (at(&value(x + h), b) - at(&value(x - h), b)) / (2.0 * h);
                near(at(&slope(x), &value(y)), by_x(&value(y)));
                near(at(&slope(x), &slope(y)), by_x(&slope(y)));
                near(at(&value(x), &slope(y)), at(&slope(y), &value(x)));
                for (a, b) in [
                    (value(x), value(y)),
                    (slope(x), value(y)),
                    (value(x), slope(y)),
                    (slope(x), slope(y)),
                    (slope(x), slope(x)),
                ] {
                    let of = |length: f64| kernel.covariance(&a, &b, length).0;
                    let difference = (of(0.8 + h) - of(0.8 - h)) / (2.0 * h);
                    near(kernel.covariance(&a, &b, 0.8).1, difference);
                }
            }
        }
    }
}
