//! Least-squares best fit of the model, before any discrepancy is chosen, and the derivatives of the response there.

use std::path::Path;

use lacuna::data::{JointPrior, Measurements, Observations, Parameter};
use lacuna::math::random::Stream;
use lacuna::plugin::Forward;
use lacuna::plugin::discrepancy::{Hyperparameter, Likelihood, VariancePart};
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::start::maxima;
use super::stream;
use crate::posterior::{OfData, Posterior};
use crate::study::Study;

/// A best fit to data.
#[derive(Clone, Copy)]
pub struct Fit<'a> {
    /// Data.
    pub data: &'a Observations,
    /// Forward map.
    pub forward: &'a dyn Forward,
    /// Parameters of the best fit.
    pub point: &'a [f64],
}

/// A best fit with the response there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BestFit {
    /// Parameters of the best fit.
    pub point: Vec<f64>,
    /// Response; `None` if the model has none there.
    pub response: Option<Vec<f64>>,
}

const FIT: &str = "fit.json";

impl Artifact for BestFit {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(FIT), self)?;
        Ok(vec![FIT.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join(FIT))
    }
}

/// The best fit to some data, as [`point`] finds it.
pub fn fitted(study: &Study, data: &Observations, forward: &dyn Forward) -> Result<BestFit, Stop> {
    let found = point(study, data, forward);
    if let Some(reason) = forward.failure() {
        return Err(Stop::new(reason));
    }
    let point = found?;
    let there = forward.mean(&Matrix::from_vec(1, point.len(), point.clone())).into_vec();
    let is_finite = there.iter().all(|y| y.is_finite());
    Ok(BestFit { point, response: is_finite.then_some(there) })
}

/// The best fit of a study whose model takes the place of an emulator: it is kept, because it takes runs of the model.
pub fn stage(
    study: &Study,
    (data, forward): (&Observations, &dyn Forward),
    inputs: &Value,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<BestFit>, Stop> {
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.prior)).collect();
    let inputs =
        json!([inputs, study.prior_identity(json!(laws)), &study.starts, study.about.seed]);
    run.keep(&Stage::Calibrate.part("best-fit"), &inputs, observer, |_| {
        fitted(study, data, forward)
    })
}

/// Parameters that maximise prior times `|y - m|^-N`: the normal likelihood of independent data with its unknown
/// variance integrated out under the prior `1 / variance`.
pub fn point(study: &Study, data: &Observations, forward: &dyn Forward) -> Result<Vec<f64>, Stop> {
    let stream = stream(study, "best-fit");
    Ok(points_from(study.prior(), &study.start(), data, forward, &stream)?.remove(0))
}

/// Like [`point`], but all local maxima, the best first.
pub fn points(
    prior: JointPrior<'_>,
    data: &Observations,
    forward: &dyn Forward,
    stream: &Stream,
) -> Result<Vec<Vec<f64>>, Stop> {
    points_from(prior, &[], data, forward, stream)
}

/// Like [`points`], with the starting values that are stated.
fn points_from(
    prior: JointPrior<'_>,
    stated: &[Option<f64>],
    data: &Observations,
    forward: &dyn Forward,
    stream: &Stream,
) -> Result<Vec<Vec<f64>>, Stop> {
    let likelihood = LeastSquares::of(data)?;
    let posterior = Posterior::new(prior, OfData::new(forward, Vec::new(), &likelihood));
    let found = maxima(&posterior, stated, stream)?.into_iter();
    Ok(found.map(|maximum| posterior.natural(&maximum.point)).collect())
}

/// Derivative of each output by each parameter at [`point`], per prior standard deviation (`outputs x parameters`).
pub fn slopes(study: &Study, data: &Observations, forward: &dyn Forward) -> Result<Matrix, Stop> {
    Ok(standard_slopes(study, forward, &point(study, data, forward)?))
}

/// Derivative of each output by each parameter at a point, per prior standard deviation (`outputs x parameters`).
pub fn standard_slopes(study: &Study, forward: &dyn Forward, point: &[f64]) -> Matrix {
    let jacobian = forward.jacobian(point);
    let sd: Vec<f64> = study.parameters.iter().map(Parameter::scale).collect();
    Matrix::from_fn(jacobian.rows(), jacobian.columns(), |i, j| jacobian[(i, j)] * sd[j])
}

/// Likelihood of independent normal data whose common variance is integrated out.
struct LeastSquares<'a> {
    data: &'a Observations,
    /// Number of replicates and their mean, for each output.
    outputs: Vec<(f64, f64)>,
    scatter: f64,
    count: f64,
}

impl<'a> LeastSquares<'a> {
    fn of(data: &'a Observations) -> Result<Self, Stop> {
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

    fn is_cheap(&self) -> bool {
        true
    }

    fn predictive(&self, _response: &[f64], _hyper: &[f64]) -> Vec<VariancePart> {
        Vec::new()
    }

    /// Data without noise, because the size of the noise is not a parameter of this likelihood.
    fn simulate(&self, response: &[f64], _hyper: &[f64], _stream: &Stream) -> Vec<Measurements> {
        let layouts = self.data.layouts();
        let exact = |(block, range): (&Measurements, std::ops::Range<usize>)| {
            let mut block = block.clone();
            for replicate in &mut block.replicates {
                for (value, y) in replicate.values.iter_mut().zip(&response[range.clone()]) {
                    *value = value.map(|_| *y);
                }
            }
            block
        };
        self.data.blocks.iter().zip(layouts.ranges()).map(exact).collect()
    }
}
