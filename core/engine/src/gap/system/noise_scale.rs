//! The uncertainty of the size of the noise.
//!
//! The variance of the noise is estimated from differences between replicates, with as many degrees of freedom as there
//! are independent differences. With a common factor of that variance integrated out over its posterior, a scaled inverse
//! chi squared distribution, the normal density of a whitened residual becomes a multivariate t density (Zellner, An
//! Introduction to Bayesian Inference in Econometrics, 1971, sections 8.1 and B.2). From few replicates, odds are then
//! smaller than if the estimate were the truth.

use crate::gap::experiment::Experiment;
use crate::gap::noise::{Noise, Origin};

/// The degrees of freedom of the variance of the noise, and the number of measured values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseScale {
    /// The degrees of freedom; infinite if the variance is known.
    pub freedom: f64,
    /// The number of values of the mean.
    pub count: f64,
}

impl NoiseScale {
    /// The scale of the noise of an experiment. It is taken as known if a part of the noise is not from replicates: what
    /// the study states has no degrees of freedom, and the noise of a record is estimated again with each system.
    pub fn of(experiment: &Experiment<'_>, noise: &Noise) -> Self {
        let (counts, _) = experiment.means();
        let of_replicates = noise.origins.iter().all(|own| *own == Origin::Replicates);
        let measured = experiment.curves.iter().flat_map(|curve| &curve.measured);
        let (mut freedom, mut count) = (0.0, 0.0);
        for &i in measured {
            freedom += (counts[i] - 1.0).max(0.0);
            count += 1.0;
        }
        let is_estimated = of_replicates && freedom > 0.0;
        Self { freedom: if is_estimated { freedom } else { f64::INFINITY }, count }
    }

    /// The log density of a whitened residual with this sum of squares, up to a constant.
    pub fn log_density(&self, square: f64) -> f64 {
        if self.freedom.is_infinite() {
            return -0.5 * square;
        }
        -0.5 * (self.freedom + self.count) * (square / self.freedom).ln_1p()
    }

    /// Minus twice the derivative of the log density by the sum of squares: the precision that the residual and the
    /// differences leave to the noise, relative to that of its estimate.
    pub fn precision(&self, square: f64) -> f64 {
        if self.freedom.is_infinite() {
            return 1.0;
        }
        (self.freedom + self.count) / (self.freedom + square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The normal density of `count` values averaged over the posterior of the factor `s` of the variance given the
    /// differences: `p(s) ~ s^(-freedom / 2 - 1) exp(-freedom / (2 s))`, by the trapezoidal rule over `ln s`.
    #[test]
    fn the_density_is_the_average_over_the_size_of_the_noise() {
        let scale = NoiseScale { freedom: 12.0, count: 8.0 };
        let averaged = |square: f64| {
            let each = (-4000..12000).map(|k| {
                let log = f64::from(k) / 1000.0;
                let s = log.exp();
                let law = -0.5 * scale.freedom * (log + 1.0 / s);
                (law - 0.5 * (scale.count * log + square / s)).exp()
            });
            each.sum::<f64>().ln()
        };
        for square in [0.0, 4.0, 8.0, 60.0, 500.0] {
            let exact = averaged(square) - averaged(8.0);
            let found = scale.log_density(square) - scale.log_density(8.0);
            assert!((found - exact).abs() < 1e-6, "{square}: {found} {exact}");
            let slope = (scale.log_density(square + 1e-4) - scale.log_density(square)) / 1e-4;
            assert!((scale.precision(square) + 2.0 * slope).abs() < 1e-4);
        }
    }

    /// With many differences the density is that of known noise.
    #[test]
    fn many_differences_are_knowledge() {
        let [many, known] = [1e9, f64::INFINITY].map(|freedom| NoiseScale { freedom, count: 50.0 });
        for square in [10.0, 50.0, 300.0] {
            assert!((many.log_density(square) - known.log_density(square)).abs() < 1e-4);
            assert!((many.precision(square) - 1.0).abs() < 1e-6);
        }
    }
}
