//! A discrepancy in a library: a bias along the last axis, and noise.

use std::f64::consts::TAU;

use lacuna_plugin::data::{Coordinates, Layout, Measurements, Replicate};
use lacuna_plugin::linalg::vector::dot;
use lacuna_plugin::linalg::{Cholesky, Matrix, multiply_vector};
use lacuna_plugin::math::random::{Stream, normal};
use lacuna_plugin::plugin::discrepancy::{Discrepancy, Known, Likelihood, VariancePart};
use lacuna_plugin::plugin::{Component, Context, Fact, Hyperparameter};
use lacuna_plugin::run::Stop;
use lacuna_plugin::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A smooth bias of known size beside known noise.
///
/// The bias is common to all replicates: a Gaussian process along the last axis with the covariance function
/// `sd² (1 + √3 d / length) exp(-√3 d / length)` (Matérn with smoothness 3/2; Rasmussen and Williams, Gaussian
/// Processes for Machine Learning (2006), equation 4.17); curves of different sensors are independent. In addition,
/// each measured value has independent normal noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Matern {
    /// Standard deviation of the bias, in the unit of the response.
    pub sd: f64,
    /// Correlation length of the bias, in the unit of the last axis.
    pub length: f64,
    /// Standard deviation of the noise of one measured value, in the unit of the response.
    pub noise: f64,
}

impl Component for Matern {
    fn check(&self, _: &Context<'_>, complaints: &mut Complaints<'_>) {
        for (key, value) in [("sd", self.sd), ("length", self.length), ("noise", self.noise)] {
            if !(value.is_finite() && value > 0.0) {
                let problem = complaints.at(key).say(format!("wrong value for `{key}`"));
                problem.expected("a number above 0").found(value);
            }
        }
    }
}

impl Matern {
    /// Covariance of the bias at two outputs.
    fn covariance(&self, layout: &Layout, i: usize, j: usize) -> f64 {
        let Some(axis) = layout.axes.last() else { return self.sd * self.sd };
        let (curve, other) = (i / axis.len(), j / axis.len());
        let distance = match &axis.coordinates {
            Coordinates::Grid { values, .. } => (values[i % axis.len()] - values[j % axis.len()]).abs(),
            Coordinates::Labels(_) if i == j => 0.0,
            Coordinates::Labels(_) => return 0.0,
        };
        let x = 3.0_f64.sqrt() * distance / self.length;
        if curve == other { self.sd * self.sd * (1.0 + x) * (-x).exp() } else { 0.0 }
    }
}

impl Discrepancy for Matern {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(MaternLikelihood::new(self, known)?))
    }
}

/// The likelihood: everything is known, so it has no unknowns.
struct MaternLikelihood {
    data: Measurements,
    /// Indices of the measured outputs, and the means of their values.
    measured: Vec<usize>,
    means: Vec<f64>,
    /// Cholesky factor of the covariance of the means.
    factor: Cholesky,
    /// Part of the log-likelihood that does not depend on the response.
    constant: f64,
    noise: f64,
    /// Factor of the covariance that all replicates, including a new one, have in common.
    shared: Matrix,
}

impl MaternLikelihood {
    fn new(plugin: &Matern, known: &Known<'_>) -> Result<Self, Stop> {
        let layout = &known.data.layout;
        let outputs = layout.len();
        if known.data.replicates.iter().any(|r| r.values.iter().flatten().any(|y| !y.is_finite())) {
            return Err(Stop::new("a measured value is not finite"));
        }
        if let Some(odd) = known.common.iter().find(|error| error.factor.rows() != outputs) {
            return Err(Stop::new(format!("the error of origin `{}` is of another shape", odd.origin)));
        }
        let summaries = known.data.summaries();
        let measured: Vec<usize> = (0..outputs).filter(|&i| summaries[i].count > 0).collect();
        if measured.is_empty() {
            return Err(Stop::new("nothing was measured"));
        }
        let variance = plugin.noise * plugin.noise;
        let common = |i: usize, j: usize| -> f64 {
            known.common.iter().map(|error| dot(error.factor.row(i), error.factor.row(j))).sum()
        };
        let whole = |a: usize, b: usize| {
            let (i, j) = (measured[a], measured[b]);
            let own = if a == b { variance / summaries[i].count as f64 } else { 0.0 };
            plugin.covariance(layout, i, j) + common(i, j) + own
        };
        let covariance = Matrix::from_fn(measured.len(), measured.len(), whole);
        let factor = Cholesky::new(&covariance).map_err(|e| Stop::new(format!("the covariance: {e}")))?;
        // The density of the scatter about the means, and the normalisation of that of the means.
        let mut constant = -0.5 * (factor.log_determinant() + measured.len() as f64 * TAU.ln());
        for summary in measured.iter().map(|&i| &summaries[i]) {
            let count = summary.count as f64;
            constant -= 0.5 * ((count - 1.0) * (TAU * variance).ln() + count.ln() + summary.scatter / variance);
        }
        let bias = Matrix::from_fn(outputs, outputs, |i, j| {
            // The covariance of a smooth bias is singular to round-off; the small diagonal makes it positive definite.
            plugin.covariance(layout, i, j) + if i == j { 1e-10 * plugin.sd * plugin.sd } else { 0.0 }
        });
        let bias = Cholesky::new(&bias).map_err(|e| Stop::new(format!("the covariance of the bias: {e}")))?;
        let mut shared = bias.lower().clone();
        for error in known.common.iter().filter(|error| error.predictive) {
            let columns = shared.columns();
            shared = Matrix::from_fn(outputs, columns + error.factor.columns(), |i, j| {
                if j < columns { shared[(i, j)] } else { error.factor[(i, j - columns)] }
            });
        }
        let means = measured.iter().map(|&i| summaries[i].mean).collect();
        let (data, noise) = (known.data.clone(), plugin.noise);
        Ok(Self { data, measured, means, factor, constant, noise, shared })
    }

    /// Residuals of the means, and residuals multiplied by the inverse covariance.
    fn residuals(&self, response: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let residual: Vec<f64> = self.measured.iter().zip(&self.means).map(|(&i, y)| y - response[i]).collect();
        let mut weighted = residual.clone();
        self.factor.solve(&mut weighted);
        (residual, weighted)
    }
}

impl Likelihood for MaternLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &[]
    }

    fn log_likelihood(&self, response: &[f64], _: &[f64]) -> f64 {
        let (residual, weighted) = self.residuals(response);
        self.constant - 0.5 * dot(&residual, &weighted)
    }

    fn gradient(&self, response: &[f64], _: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut slopes = vec![0.0; response.len()];
        for (&i, weight) in self.measured.iter().zip(self.residuals(response).1) {
            slopes[i] = weight;
        }
        (slopes, Vec::new())
    }

    fn predictive(&self, response: &[f64], _: &[f64]) -> Vec<VariancePart> {
        let shared = self.shared.iter_rows().map(|row| dot(row, row)).collect();
        vec![
            VariancePart {
                origin: "measurement".into(),
                variance: vec![self.noise * self.noise; response.len()],
            },
            VariancePart { origin: "model_form".into(), variance: shared },
        ]
    }

    fn simulate(&self, response: &[f64], _: &[f64], stream: &Stream) -> Vec<Measurements> {
        let mut rng = stream.generator();
        let z: Vec<f64> = (0..self.shared.columns()).map(|_| normal(&mut rng)).collect();
        let bias = multiply_vector(&self.shared, &z);
        let mut new = |old: &Replicate| Replicate::new(old.name.clone(), (old.values.iter().enumerate())
                .map(|(i, value)| value.map(|_| response[i] + bias[i] + self.noise * normal(&mut rng)))
                .collect());
        let replicates = self.data.replicates.iter().map(&mut new).collect();
        vec![Measurements::new(self.data.layout.clone(), replicates)]
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("measured outputs", self.measured.len())]
    }
}
