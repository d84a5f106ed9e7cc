//! Errors of the response that follow from the spread of parameters, to first order.

use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Fact;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::add_scaled;

use super::Dependence;
use crate::discrepancies::common::{Bias, PerGroup};

/// One parameter with a spread.
pub(super) struct Direction {
    /// Derivative of each output by the parameter.
    pub slope: Vec<f64>,
    pub spread: PerGroup,
}

/// Errors from the spread of all parameters.
pub(super) struct EmbeddedBias {
    pub directions: Vec<Direction>,
    /// Flat indices of the measured outputs.
    pub measured: Vec<usize>,
    pub form: Dependence,
}

impl Direction {
    fn size(&self, hyper: &[f64]) -> Option<f64> {
        self.spread.values(hyper)?.first().copied()
    }
}

impl EmbeddedBias {
    /// Returns true if two measured outputs have a covariance.
    fn couples(&self, i: usize, j: usize) -> bool {
        i == j || self.form == Dependence::Joint
    }

    fn outputs(&self) -> usize {
        self.directions.first().map_or(0, |direction| direction.slope.len())
    }
}

impl Bias for EmbeddedBias {
    fn covariance(&self, hyper: &[f64]) -> Option<Matrix> {
        let n = self.measured.len();
        let mut all = Matrix::zeros(n, n);
        for direction in &self.directions {
            let square = direction.size(hyper)?.powi(2);
            let at = |k: usize| direction.slope[self.measured[k]];
            for i in 0..n {
                for j in (0..n).filter(|&j| self.couples(i, j)) {
                    all[(i, j)] += square * at(i) * at(j);
                }
            }
        }
        Some(all)
    }

    fn add_gradient(&self, hyper: &[f64], by_covariance: &Matrix, by_hyper: &mut [f64]) {
        let n = self.measured.len();
        for direction in &self.directions {
            let Some(size) = direction.size(hyper) else { return };
            let at = |k: usize| direction.slope[self.measured[k]];
            let mut sum = 0.0;
            for i in 0..n {
                for j in (0..n).filter(|&j| self.couples(i, j)) {
                    sum += by_covariance[(i, j)] * at(i) * at(j);
                }
            }
            direction.spread.add_gradient(&[2.0 * size * sum], by_hyper);
        }
    }

    fn variance(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let mut variance = vec![0.0; self.outputs()];
        for direction in &self.directions {
            let square = direction.size(hyper)?.powi(2);
            variance.iter_mut().zip(&direction.slope).for_each(|(v, s)| *v += square * s * s);
        }
        Some(variance)
    }

    /// Errors of the data that are independent have no value that a new replicate shares.
    fn everywhere(&self, hyper: &[f64]) -> Option<Matrix> {
        if self.form == Dependence::Independent {
            return None;
        }
        let outputs = self.outputs();
        let mut all = Matrix::zeros(outputs, outputs);
        for direction in &self.directions {
            let square = direction.size(hyper)?.powi(2);
            for (i, a) in direction.slope.iter().enumerate() {
                add_scaled(all.row_mut(i), square * a, &direction.slope);
            }
        }
        Some(all)
    }

    /// One value of each parameter for all outputs: the error is correlated over them, other scenarios included.
    fn draw(&self, hyper: &[f64], stream: &Stream) -> Option<Vec<f64>> {
        let mut rng = stream.generator();
        let mut error = vec![0.0; self.outputs()];
        for direction in &self.directions {
            let moved = direction.size(hyper)? * normal(&mut rng);
            add_scaled(&mut error, moved, &direction.slope);
        }
        Some(error)
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("parameters with a spread", self.directions.len())]
    }
}
