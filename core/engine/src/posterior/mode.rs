//! The density whose maximum is the mode in natural units.

use std::sync::Arc;

use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna_linalg::Matrix;

use super::pace::Pace;
use super::{LogLikelihood, Posterior};

/// A posterior without the Jacobian of its logarithmic coordinates; see [`Posterior::mode`]. It has tangents, the posterior
/// none: samplers in libraries, which see values and gradients only, have to give the same bits.
pub struct Mode<'a>(pub(super) Posterior<'a>);

impl<'a> Posterior<'a> {
    /// This density over the same coordinates without the Jacobian of the logarithms: its maximum is the mode of the
    /// density in natural units. With populations the maximum is that of locations and logarithms of scales with the members
    /// integrated out, and of the members given these: the density of the members themselves is infinite where a scale is zero.
    pub fn mode(&self) -> Mode<'_> {
        Mode(self.with_likelihood(self.likelihood.clone()))
    }

    /// The same prior, region and coordinates with another log-likelihood.
    pub(super) fn with_likelihood<'b>(
        &self,
        likelihood: Arc<dyn LogLikelihood + 'b>,
    ) -> Posterior<'b>
    where
        'a: 'b,
    {
        Posterior {
            prior: self.prior,
            likelihood,
            region: self.region.clone(),
            members: self.members.clone(),
            numbers: self.numbers,
            pace: Pace::default(),
        }
    }
}

impl Target for Mode<'_> {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.0.batch(points, false)
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let of = |p: &[f64]| {
            let natural = self.0.natural(p);
            self.0.log_prior(&natural) + self.0.log_jacobian(p, &natural, false)
        };
        points.iter_rows().map(of).collect()
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        self.0.value_and_gradient(point, false)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.0.coordinate_bounds()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.0.draws(count, stream)
    }
    fn linearised(&self, point: &[f64]) -> Option<Box<dyn Target + '_>> {
        let natural = self.0.natural(point);
        if !self.0.log_prior(&natural).is_finite() {
            return None;
        }
        let theta = &natural[..self.0.parameters().len()];
        let tangent = self.0.likelihood.linearised(theta)?;
        Some(Box::new(Mode(self.0.with_likelihood(Arc::from(tangent)))))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lacuna::data::{Parameter, Unit};
    use lacuna::math::distribution::Distribution;
    use lacuna::plugin::discrepancy::{Hyperparameter, Likelihood, VariancePart};
    use lacuna::plugin::{Forward, Target};

    use super::super::OfData;
    use super::*;

    /// `a exp(-b t)` at six times.
    struct Decay;

    impl Forward for Decay {
        fn dimension(&self) -> usize {
            2
        }
        fn outputs(&self) -> usize {
            6
        }
        fn mean(&self, points: &Matrix) -> Matrix {
            Matrix::from_fn(points.rows(), 6, |i, t| {
                points[(i, 0)] * (-points[(i, 1)] * t as f64).exp()
            })
        }
        fn jacobian(&self, point: &[f64]) -> Matrix {
            Matrix::from_fn(6, 2, |t, j| {
                let (t, decay) = (t as f64, (-point[1] * t as f64).exp());
                if j == 0 { decay } else { -point[0] * t * decay }
            })
        }
    }

    /// Data of value one with an unknown variance.
    struct Ones {
        hyper: Vec<Hyperparameter>,
        cheap: bool,
    }

    impl Likelihood for Ones {
        fn hyperparameters(&self) -> &[Hyperparameter] {
            &self.hyper
        }
        fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
            let squares: f64 = response.iter().map(|y| (1.0 - y).powi(2)).sum();
            -0.5 * squares / hyper[0] - 0.5 * response.len() as f64 * hyper[0].ln()
        }
        fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
            let squares: f64 = response.iter().map(|y| (1.0 - y).powi(2)).sum();
            let by_variance =
                0.5 * squares / hyper[0].powi(2) - 0.5 * response.len() as f64 / hyper[0];
            (response.iter().map(|y| (1.0 - y) / hyper[0]).collect(), vec![by_variance])
        }
        fn is_cheap(&self) -> bool {
            self.cheap
        }
        fn predictive(&self, _: &[f64], _: &[f64]) -> Vec<VariancePart> {
            Vec::new()
        }
        fn simulate(&self, _: &[f64], _: &[f64], _: &Stream) -> Vec<lacuna::data::Measurements> {
            Vec::new()
        }
    }

    #[test]
    fn it_touches_the_density_at_the_point_and_bends_with_the_prior_and_the_noise() {
        let parameters = [
            Parameter::plain("amplitude", Distribution::Normal([1.0, 2.0])),
            Parameter::plain("rate", Distribution::LogUniform([0.01, 2.0])),
        ];
        let hyper = Hyperparameter {
            name: "variance".into(),
            symbol: "v".into(),
            unit: Unit::dimensionless(),
            prior: Distribution::HalfNormal(3.0),
            start: 0.5,
            log: true,
        };
        let ones = Ones { hyper: vec![hyper], cheap: true };
        let likelihood = OfData::new(&Decay, Vec::new(), &ones);
        let posterior = Posterior::new(&parameters[..], likelihood);
        let point = [1.3, 0.2, -0.7];
        let target = posterior.mode();
        let tangent = target.linearised(&point).unwrap();
        let (value, gradient) = target.gradient(&point);
        let (own, slopes) = tangent.gradient(&point);
        assert!((value - own).abs() < 1e-12);
        for (g, s) in gradient.iter().zip(&slopes) {
            assert!((g - s).abs() < 1e-12, "{gradient:?} {slopes:?}");
        }
        let row = |x: &[f64]| Matrix::from_rows(3, [x]);
        // The response is linear in the amplitude: along it and the variance the tangent is exact.
        let moved = [2.1, 0.2, 0.4];
        let [exact, found] = [&target as &dyn Target, &*tangent]
            .map(|t| (t.log_density(&row(&moved))[0], t.log_prior(&row(&moved))[0]));
        assert!((exact.0 - found.0).abs() < 1e-12 && (exact.1 - found.1).abs() < 1e-12);
        let bent = [1.3, 0.5, -0.7];
        assert!(
            (target.log_density(&row(&bent))[0] - tangent.log_density(&row(&bent))[0]).abs() > 0.1
        );
        assert_eq!(target.bounds(), tangent.bounds());
        assert!(target.linearised(&[1.3, 3.0, -0.7]).is_none(), "outside of the prior");
        let slow = Ones { cheap: false, hyper: ones.hyper.clone() };
        let likelihood = OfData::new(&Decay, Vec::new(), &slow);
        let posterior = Posterior::new(&parameters[..], likelihood);
        assert!(posterior.mode().linearised(&point).is_none());
    }
}
