//! The mutual information of data, which are normal under each hypothesis, with the hypothesis and with a quantity.

use lacuna::math::moments::log_sum;
use lacuna::math::random::{Stream, normal};
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, gram, multiply, thin_qr, transposed_multiply_vector};
use rayon::prelude::*;

use super::quantity::Linear;

/// Number of simulated data sets of each hypothesis.
const DRAWS: u64 = 2000;

/// New data under a hypothesis, in coordinates in which their noise is independent with variance one.
pub(super) struct Predicted {
    /// The expected data, less a reference that all hypotheses share, one value an output.
    pub mean: Vec<f64>,
    /// The derivatives by the unknowns, `unknowns x outputs`.
    pub slopes: Matrix,
    /// The posterior precision of the unknowns, `unknowns x unknowns`.
    pub precision: Matrix,
}

/// A Monte Carlo estimate in bits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bits {
    /// The estimate.
    pub value: f64,
    /// The standard error of the estimate.
    pub error: f64,
}

/// The information of new data on the hypothesis and on a quantity.
pub(super) struct Information {
    /// On the hypothesis.
    pub name: Bits,
    /// On the quantity, if there is one.
    pub quantity: Option<Bits>,
}

/// A hypothesis in the span in which hypotheses differ.
struct Density {
    mean: Vec<f64>,
    factor: Cholesky,
    quantity: Option<Joint>,
}

/// A quantity beside new data: jointly normal under a hypothesis.
struct Joint {
    value: f64,
    variance: f64,
    /// The coefficients of the regression of the quantity on the data.
    regression: Vec<f64>,
    /// The variance given the data.
    rest: f64,
}

impl Density {
    fn log(&self, at: &[f64]) -> f64 {
        let off: Vec<f64> = at.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        -0.5 * (self.factor.quadratic(&off) + self.factor.log_determinant())
    }
}

impl Joint {
    /// The mutual information of quantity and data in closed form.
    fn bits(&self) -> Bits {
        Bits { value: 0.5 * (self.variance / self.rest).log2(), error: 0.0 }
    }

    /// The mean given data that are off their own mean by these differences.
    fn given(&self, data: &[f64], mean: &[f64]) -> f64 {
        let off = data.iter().zip(mean).map(|(x, m)| x - m);
        self.value + self.regression.iter().zip(off).map(|(b, off)| b * off).sum::<f64>()
    }
}

/// The mutual information of data with the hypothesis, `sum_k w_k E_k log2(p_k / sum_j w_j p_j)`, and with a quantity `g`,
/// `E log2(p(g | data) / p(g))`. The expectations are over data, and quantities, simulated under each hypothesis; a single
/// hypothesis needs none. The densities have closed forms, so that one average is left (Box and Hill, Technometrics 9
/// (1967) 57; Rainforth et al., Statistical Science 39 (2024) 100). `None` if a density does not exist.
pub(super) fn bits(
    weights: &[f64],
    all: &[Predicted],
    quantities: Option<&[Linear]>,
    stream: &Stream,
) -> Option<Information> {
    let mixture = Mixture { weights, densities: reduced(all, quantities)? };
    if let [only] = &mixture.densities[..] {
        let nothing = Bits { value: 0.0, error: 0.0 };
        return Some(Information {
            name: nothing,
            quantity: only.quantity.as_ref().map(Joint::bits),
        });
    }
    let mut sums = [Moments::default(), Moments::default()];
    for (k, weight) in weights.iter().enumerate() {
        let draws: Vec<[f64; 2]> = (0..DRAWS)
            .into_par_iter()
            .map(|draw| mixture.gains(k, &stream.at(k as u64).at(draw)))
            .collect();
        for (i, sum) in sums.iter_mut().enumerate() {
            sum.add(*weight, &draws.iter().map(|gains| gains[i]).collect::<Vec<_>>());
        }
    }
    let [name, quantity] = sums.map(Moments::bits);
    Some(Information { name, quantity: quantities.map(|_| quantity) })
}

/// The mean of a mixture and the variance of its estimate.
#[derive(Default)]
struct Moments {
    mean: f64,
    variance: f64,
}

impl Moments {
    /// Adds the draws of a component of this weight.
    fn add(&mut self, weight: f64, draws: &[f64]) {
        let n = draws.len() as f64;
        let mean = draws.iter().sum::<f64>() / n;
        let square = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        self.mean += weight * mean;
        self.variance += weight * weight * square / (n * (n - 1.0));
    }

    fn bits(self) -> Bits {
        Bits { value: self.mean.max(0.0), error: self.variance.sqrt() }
    }
}

/// The hypotheses with their weights.
struct Mixture<'a> {
    weights: &'a [f64],
    densities: Vec<Density>,
}

impl Mixture<'_> {
    /// The gains in the log probability of hypothesis `k` and of a quantity, in bits, by data simulated under it.
    fn gains(&self, k: usize, stream: &Stream) -> [f64; 2] {
        let own = &self.densities[k];
        let mut rng = stream.generator();
        let z: Vec<f64> = own.mean.iter().map(|_| normal(&mut rng)).collect();
        let noise = own.factor.colour(&z);
        let data: Vec<f64> = own.mean.iter().zip(noise).map(|(m, e)| m + e).collect();
        let logs = self.densities.iter().zip(self.weights);
        let logs: Vec<f64> = logs.map(|(density, w)| w.ln() + density.log(&data)).collect();
        let all = log_sum(logs.iter().copied());
        let name = logs[k] - self.weights[k].ln() - all;
        let quantity = own.quantity.as_ref().map_or(0.0, |joint| {
            let g = joint.given(&data, &own.mean) + joint.rest.sqrt() * normal(&mut rng);
            self.gain_on(g, &data, &logs, all)
        });
        [name, quantity].map(|nats| nats / std::f64::consts::LN_2)
    }

    /// The log density of the quantity given data less that before.
    fn gain_on(&self, g: f64, data: &[f64], logs: &[f64], all: f64) -> f64 {
        let joints = || self.densities.iter().filter_map(|d| Some((d, d.quantity.as_ref()?)));
        let prior = joints()
            .zip(self.weights)
            .map(|((_, joint), w)| w.ln() + log_normal(g - joint.value, joint.variance));
        let posterior = joints().zip(logs).map(|((density, joint), log)| {
            log - all + log_normal(g - joint.given(data, &density.mean), joint.rest)
        });
        log_sum(posterior) - log_sum(prior)
    }
}

/// The log density of a normal distribution at a distance from its mean, without the constant.
fn log_normal(off: f64, variance: f64) -> f64 {
    -0.5 * (off * off / variance + variance.ln())
}

/// The share of the variance of a quantity that no data take away: rounding may not make it negative.
const REST: f64 = 1e-12;

/// The densities in the span of all means and slopes: elsewhere the hypotheses agree.
fn reduced(all: &[Predicted], quantities: Option<&[Linear]>) -> Option<Vec<Density>> {
    let rows = all
        .iter()
        .flat_map(|own| std::iter::once(own.mean.as_slice()).chain(own.slopes.iter_rows()))
        .map(unit);
    let span = Matrix::from_rows(all[0].mean.len(), rows);
    let basis = thin_qr(&span.transposed()).ok()?.q;
    let one = |(k, own): (usize, &Predicted)| {
        let mean = multiply(&Matrix::from_rows(own.mean.len(), [own.mean.clone()]), &basis);
        let slopes = multiply(&own.slopes, &basis);
        let posterior = Cholesky::new(&own.precision).ok()?;
        let spread = posterior.whiten_matrix(&slopes);
        let mut covariance = gram(&spread);
        (0..covariance.rows()).for_each(|j| covariance[(j, j)] += 1.0);
        let factor = Cholesky::new(&covariance).ok()?;
        let quantity = match quantities {
            Some(all) => Some(joint(&all[k], &posterior, &spread, &factor)?),
            None => None,
        };
        Some(Density { mean: mean.into_vec(), factor, quantity })
    };
    all.iter().enumerate().map(one).collect()
}

/// A quantity beside data whose whitened slopes are `spread`; `None` if it does not vary.
fn joint(own: &Linear, posterior: &Cholesky, spread: &Matrix, data: &Cholesky) -> Option<Joint> {
    let along = Matrix::from_vec(own.slopes.len(), 1, own.slopes.clone());
    let along = posterior.whiten_matrix(&along).into_vec();
    let variance = dot(&along, &along);
    let covariance = transposed_multiply_vector(spread, &along);
    let mut regression = covariance.clone();
    data.solve(&mut regression);
    let rest = (variance - dot(&covariance, &regression)).max(REST * variance);
    (variance > 0.0).then_some(Joint { value: own.value, variance, regression, rest })
}

/// A vector scaled to length one; zero stays.
fn unit(row: &[f64]) -> Vec<f64> {
    let length = row.iter().map(|x| x * x).sum::<f64>().sqrt();
    row.iter().map(|x| if length > 0.0 { x / length } else { 0.0 }).collect()
}
