//! Likelihood of the mean curve and of the scatter about it.

use std::f64::consts::TAU;

use lacuna::data::Measurements;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{ErrorPath, Hyperparameter, Known, Likelihood, VariancePart};
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, symmetric_eigen};

use super::GaussianProcess;
use super::bias::{Bias, basis};
use super::solve::Solved;
use crate::discrepancies::common::{
    Block, Noise, Replicates, SmoothBias, conditional, loses_an_output, part, values,
};

/// Likelihood with a smooth bias (see the module).
pub(super) struct BiasedLikelihood {
    noise: Noise,
    hyper: Vec<Hyperparameter>,
    replicates: Replicates,
    /// Index of each output among the measured ones.
    place: Vec<usize>,
    pub(super) bias: Bias,
    factor: Matrix,
}

impl BiasedLikelihood {
    pub(super) fn new(options: &GaussianProcess, known: &Known<'_>) -> Result<Self, Stop> {
        let likelihood = Self::under(options, known, known.data)?;
        likelihood
            .ok_or_else(|| Stop::new("an orthogonal bias depends on outputs that are not measured"))
    }

    /// Builds the likelihood of `known.data`, with measured variances taken from the replicates of `shown`. `None` if
    /// an orthogonal bias depends on outputs measured only in `shown`, because its distribution would then differ.
    pub(super) fn under(
        options: &GaussianProcess,
        known: &Known<'_>,
        shown: &Measurements,
    ) -> Result<Option<Self>, Stop> {
        let smooth = options.smooth();
        let mut bias = smooth.unknowns(known, 0.1)?;
        if options.orthogonal && loses_an_output(known.data, shown) {
            return Ok(None);
        }
        let noise = smooth.noise(known, shown, &mut bias)?;
        let SmoothBias { replicates, series, groups, sd, length, hyper } = bias;
        let basis = if options.orthogonal {
            basis(&(known.slopes)()?, &replicates)?
        } else {
            Matrix::zeros(replicates.measured.len(), 0)
        };
        let mut place = vec![usize::MAX; known.data.layout.len()];
        replicates.measured.iter().enumerate().for_each(|(k, &i)| place[i] = k);
        let blocks = Block::all(&series, &place, &groups);
        let kernel = options.kernel;
        let bias = Bias { kernel, blocks, grid: series.grid, basis, sd, length };
        let factor = replicates.common_factor(known.common)?;
        Ok(Some(Self { noise, hyper, replicates, place, bias, factor }))
    }

    /// Returns the variance of each measured output.
    fn variance(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        Some(self.noise.by_measured(&self.replicates, self.noise.variance.values(hyper)?))
    }

    fn solve<'a>(
        &'a self,
        response: &[f64],
        hyper: &'a [f64],
        variance: &[f64],
    ) -> Option<Solved<'a>> {
        let means: Vec<f64> =
            variance.iter().zip(&self.replicates.count).map(|(v, n)| v / n).collect();
        let residual = self.replicates.residual(response);
        Solved::new(&self.bias, self.bias.values(hyper)?, means, &self.factor, residual)
    }

    /// Returns the prior variance of the bias at each output.
    fn bias_variance(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let values = self.bias.values(hyper)?;
        let (images, inner) = self.bias.projection(values)?;
        let mut variance = vec![0.0; self.place.len()];
        for (block, image) in self.bias.blocks.iter().zip(&images) {
            let (sd, _) = block.of(values);
            for (&i, row) in block.outputs.iter().zip(image.iter_rows()) {
                variance[i] = (sd * sd - inner.quadratic(row)).max(0.0);
            }
        }
        Some(variance)
    }

    /// Draws a bias from its prior.
    fn draw(&self, hyper: &[f64], stream: &Stream) -> Option<Vec<f64>> {
        let values = self.bias.values(hyper)?;
        let mut bias = vec![0.0; self.place.len()];
        for (s, block) in self.bias.blocks.iter().enumerate() {
            let (sd, length) = block.of(values);
            let grid = &self.bias.grid;
            let eigen = symmetric_eigen(&self.bias.covariance(grid, grid, sd, length)).ok()?;
            let mut rng = stream.at(s as u64).generator();
            let weights: Vec<f64> =
                eigen.values.iter().map(|l| l.max(0.0).sqrt() * normal(&mut rng)).collect();
            for (&i, row) in block.outputs.iter().zip(eigen.vectors.iter_rows()) {
                bias[i] = dot(row, &weights);
            }
        }
        self.orthogonal(values, bias)
    }

    /// Subtracts from a process its projection on the derivatives with respect to the parameters, `H S^-1 G'`.
    fn orthogonal(&self, values: (&[f64], &[f64]), mut bias: Vec<f64>) -> Option<Vec<f64>> {
        let mut along = vec![0.0; self.bias.basis.columns()];
        for &i in self.bias.blocks.iter().flat_map(|block| &block.outputs) {
            if self.place[i] != usize::MAX {
                let basis = self.bias.basis.row(self.place[i]);
                along.iter_mut().zip(basis).for_each(|(sum, g)| *sum += g * bias[i]);
            }
        }
        let (images, inner) = self.bias.projection(values)?;
        inner.solve(&mut along);
        for (block, image) in self.bias.blocks.iter().zip(&images) {
            for (&i, row) in block.outputs.iter().zip(image.iter_rows()) {
                bias[i] -= dot(row, &along);
            }
        }
        Some(bias)
    }

    /// Makes of a draw of the bias from its prior one of the bias given the data (Matheron's rule; Journel and
    /// Huijbregts, Mining Geostatistics (1978), VII.A): the data that it would have given, with a draw of noise and common
    /// errors, differ from the actual ones, and what this difference says about the bias is added.
    fn given_data(
        &self,
        response: &[f64],
        hyper: &[f64],
        bias: &[f64],
        stream: &Stream,
    ) -> Option<Vec<f64>> {
        let values = self.bias.values(hyper)?;
        let variance = self.variance(hyper)?;
        let mut rng = stream.generator();
        let weights: Vec<f64> = (0..self.factor.columns()).map(|_| normal(&mut rng)).collect();
        let mut data: Vec<f64> = response.iter().zip(bias).map(|(r, b)| r + b).collect();
        for (k, &i) in self.replicates.measured.iter().enumerate() {
            let noise = (variance[k] / self.replicates.count[k]).sqrt() * normal(&mut rng);
            data[i] += noise + dot(self.factor.row(k), &weights);
        }
        let pull = self.solve(&data, hyper, &variance)?.precision().pull;
        let mut change = vec![0.0; bias.len()];
        for block in &self.bias.blocks {
            let (sd, length) = block.of(values);
            let own: Vec<f64> = block.rows.iter().map(|&row| pull[row]).collect();
            let covariance = self.bias.covariance(&self.bias.grid, &block.grid, sd, length);
            let spread = lacuna_linalg::multiply_vector(&covariance, &own);
            block.outputs.iter().zip(spread).for_each(|(&i, value)| change[i] = value);
        }
        let change = self.orthogonal(values, change)?;
        Some(bias.iter().zip(change).map(|(b, c)| b + c).collect())
    }
}

impl Likelihood for BiasedLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    /// The scatter of the replicates depends on the noise only; their means also have bias and common errors.
    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let Some(variance) = self.variance(hyper) else { return f64::NEG_INFINITY };
        let Some(solved) = self.solve(response, hyper, &variance) else {
            return f64::NEG_INFINITY;
        };
        let r = &self.replicates;
        let mut twice = solved.twice;
        for (i, v) in variance.iter().enumerate() {
            let n = r.count[i];
            twice += TAU.ln() + (n - 1.0) * (TAU * v).ln() + n.ln() + r.scatter[i] / v;
        }
        if twice.is_nan() { f64::NEG_INFINITY } else { -0.5 * twice }
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut by_hyper = vec![0.0; hyper.len()];
        let solved = self.variance(hyper).and_then(|v| Some((self.solve(response, hyper, &v)?, v)));
        let values = self.bias.values(hyper);
        let Some(((solved, variance), values)) = solved.zip(values) else {
            return (vec![0.0; response.len()], by_hyper);
        };
        let r = &self.replicates;
        let precision = solved.precision();
        let by_variance: Vec<f64> = (0..variance.len())
            .map(|k| {
                let (n, v) = (r.count[k], variance[k]);
                let own = (n - 1.0) / v - r.scatter[k] / (v * v);
                -0.5 * (own + (precision.diagonal[k] - precision.pull[k].powi(2)) / n)
            })
            .collect();
        self.noise.variance.add_gradient(&self.noise.by_group(r, &by_variance), &mut by_hyper);
        let (mut by_sd, mut by_length) = (vec![0.0; values.0.len()], vec![0.0; values.0.len()]);
        for (block, [sd, length]) in self.bias.blocks.iter().zip(precision.by_process()) {
            let Some(g) = block.group else { continue };
            by_sd[g] += sd;
            by_length[g] += length;
        }
        self.bias.sd.add_gradient(&by_sd, &mut by_hyper);
        self.bias.length.add_gradient(&by_length, &mut by_hyper);
        (r.over_all(&precision.pull, response.len()), by_hyper)
    }

    /// With `V` the covariance of the means, the precision of a value of output `i` is
    /// `(1 - 1/n_i) / v_i + (V^-1)_ii / n_i^2`.
    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let variance = self.variance(hyper)?;
        let solved = self.solve(response, hyper, &variance)?;
        let precision = solved.precision();
        let r = &self.replicates;
        let one = |(i, y): (usize, f64)| {
            let k = self.place[i];
            let (n, v) = (r.count[k], variance[k]);
            let pull = (y - r.mean[k]) / v + precision.pull[k] / n;
            conditional(pull, (1.0 - 1.0 / n) / v + precision.diagonal[k] / (n * n))
        };
        Some(values(&self.noise.setting.data).map(one).collect())
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let unknown = || vec![f64::NAN; response.len()];
        let noise = self.noise.variance.values(hyper).map(|g| self.noise.by_output(g));
        let mut parts = vec![
            part("measurement", noise.unwrap_or_else(unknown)),
            part("model_form", self.bias_variance(hyper).unwrap_or_else(unknown)),
        ];
        parts.extend(self.noise.setting.common_parts());
        parts
    }

    /// The bias is drawn from its prior.
    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let noise = self.noise.by_output(self.noise.variance.values(hyper).unwrap_or_default());
        let noise = part("measurement", noise).independent(&stream.at(0));
        let bias = self.draw(hyper, &stream.at(1));
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
        let mut paths = self.errors(response, hyper, stream);
        paths[1].values =
            self.given_data(response, hyper, &paths[1].values, &stream.named("given data"))?;
        Some(paths)
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let setting = &self.noise.setting;
        let mut mean = setting.with_common_errors(response, stream);
        let bias = self.draw(hyper, &stream.named("bias")).unwrap_or_default();
        mean.iter_mut().zip(bias).for_each(|(m, b)| *m += b);
        let noise = self.noise.by_output(self.noise.variance.values(hyper).unwrap_or_default());
        vec![setting.noisy(&mean, &noise, stream)]
    }

    fn facts(&self) -> Vec<Fact> {
        vec![
            Fact::new("data", self.replicates.count.iter().sum::<f64>()),
            Fact::new("measured outputs", self.replicates.measured.len()),
            Fact::new("series with a bias", self.bias.blocks.len()),
            Fact::new("directions the bias is orthogonal to", self.bias.basis.columns()),
            Fact::new("directions of the common errors", self.factor.columns()),
        ]
    }
}

#[cfg(test)]
impl BiasedLikelihood {
    /// Returns the dense prior covariance of the bias at the measured outputs.
    pub(super) fn written_bias(&self, hyper: &[f64]) -> Matrix {
        #![allow(clippy::unwrap_used)]
        use lacuna_linalg;
        let values = self.bias.values(hyper).unwrap();
        let n = self.replicates.measured.len();
        let mut plain = Matrix::zeros(n, n);
        let covariances = self.bias.covariances(values);
        for (s, block) in self.bias.blocks.iter().enumerate() {
            let [c, _] = self.bias.of(&covariances, s).unwrap();
            for (i, &a) in block.rows.iter().enumerate() {
                for (j, &b) in block.rows.iter().enumerate() {
                    plain[(a, b)] = c[(i, j)];
                }
            }
        }
        if self.bias.basis.columns() == 0 {
            return plain;
        }
        let image = lacuna_linalg::multiply(&plain, &self.bias.basis);
        let inner = lacuna_linalg::transposed_multiply(&self.bias.basis, &image);
        let solved =
            lacuna_linalg::Cholesky::new(&inner).unwrap().solve_matrix(&image.transposed());
        let taken = lacuna_linalg::multiply(&image, &solved);
        super::bias::add(&mut plain, -1.0, &taken);
        plain
    }
}
