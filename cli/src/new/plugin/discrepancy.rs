//! `skeleton`: normal noise with one unknown standard deviation.

use std::f64::consts::TAU;

use lacuna::data::Measurements;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, Known, VariancePart};
use lacuna::plugin::{Component, Context, Discrepancy, Hyperparameter, Likelihood};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Independent normal noise with one standard deviation for all outputs.
///
/// Every measured value is the model's response, plus the errors common to all replicates, plus a normal number. If the
/// noise differs between sensors, or values at neighbouring times are correlated, use `gaussian` or `autoregressive`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Prior of the standard deviation, in the unit of the response, such as `{ half_normal = 1e-5 }`. Default:
    /// half-normal with the root mean square of all measured values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation: Option<Distribution>,
}

impl Component for Skeleton {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(prior) = self.deviation.as_ref().filter(|prior| prior.support().0 < 0.0) {
            complaints
                .at("deviation")
                .say("a standard deviation is not below zero")
                .expected("a prior of positive numbers, such as `{ half_normal = 1e-5 }`")
                .found(prior);
        }
    }
}

impl Discrepancy for Skeleton {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        check_data(known.data)?;
        let values = || known.data.replicates.iter().flat_map(|r| r.values.iter().flatten());
        let squares: f64 = values().map(|y| y * y).sum();
        let size = (squares / known.data.count() as f64).sqrt();
        let wide = Distribution::HalfNormal(if size > 0.0 { size } else { 1.0 });
        let prior = self.deviation.clone().unwrap_or(wide);
        let unknown = Hyperparameter {
            name: "deviation".into(),
            symbol: "s".into(),
            unit: known.data.layout.unit.clone(),
            log: true,
            start: prior.quantile(0.5),
            prior,
        };
        Ok(Box::new(Noise::new(known, unknown)?))
    }
}

/// Rejects data for which no likelihood can be computed.
fn check_data(data: &Measurements) -> Result<(), Stop> {
    let outputs = data.layout.len();
    for replicate in &data.replicates {
        let (name, found) = (&replicate.name, replicate.values.len());
        if found != outputs {
            return Err(Stop::new(format!(
                "replicate `{name}` has {found} values and not {outputs}"
            )));
        }
        if replicate.values.iter().flatten().any(|y| !y.is_finite()) {
            return Err(Stop::new(format!("replicate `{name}` has a value that is not finite")));
        }
    }
    if data.count() == 0 { Err(Stop::new("the measurements hold no value")) } else { Ok(()) }
}

/// The likelihood as a function of count, mean and scatter of each output, so that its cost does not depend on the
/// number of replicates.
///
/// With the common errors `F z`, `z` standard normal, `N` the counts and `e = mean - response - F z`,
///
/// ```text
/// -2 log L = n log(2 pi s²) + log det(I + F' N F / s²) + |z|² + (scatter + e' N e) / s²
/// ```
///
/// at `z = (s² I + F' N F)⁻¹ F' N (mean - response)`, which is Woodbury's identity without its cancellation.
struct Noise {
    data: Measurements,
    common: Vec<CommonError>,
    unknown: [Hyperparameter; 1],
    count: Vec<f64>,
    mean: Vec<f64>,
    scatter: f64,
    /// `F`: the factors of all common errors side by side, `outputs x rank`.
    factor: Matrix,
    /// `F' N F`.
    gram: Matrix,
}

/// The most probable common error at one response.
struct Solved {
    capacitance: Cholesky,
    /// `z`.
    weights: Vec<f64>,
    /// `e`, zero where nothing was measured.
    error: Vec<f64>,
    /// `scatter + e' N e`.
    squares: f64,
}

impl Noise {
    fn new(known: &Known<'_>, unknown: Hyperparameter) -> Result<Self, Stop> {
        let summaries = known.data.summaries();
        let outputs = summaries.len();
        if let Some(error) = known.common.iter().find(|e| e.factor.rows() != outputs) {
            let (origin, rows) = (&error.origin, error.factor.rows());
            return Err(Stop::new(format!(
                "the common error `{origin}` has {rows} outputs and not {outputs}"
            )));
        }
        let row = |i: usize| -> Vec<f64> {
            known.common.iter().flat_map(|error| error.factor.row(i)).copied().collect()
        };
        let rank = known.common.iter().map(|error| error.factor.columns()).sum();
        let factor = Matrix::from_rows(rank, (0..outputs).map(row));
        let count: Vec<f64> = summaries.iter().map(|s| s.count as f64).collect();
        let weighted = Matrix::from_fn(outputs, rank, |i, k| count[i].sqrt() * factor[(i, k)]);
        Ok(Self {
            data: known.data.clone(),
            common: known.common.to_vec(),
            unknown: [unknown],
            mean: summaries.iter().map(|s| s.mean).collect(),
            scatter: summaries.iter().map(|s| s.scatter).sum(),
            gram: lacuna_linalg::gram(&weighted),
            count,
            factor,
        })
    }

    /// The most probable common error; `None` for an invalid standard deviation.
    fn solve(&self, response: &[f64], deviation: f64) -> Option<Solved> {
        let variance = deviation * deviation;
        if !(deviation > 0.0 && variance > 0.0 && variance.is_finite()) {
            return None;
        }
        let mut capacitance = self.gram.clone();
        for k in 0..capacitance.rows() {
            capacitance[(k, k)] += variance;
        }
        let capacitance = Cholesky::new(&capacitance).ok()?;
        let residual = |i: usize| {
            if self.count[i] > 0.0 { self.mean[i] - response[i] } else { 0.0 }
        };
        let mut error: Vec<f64> = (0..response.len()).map(residual).collect();
        let pull: Vec<f64> = error.iter().zip(&self.count).map(|(e, n)| n * e).collect();
        let mut weights = lacuna_linalg::transposed_multiply_vector(&self.factor, &pull);
        capacitance.solve(&mut weights);
        let mut squares = self.scatter;
        for (i, e) in error.iter_mut().enumerate().filter(|(i, _)| self.count[*i] > 0.0) {
            *e -= dot(self.factor.row(i), &weights);
            squares += self.count[i] * *e * *e;
        }
        Some(Solved { capacitance, weights, error, squares })
    }

    /// Number of measured values less the rank of the common errors.
    fn freedom(&self) -> f64 {
        self.data.count() as f64 - self.gram.rows() as f64
    }
}

impl Likelihood for Noise {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.unknown
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let Some(solved) = self.solve(response, hyper[0]) else { return f64::NEG_INFINITY };
        let variance = hyper[0] * hyper[0];
        let determinant = self.freedom() * variance.ln() + solved.capacitance.log_determinant();
        let squares = solved.squares / variance + dot(&solved.weights, &solved.weights);
        -0.5 * (self.data.count() as f64 * TAU.ln() + determinant + squares)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let Some(solved) = self.solve(response, hyper[0]) else {
            return (vec![0.0; response.len()], vec![0.0]);
        };
        let variance = hyper[0] * hyper[0];
        let by_output = solved.error.iter().zip(&self.count).map(|(e, n)| n * e / variance);
        let inverse = solved.capacitance.inverse();
        let trace: f64 = (0..inverse.rows()).map(|k| inverse[(k, k)]).sum();
        let by_variance =
            -0.5 * (self.freedom() / variance + trace - solved.squares / variance.powi(2));
        (by_output.collect(), vec![2.0 * hyper[0] * by_variance])
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let own = vec![hyper[0] * hyper[0]; response.len()];
        let common = self.common.iter().filter(|error| error.predictive).map(|error| {
            let variance = error.factor.iter_rows().map(|row| dot(row, row)).collect();
            VariancePart { origin: error.origin.clone(), variance }
        });
        let own = VariancePart { origin: "discrepancy".into(), variance: own };
        std::iter::once(own).chain(common).collect()
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let mut rng = stream.named("common").generator();
        let weights: Vec<f64> = (0..self.factor.columns()).map(|_| normal(&mut rng)).collect();
        let centre: Vec<f64> = response
            .iter()
            .zip(self.factor.iter_rows())
            .map(|(y, f)| y + dot(f, &weights))
            .collect();
        let mut made = self.data.clone();
        for (r, replicate) in made.replicates.iter_mut().enumerate() {
            let mut rng = stream.named("replicate").at(r as u64).generator();
            for (value, y) in replicate.values.iter_mut().zip(&centre) {
                *value = value.map(|_| y + hyper[0] * normal(&mut rng));
            }
        }
        vec![made]
    }
}

lacuna::register!(Discrepancy, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Layout, Replicate, Unit};
    use lacuna::plugin::discrepancy::ErrorOrigin;

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::discrepancy("skeleton", &Skeleton::default()), Ok(()));
    }

    /// Two outputs, each measured twice, with a common error: the density of four normal numbers with covariance
    /// `s² I + f f'`, whose inverse and determinant have closed forms (Sherman and Morrison).
    #[test]
    fn with_one_common_error_it_is_the_density_written_out() {
        let axes = vec![Axis::grid("time", vec![0.0, 1.0], Unit::dimensionless())];
        let layout = Layout { axes, ..Layout::number("y") };
        let replicate = |values: [f64; 2]| Replicate::new("p", values.map(Some).to_vec());
        let replicates = vec![replicate([1.0, 2.5]), replicate([1.4, 2.0])];
        let data = Measurements::new(layout, replicates);
        let factor = Matrix::from_vec(2, 1, vec![0.3, -0.2]);
        let common = [CommonError {
            origin: ErrorOrigin::Emulator,
            factor: factor.into(),
            predictive: true,
        }];
        let built = Skeleton::default().likelihood(&Known::without_slopes(&data, &common)).unwrap();
        let (e, f, s) = ([0.1, 0.6, 0.5, 0.1], [0.3, -0.2, 0.3, -0.2], 0.4);
        let [ee, ef, ff] = [dot(&e, &e), dot(&e, &f), dot(&f, &f)];
        let quadratic = (ee - ef * ef / (s * s + ff)) / (s * s);
        let determinant = 3.0 * (s * s).ln() + (s * s + ff).ln();
        let expected = -0.5 * (4.0 * TAU.ln() + determinant + quadratic);
        let found = built.log_likelihood(&[0.9, 1.9], &[s]);
        assert!((found - expected).abs() < 1e-12, "{found} and {expected}");
    }
}
