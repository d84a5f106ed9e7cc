//! Likelihood of data whose means share a normal bias with a dense covariance, for several discrepancies.

use lacuna::data::Measurements;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{ErrorPath, Hyperparameter, Likelihood, VariancePart};
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, symmetric_eigen};

use super::{Dense, Noise, part};

/// A normal bias of mean zero, the same in all replicates.
pub trait Bias: Send + Sync {
    /// Covariance at the measured outputs; `None` outside the support of the hyperparameters.
    fn covariance(&self, hyper: &[f64]) -> Option<Matrix>;

    /// Adds the derivatives by hyperparameter, given the symmetric derivative with respect to the covariance.
    fn add_gradient(&self, hyper: &[f64], by_covariance: &Matrix, by_hyper: &mut [f64]);

    /// Variance at each output.
    fn variance(&self, hyper: &[f64]) -> Option<Vec<f64>>;

    /// Covariance of all outputs; `None` outside the support of the hyperparameters, or if the errors of the data are not
    /// those of a new replicate.
    fn everywhere(&self, hyper: &[f64]) -> Option<Matrix>;

    /// One draw of all outputs.
    fn draw(&self, hyper: &[f64], stream: &Stream) -> Option<Vec<f64>>;

    /// Facts for the report.
    fn facts(&self) -> Vec<Fact>;
}

/// The likelihood under a bias and independent noise.
pub struct Biased<B> {
    /// Noise of a replicate.
    pub noise: Noise,
    /// Unknowns.
    pub hyper: Vec<Hyperparameter>,
    /// Statistics of the data.
    pub dense: Dense,
    /// The bias.
    pub bias: B,
}

impl<B: Bias> Biased<B> {
    fn variance(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        Some(self.noise.by_measured(&self.dense.replicates, self.noise.variance.values(hyper)?))
    }

    fn solve(&self, response: &[f64], hyper: &[f64]) -> Option<(super::DenseSolved, Vec<f64>)> {
        let variance = self.variance(hyper)?;
        let residual = self.dense.replicates.residual(response);
        Some((self.dense.solve(&self.bias.covariance(hyper)?, &residual, &variance)?, variance))
    }
}

impl<B: Bias> Likelihood for Biased<B> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        self.solve(response, hyper).map_or(f64::NEG_INFINITY, |(solved, _)| solved.log_likelihood)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut by_hyper = vec![0.0; hyper.len()];
        let Some((solved, variance)) = self.solve(response, hyper) else {
            return (vec![0.0; response.len()], by_hyper);
        };
        let by_covariance = solved.by_covariance();
        self.dense.add_by_noise(&self.noise, &variance, &by_covariance, &mut by_hyper);
        self.bias.add_gradient(hyper, &by_covariance, &mut by_hyper);
        (self.dense.replicates.over_all(&solved.pull, response.len()), by_hyper)
    }

    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let (solved, variance) = self.solve(response, hyper)?;
        Some(self.dense.left_out(&solved, &self.noise.setting.data, &variance, |_, _, _| 0.0))
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let unknown = || vec![f64::NAN; response.len()];
        let noise = self.noise.variance.values(hyper).map(|g| self.noise.by_output(g));
        let mut parts = vec![
            part("measurement", noise.unwrap_or_else(unknown)),
            part("model_form", self.bias.variance(hyper).unwrap_or_else(unknown)),
        ];
        parts.extend(self.noise.setting.common_parts());
        parts
    }

    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let noise = self.noise.by_output(self.noise.variance.values(hyper).unwrap_or_default());
        let noise = part("measurement", noise).independent(&stream.at(0));
        let bias = self.bias.draw(hyper, &stream.at(1));
        let values = bias.unwrap_or_else(|| vec![f64::NAN; response.len()]);
        let own = [noise, ErrorPath { origin: "model_form".into(), values }];
        own.into_iter().chain(self.noise.setting.drawn_common_errors(stream)).collect()
    }

    fn errors_given_data(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Option<Vec<ErrorPath>> {
        let (solved, _) = self.solve(response, hyper)?;
        let mut covariance = self.bias.everywhere(hyper)?;
        let cross = covariance.select_columns(&self.dense.replicates.measured);
        let mut mean = vec![0.0; response.len()];
        solved.condition(&cross, &mut mean, &mut covariance);
        let drawn = normal_draw(&mean, &covariance, &stream.at(1))?;
        let mut paths = self.errors(response, hyper, stream);
        paths[1].values = drawn;
        Some(paths)
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let setting = &self.noise.setting;
        let mut mean = setting.with_common_errors(response, stream);
        let bias = self.bias.draw(hyper, &stream.named("bias")).unwrap_or_default();
        mean.iter_mut().zip(bias).for_each(|(m, b)| *m += b);
        let noise = self.noise.by_output(self.noise.variance.values(hyper).unwrap_or_default());
        vec![setting.noisy(&mean, &noise, stream)]
    }

    fn facts(&self) -> Vec<Fact> {
        let mut facts = vec![
            Fact::new("data", self.dense.replicates.count.iter().sum::<f64>()),
            Fact::new("measured outputs", self.dense.replicates.measured.len()),
        ];
        facts.extend(self.bias.facts());
        facts.push(Fact::new("directions of the common errors", self.dense.factor.columns()));
        facts
    }
}

/// Draws a normal vector whose covariance may be singular.
pub fn normal_draw(mean: &[f64], covariance: &Matrix, stream: &Stream) -> Option<Vec<f64>> {
    let eigen = symmetric_eigen(covariance).ok()?;
    let mut rng = stream.generator();
    let weights: Vec<f64> =
        eigen.values.iter().map(|l| l.max(0.0).sqrt() * normal(&mut rng)).collect();
    Some(
        mean.iter().zip(eigen.vectors.iter_rows()).map(|(m, row)| m + dot(row, &weights)).collect(),
    )
}
