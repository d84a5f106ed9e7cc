//! Discrepancies: the statistical model of what separates model and data.

use serde::{Deserialize, Serialize};

use super::forward::Linear;
use super::{Component, Fact};
use crate::data::{Layout, Measurements, Unit};
use crate::linalg::{Matrix, transposed_multiply_vector};
use crate::math::distribution::Distribution;
use crate::math::random::Stream;
use crate::run::Stop;

/// A statistical model of the difference between model and data.
pub trait Discrepancy: Component {
    /// The likelihood of what is known.
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop>;

    /// The likelihood of a part of the known data, some of whose values are missing, under the law that stands for all of
    /// them: what is estimated from the replicates is so from all. The log density of the missing values given the part is
    /// the difference of the two log-likelihoods. Hyperparameters keep their names; one that belongs to missing values
    /// alone may be gone. `None` when the discrepancy has no such form.
    fn likelihood_of_part(
        &self,
        _known: &Known<'_>,
        _part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        Ok(None)
    }

    /// Whether the likelihood uses the noise that the data themselves state ([`Measurements::states_noise`]); where it does
    /// not, such data are refused.
    fn takes_stated_noise(&self) -> bool {
        false
    }

    /// The noise of one replicate around a response of this layout, where the options say how large it is: nothing of it
    /// is an unknown, and it does not come from the replicates.
    fn stated_noise(&self, _layout: &Layout, _response: &[f64]) -> Option<StatedNoise> {
        None
    }
}

/// The noise of one replicate as a study states it.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedNoise {
    /// The standard deviation of each output, in the response's unit.
    pub sd: Vec<f64>,
    /// The time over which correlations along the last axis fall by a factor e, one an output, in the axis's unit; `None`
    /// where values are independent.
    pub correlation_time: Option<Vec<f64>>,
}

/// What a likelihood is built from.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// The measurements.
    pub data: &'a Measurements,
    /// Errors that all replicates share (of the emulator, of the model's numerics, of the replicates' mean): their
    /// covariances are added once to the covariance of the mean curve, never divided by the number of
    /// replicates.
    pub common: &'a [CommonError],
    /// The derivative of each output (rows) by each parameter (columns), in units of the prior's standard
    /// deviation of that parameter, where the model fits the data best; computed when it is asked for.
    pub slopes: &'a dyn Fn() -> Result<Matrix, Stop>,
}

impl<'a> Known<'a> {
    /// Of measurements and common errors, for those who do not ask for slopes.
    pub fn without_slopes(data: &'a Measurements, common: &'a [CommonError]) -> Self {
        Self { data, common, slopes: &|| Err(Stop::new("the slopes of the model are not known")) }
    }
}

/// An unknown of a discrepancy or an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hyperparameter {
    /// Its name, unique in the study, such as `variance`.
    pub name: String,
    /// The symbol used in figures.
    pub symbol: String,
    /// Its unit.
    pub unit: Unit,
    /// Its prior.
    pub prior: Distribution,
    /// Whether it is sampled as its logarithm (the prior keeps its meaning: the Jacobian is added).
    pub log: bool,
    /// A value to start from.
    pub start: f64,
}

/// An error that all replicates share, as a covariance `F F'` of rank at most the number of columns of `F`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommonError {
    /// Where it comes from: `emulator`, `numerics`, `replicates`.
    pub origin: String,
    /// The factor `F`, `outputs x rank`, in the response's unit.
    pub factor: Matrix,
    /// Whether a new replicate has it too, beside what the discrepancy adds to a replicate.
    pub predictive: bool,
}

/// The likelihood of fixed measurements as a function of the model's response.
pub trait Likelihood: Send + Sync {
    /// The unknowns beside the model's parameters.
    fn hyperparameters(&self) -> &[Hyperparameter];

    /// The log-likelihood of the data given the model's response (one value an output) and the
    /// hyperparameters; minus infinity outside their support.
    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64;

    /// The log-likelihood for each row of the responses and of the hyperparameters: the same numbers as one by one.
    fn log_likelihoods(&self, responses: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let rows = responses.iter_rows().zip(hyper.iter_rows());
        rows.map(|(response, hyper)| self.log_likelihood(response, hyper)).collect()
    }

    /// The log density of each measured value given all others, by replicate and output with gaps left out
    /// (Bürkner, Gabry and Vehtari, Computational Statistics 36 (2021) 1243, for values that are not
    /// independent); `None` when the discrepancy has no such form.
    fn left_out(&self, _response: &[f64], _hyper: &[f64]) -> Option<Vec<f64>> {
        None
    }

    /// The derivatives of the log-likelihood by the response and by the hyperparameters.
    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>);

    /// The same likelihood as a function of the basis functions of a linear emulator, at the
    /// cost of the information and not of the data; `None` when the discrepancy has no such form.
    fn compress(&self, _linear: &dyn Linear) -> Option<Box<dyn Compressed>> {
        None
    }

    /// The covariance of one new replicate around the model's response: the variance of each output,
    /// split by origin.
    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart>;

    /// Data as this discrepancy would have made them: the gaps and replicates of the measurements, new values; one
    /// set a block of scenarios.
    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements>;

    /// What is worth telling.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    /// Why the likelihood can no longer be computed, once that has happened: its answers mean nothing then.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// A part of the variance of a new replicate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VariancePart {
    /// Its origin: `measurement` (what replicates show), `model_form` (the rest of the discrepancy), or `discrepancy`
    /// where the two cannot be told apart; `emulator` and other common errors.
    pub origin: String,
    /// One variance an output.
    pub variance: Vec<f64>,
}

/// A likelihood reduced to a small form in the basis functions of a linear emulator.
pub trait Compressed: Send + Sync {
    /// The log-likelihood for each row of `basis` (`points x terms`) and `hyper` (`points x hyperparameters`).
    fn log_likelihood(&self, basis: &Matrix, hyper: &Matrix) -> Vec<f64>;

    /// The same at points in physical units (one a row), for the emulator that was compressed: for
    /// those who can do with less than all basis functions.
    fn log_likelihood_at(&self, linear: &dyn Linear, points: &Matrix, hyper: &Matrix) -> Vec<f64> {
        self.log_likelihood(&linear.basis(points), hyper)
    }

    /// The derivatives at one point by the basis functions and by the hyperparameters.
    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>);

    /// The derivatives by the parameters at a point in physical units, and by the hyperparameters, for
    /// the emulator that was compressed.
    fn gradient_at(
        &self,
        linear: &dyn Linear,
        point: &[f64],
        hyper: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let basis = linear.basis(&Matrix::from_rows(point.len(), [point]));
        let (by_basis, by_hyper) = self.gradient(basis.row(0), hyper);
        (transposed_multiply_vector(&linear.basis_gradient(point), &by_basis), by_hyper)
    }
}
