//! The likelihood in the sufficient statistics of the replicates.
//!
//! With `n_i` replicates of output `i`, mean `ybar_i` and scatter `S_i = sum_r (y_ir - ybar_i)^2`, and the
//! residual `z_i = sqrt(n_i) (ybar_i - m_i)`, the data are distributed as
//!
//! ```text
//! log L = -1/2 [ N log(2 pi v) + (sum_i S_i)/v + log det(I + K/v) + z' (v I + K)^-1 z ]
//! ```
//!
//! where `K = W F F' W`, `W = diag(sqrt(n_i))`, is the covariance `F F'` of the common errors as it enters `z`. The
//! thin singular value decomposition `W F = U diag(s) V'` diagonalises `K` once for all `v`.

use lacuna::data::{Measurements, Unit};
use lacuna::linalg::vector::dot;
use lacuna::linalg::{self, Matrix};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{
    CommonError, Compressed, Hyperparameter, Likelihood, VariancePart,
};
use lacuna::plugin::surrogate::Linear;
use lacuna::run::Stop;

use super::compressed::CompressedGaussian;

/// See the module.
pub(super) struct GaussianLikelihood {
    data: Measurements,
    hyper: Vec<Hyperparameter>,
    common: Vec<CommonError>,
    pub(super) statistics: Statistics,
}

/// What the likelihood needs of the data and of the common errors.
#[derive(Debug, Clone)]
pub(super) struct Statistics {
    /// The outputs that were measured at least once.
    pub measured: Vec<usize>,
    /// `sqrt(n_i)` of each of them.
    pub weight: Vec<f64>,
    /// `sqrt(n_i) ybar_i` of each of them.
    pub weighted_mean: Vec<f64>,
    /// Number of data and total scatter.
    pub spread: Spread,
    /// `U'`: the directions of the common errors, `rank x measured`.
    pub directions: Matrix,
}

/// The part of the statistics that does not depend on the response.
#[derive(Debug, Clone)]
pub(super) struct Spread {
    /// The number of data.
    pub count: f64,
    /// The sum of squared deviations of the replicates from their means.
    pub scatter: f64,
    /// The eigenvalues of `K`.
    pub eigenvalues: Vec<f64>,
}

/// How many directions are summed side by side.
const LANES: usize = 8;

impl Spread {
    /// The log-likelihood given the squared residual outside the directions of the common errors and
    /// the residual along each of them.
    pub fn log_likelihood(&self, v: f64, outside: f64, along: &[f64]) -> f64 {
        let (log_determinant, squares) = self.common(v, along);
        let own = self.count * (std::f64::consts::TAU * v).ln();
        -0.5 * (own + log_determinant + (self.scatter + outside + squares) / v)
    }

    /// `log det(I + K/v)`, and the sum of the squared residuals along the directions, each divided by
    /// `1 + lambda / v`.
    ///
    /// Logarithms cost more than all the rest: one is taken of a product of as many factors as cannot
    /// overflow.
    fn common(&self, v: f64, along: &[f64]) -> (f64, f64) {
        let largest = 1.0 + self.eigenvalues.iter().copied().fold(0.0, f64::max) / v;
        let factors = ((600.0 / largest.ln()).min(1e6) as usize).max(1);
        let (mut log_determinant, mut squares) = (0.0, [0.0; LANES]);
        let runs = self.eigenvalues.chunks(LANES * factors);
        for (lambda, along) in runs.zip(along.chunks(LANES * factors)) {
            let mut product = [1.0; LANES];
            let (lambda, rest_lambda) = lambda.as_chunks::<LANES>();
            let (along, rest_along) = along.as_chunks::<LANES>();
            for (lambda, a) in lambda.iter().zip(along) {
                for l in 0..LANES {
                    let factor = 1.0 + lambda[l] / v;
                    product[l] *= factor;
                    squares[l] += a[l] * a[l] / factor;
                }
            }
            log_determinant += product.iter().map(|p| p.ln()).sum::<f64>();
            for (lambda, a) in rest_lambda.iter().zip(rest_along) {
                log_determinant += (lambda / v).ln_1p();
                squares[0] += a * a / (1.0 + lambda / v);
            }
        }
        (log_determinant, squares.iter().sum())
    }

    /// Its derivative by the variance.
    pub fn by_variance(&self, v: f64, outside: f64, along: &[f64]) -> f64 {
        let mut twice = self.count / v - (self.scatter + outside) / (v * v);
        for (&a, &lambda) in along.iter().zip(&self.eigenvalues) {
            twice -= lambda / (v * (v + lambda)) + (a / (v + lambda)).powi(2);
        }
        -0.5 * twice
    }
}

impl GaussianLikelihood {
    pub(super) fn new(
        data: &Measurements,
        common: &[CommonError],
        prior: Distribution,
    ) -> Result<Self, Stop> {
        check(data, common)?;
        let statistics = Statistics::of(data, common)?;
        let hyper = vec![Hyperparameter {
            name: "variance".to_owned(),
            symbol: "variance".to_owned(),
            unit: squared(&data.layout.unit)?,
            start: starting_variance(&statistics.spread, &statistics.weighted_mean, &prior),
            prior,
            log: true,
        }];
        Ok(Self { data: data.clone(), hyper, common: common.to_vec(), statistics })
    }

    fn residual(&self, response: &[f64]) -> Vec<f64> {
        let s = &self.statistics;
        let outputs = s.measured.iter().zip(&s.weight).zip(&s.weighted_mean);
        outputs.map(|((&i, w), mean)| mean - w * response[i]).collect()
    }

    /// The residual along the directions of the common errors, and what remains of it outside them.
    fn split(&self, response: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut outside = self.residual(response);
        let mut along = Vec::with_capacity(self.statistics.directions.rows());
        for direction in self.statistics.directions.iter_rows() {
            along.push(dot(direction, &outside));
        }
        for (direction, &a) in self.statistics.directions.iter_rows().zip(&along) {
            for (z, u) in outside.iter_mut().zip(direction) {
                *z -= a * u;
            }
        }
        (along, outside)
    }
}

impl Statistics {
    fn of(data: &Measurements, common: &[CommonError]) -> Result<Self, Stop> {
        let summaries = data.summaries();
        let measured: Vec<usize> =
            (0..summaries.len()).filter(|&i| summaries[i].count > 0).collect();
        if measured.is_empty() {
            return Err(Stop::new("the measurements hold no value"));
        }
        let weight: Vec<f64> =
            measured.iter().map(|&i| (summaries[i].count as f64).sqrt()).collect();
        let weighted_mean =
            measured.iter().zip(&weight).map(|(&i, w)| w * summaries[i].mean).collect();
        let count = data.count() as f64;
        let scatter = summaries.iter().map(|s| s.scatter).sum();
        let (directions, eigenvalues) = common_directions(common, &measured, &weight)?;
        let spread = Spread { count, scatter, eigenvalues };
        Ok(Self { measured, weight, weighted_mean, spread, directions })
    }
}

/// Refuses data and errors that are not on the layout, and values that no normal law gives.
fn check(data: &Measurements, common: &[CommonError]) -> Result<(), Stop> {
    let outputs = data.layout.len();
    for replicate in &data.replicates {
        let (name, count) = (&replicate.name, replicate.values.len());
        if count != outputs {
            let text = format!("replicate `{name}` has {count} values and not {outputs}");
            return Err(Stop::new(text));
        }
        let bad = |value: &Option<f64>| value.is_some_and(|y| !y.is_finite());
        if let Some(i) = replicate.values.iter().position(bad) {
            let place = data.layout.describe(i);
            return Err(Stop::new(format!("replicate `{name}` is not finite at {place}")));
        }
    }
    for CommonError { origin, factor, .. } in common {
        let rows = factor.rows();
        if rows != outputs {
            let text = format!("the common error `{origin}` has {rows} outputs and not {outputs}");
            return Err(Stop::new(text));
        }
    }
    Ok(())
}

/// The eigenvectors (as rows) and eigenvalues of the covariance `K` of all common errors.
fn common_directions(
    common: &[CommonError],
    measured: &[usize],
    weight: &[f64],
) -> Result<(Matrix, Vec<f64>), Stop> {
    let columns: Vec<(&Matrix, usize)> = common
        .iter()
        .flat_map(|error| (0..error.factor.columns()).map(move |k| (&error.factor, k)))
        .collect();
    if columns.is_empty() {
        return Ok((Matrix::zeros(0, measured.len()), Vec::new()));
    }
    let weighted = Matrix::from_fn(measured.len(), columns.len(), |i, k| {
        let (factor, column) = columns[k];
        weight[i] * factor[(measured[i], column)]
    });
    let svd = linalg::thin_svd(&weighted)
        .map_err(|e| Stop::new(format!("the covariance of the common errors: {e}")))?;
    let rank = svd.values.iter().filter(|&&s| s > 1e-12 * svd.values[0]).count();
    let kept: Vec<usize> = (0..rank).collect();
    let directions = svd.u.select_columns(&kept).transposed();
    Ok((directions, svd.values[..rank].iter().map(|s| s * s).collect()))
}

/// The unit of a variance.
fn squared(unit: &Unit) -> Result<Unit, Stop> {
    let text = unit.to_string();
    let squared = match text.as_str() {
        "1" => "1".to_owned(),
        t if t.chars().all(char::is_alphabetic) => format!("{t}^2"),
        t => format!("({t})^2"),
    };
    Unit::parse(&squared).map_err(|e| Stop::new(format!("the unit of the variance: {e}")))
}

/// The variance of the replicates about their means, or of the means where there are no replicates, kept
/// inside the prior.
fn starting_variance(spread: &Spread, means: &[f64], prior: &Distribution) -> f64 {
    let freedom = spread.count - means.len() as f64;
    let estimate = if freedom > 0.0 && spread.scatter > 0.0 {
        spread.scatter / freedom
    } else {
        0.01 * means.iter().map(|m| m * m).sum::<f64>() / means.len() as f64
    };
    if prior.log_density(estimate).is_finite() && estimate > 0.0 {
        estimate
    } else {
        prior.quantile(0.5)
    }
}

impl Likelihood for GaussianLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        if hyper[0].is_nan() || hyper[0] <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let (along, outside) = self.split(response);
        self.statistics.spread.log_likelihood(hyper[0], dot(&outside, &outside), &along)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let v = hyper[0];
        let s = &self.statistics;
        let (along, outside) = self.split(response);
        let squares = dot(&outside, &outside);
        let mut pull: Vec<f64> = outside.iter().map(|z| z / v).collect();
        for ((direction, a), lambda) in
            s.directions.iter_rows().zip(&along).zip(&s.spread.eigenvalues)
        {
            for (p, u) in pull.iter_mut().zip(direction) {
                *p += u * a / (v + lambda);
            }
        }
        let mut by_response = vec![0.0; response.len()];
        for ((&i, w), p) in s.measured.iter().zip(&s.weight).zip(&pull) {
            by_response[i] = w * p;
        }
        (by_response, vec![s.spread.by_variance(v, squares, &along)])
    }

    fn compress(&self, linear: &dyn Linear) -> Option<Box<dyn Compressed>> {
        let compressed = CompressedGaussian::new(&self.statistics, linear).ok()?;
        Some(Box::new(compressed))
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let mut parts = vec![VariancePart {
            origin: "discrepancy".to_owned(),
            variance: vec![hyper[0]; response.len()],
        }];
        for error in self.common.iter().filter(|error| error.predictive) {
            let variance = error.factor.iter_rows().map(|row| dot(row, row)).collect();
            parts.push(VariancePart { origin: error.origin.clone(), variance });
        }
        parts
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Measurements {
        let mut mean = response.to_vec();
        for (k, error) in self.common.iter().enumerate() {
            let mut rng = stream.named("common").at(k as u64).generator();
            let weights: Vec<f64> = (0..error.factor.columns()).map(|_| normal(&mut rng)).collect();
            for (m, row) in mean.iter_mut().zip(error.factor.iter_rows()) {
                *m += dot(row, &weights);
            }
        }
        let sd = hyper[0].sqrt();
        let mut data = self.data.clone();
        for (r, replicate) in data.replicates.iter_mut().enumerate() {
            let mut rng = stream.named("replicate").at(r as u64).generator();
            for (value, m) in replicate.values.iter_mut().zip(&mean) {
                let noise = sd * normal(&mut rng);
                if value.is_some() {
                    *value = Some(m + noise);
                }
            }
        }
        data
    }

    fn facts(&self) -> Vec<Fact> {
        let s = &self.statistics;
        vec![
            Fact::new("data", s.spread.count),
            Fact::new("measured outputs", s.measured.len()),
            Fact::new("directions of the common errors", s.directions.rows()),
        ]
    }
}
