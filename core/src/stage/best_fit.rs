//! Where the model fits the data best, before any discrepancy is chosen, and how its response changes there.

use crate::data::Measurements;
use crate::linalg::{self, Cholesky, Matrix};
use crate::math::distribution::Distribution;
use crate::math::random::Stream;
use crate::plugin::Emulator;
use crate::plugin::discrepancy::{Hyperparameter, Likelihood, VariancePart};
use crate::posterior::{Emulated, Posterior};
use crate::run::Stop;
use crate::study::Study;

use super::left_out::{self, Fit, Sampled};
use super::start::maxima;
use super::stream;

/// The parameters at the largest of prior times `|y - m|^-N`: the normal likelihood of independent data
/// with its unknown variance integrated out under the prior `1 / variance`.
pub fn point(
    study: &Study,
    data: &Measurements,
    emulator: &dyn Emulator,
) -> Result<Vec<f64>, Stop> {
    let likelihood = LeastSquares::of(data)?;
    let posterior =
        Posterior::new(&study.parameters, Emulated::new(&study.layout, emulator, &[], &likelihood));
    let maxima = maxima(&posterior, &stream(study, "best-fit"))?;
    Ok(maxima[0].point.clone())
}

/// The response at [`point`] and its derivative by each parameter, per standard deviation of the prior.
pub fn fit(study: &Study, data: &Measurements, emulator: &dyn Emulator) -> Result<Fit, Stop> {
    Ok(fit_at(study, emulator, &point(study, data, emulator)?))
}

fn fit_at(study: &Study, emulator: &dyn Emulator, point: &[f64]) -> Fit {
    let jacobian = emulator.jacobian(point);
    let sd: Vec<f64> = study.parameters.iter().map(|p| scale(&p.prior)).collect();
    let slopes =
        Matrix::from_fn(jacobian.rows(), jacobian.columns(), |i, j| jacobian[(i, j)] * sd[j]);
    let row = Matrix::from_vec(1, point.len(), point.to_vec());
    Fit { response: emulator.mean(&row).into_vec(), slopes }
}

/// The same where the model fits best given errors that all replicates share: by Gauss-Newton steps from [`point`].
///
/// Without them the fit takes the errors for the parameters, and its slopes are those of another place.
pub fn fit_with_errors(
    study: &Study,
    data: &Measurements,
    emulator: &dyn Emulator,
    errors: &[Sampled],
) -> Result<Fit, Stop> {
    let mut at = point(study, data, emulator)?;
    let mut fit = fit_at(study, emulator, &at);
    let Some(metric) = Metric::of(data, &fit, errors)? else { return Ok(fit) };
    let mut squares = metric.squares(&fit);
    for _ in 0..STEPS {
        let step = metric.step(&fit)?;
        let better = (0..HALVINGS).find_map(|halving| {
            let length = 0.5_f64.powi(halving);
            let moved = study.parameters.iter().zip(&at).zip(&step).map(|((p, x), s)| {
                let [low, high] = [0.001, 0.999].map(|q| p.prior.quantile(q));
                (x + length * s * scale(&p.prior)).clamp(low.min(*x), high.max(*x))
            });
            let to: Vec<f64> = moved.collect();
            let there = fit_at(study, emulator, &to);
            let less = metric.squares(&there);
            (less < squares).then_some((to, there, less))
        });
        let Some((to, there, less)) = better else { break };
        let gain = squares - less;
        (at, fit, squares) = (to, there, less);
        if gain < ENOUGH {
            break;
        }
    }
    Ok(fit)
}

/// The derivatives of [`fit`] alone.
pub fn slopes(study: &Study, data: &Measurements, emulator: &dyn Emulator) -> Result<Matrix, Stop> {
    Ok(fit(study, data, emulator)?.slopes)
}

/// The most Gauss-Newton steps, and how often each is halved.
const STEPS: usize = 50;
const HALVINGS: i32 = 10;
/// A gain in the squares, each of the size one, that ends the search.
const ENOUGH: f64 = 1e-3;

/// The sum of squares of residuals given noise and common errors.
struct Metric {
    root: Vec<f64>,
    mean: Vec<f64>,
    /// The common errors over the noise.
    factor: Matrix,
    capacitance: Cholesky,
}

impl Metric {
    fn of(data: &Measurements, fit: &Fit, errors: &[Sampled]) -> Result<Option<Self>, Stop> {
        let Some(weight) = left_out::weights(data, &fit.response) else { return Ok(None) };
        let root: Vec<f64> = weight.iter().map(|w| w.sqrt()).collect();
        let columns: Vec<Vec<f64>> = errors
            .iter()
            .flat_map(|e| (0..e.error.factor.columns()).map(|k| e.error.factor.column(k)))
            .collect();
        let factor = Matrix::from_fn(root.len(), columns.len(), |i, k| root[i] * columns[k][i]);
        let mut capacitance = linalg::gram(&factor);
        (0..columns.len()).for_each(|k| capacitance[(k, k)] += 1.0);
        let capacitance = Cholesky::new(&capacitance)
            .map_err(|e| Stop::new(format!("the covariance of the common errors: {e}")))?;
        let mean = data.summaries().iter().map(|s| s.mean).collect();
        Ok(Some(Self { root, mean, factor, capacitance }))
    }

    /// Residuals over the noise, and their precision times them.
    fn residual(&self, fit: &Fit) -> (Vec<f64>, Vec<f64>) {
        let pairs = self.mean.iter().zip(&fit.response).zip(&self.root);
        let white: Vec<f64> = pairs.map(|((y, m), r)| r * (y - m)).collect();
        let mut zeta = linalg::transposed_multiply_vector(&self.factor, &white);
        self.capacitance.solve(&mut zeta);
        let made = linalg::multiply_vector(&self.factor, &zeta);
        let rest = white.iter().zip(made).map(|(w, m)| w - m).collect();
        (white, rest)
    }

    fn squares(&self, fit: &Fit) -> f64 {
        let (white, rest) = self.residual(fit);
        white.iter().zip(&rest).map(|(a, b)| a * b).sum()
    }

    /// The step per standard deviation of the prior, damped as by a normal prior about where it starts.
    fn step(&self, fit: &Fit) -> Result<Vec<f64>, Stop> {
        let (_, rest) = self.residual(fit);
        let slopes = Matrix::from_fn(self.root.len(), fit.slopes.columns(), |i, j| {
            self.root[i] * fit.slopes[(i, j)]
        });
        let reach = linalg::transposed_multiply(&self.factor, &slopes);
        let taken = linalg::gram(&self.capacitance.whiten_matrix(&reach));
        let free = linalg::gram(&slopes);
        let information = Matrix::from_fn(free.rows(), free.columns(), |i, j| {
            free[(i, j)] - taken[(i, j)] + f64::from(u8::from(i == j))
        });
        let mut step = linalg::transposed_multiply_vector(&slopes, &rest);
        Cholesky::new(&information)
            .map_err(|e| Stop::new(format!("the best fit with common errors: {e}")))?
            .solve(&mut step);
        Ok(step)
    }
}

/// The standard deviation of a law, or a quarter of the range of its middle 95 % where it has none.
fn scale(law: &Distribution) -> f64 {
    let sd = law.variance().sqrt();
    if sd.is_finite() { sd } else { 0.25 * (law.quantile(0.975) - law.quantile(0.025)) }
}

/// Independent normal data whose one variance is integrated out.
struct LeastSquares<'a> {
    data: &'a Measurements,
    /// Number of replicates and their mean, by output.
    outputs: Vec<(f64, f64)>,
    scatter: f64,
    count: f64,
}

impl<'a> LeastSquares<'a> {
    fn of(data: &'a Measurements) -> Result<Self, Stop> {
        let summaries = data.summaries();
        if summaries.iter().all(|s| s.count == 0) {
            return Err(Stop::new("the measurements hold no value"));
        }
        Ok(Self {
            data,
            outputs: summaries.iter().map(|s| (s.count as f64, s.mean)).collect(),
            scatter: summaries.iter().map(|s| s.scatter).sum(),
            count: data.count() as f64,
        })
    }

    fn squares(&self, response: &[f64]) -> f64 {
        let each = self.outputs.iter().zip(response).filter(|((n, _), _)| *n > 0.0);
        self.scatter + each.map(|((n, mean), y)| n * (mean - y).powi(2)).sum::<f64>()
    }
}

impl Likelihood for LeastSquares<'_> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &[]
    }

    fn log_likelihood(&self, response: &[f64], _hyper: &[f64]) -> f64 {
        // Data that fit exactly would make the density infinite.
        -0.5 * self.count * self.squares(response).max(f64::MIN_POSITIVE).ln()
    }

    fn gradient(&self, response: &[f64], _hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let factor = self.count / self.squares(response).max(f64::MIN_POSITIVE);
        let slope = |((n, mean), y): (&(f64, f64), &f64)| {
            if *n > 0.0 { factor * n * (mean - y) } else { 0.0 }
        };
        (self.outputs.iter().zip(response).map(slope).collect(), Vec::new())
    }

    fn predictive(&self, _response: &[f64], _hyper: &[f64]) -> Vec<VariancePart> {
        Vec::new()
    }

    /// Data without noise, of which this likelihood knows no size.
    fn simulate(&self, response: &[f64], _hyper: &[f64], _stream: &Stream) -> Measurements {
        let mut data = self.data.clone();
        for replicate in &mut data.replicates {
            for (value, y) in replicate.values.iter_mut().zip(response) {
                *value = value.map(|_| *y);
            }
        }
        data
    }
}
