//! Discrepancies: the statistical model of the difference between model and data.

use std::fmt;

use lacuna_base::data::measurements::Summary;
use lacuna_base::data::{Layout, Measurements, Parameter, Shared, Unit};
use lacuna_base::math::distribution::Distribution;
use lacuna_base::math::random::{Stream, normal};
use lacuna_base::matrix::vector::dot;
use lacuna_base::matrix::{Matrix, transposed_multiply_vector};
use lacuna_base::run::Stop;
use serde::{Deserialize, Serialize};

use super::forward::Linear;
use super::{Component, Fact};

/// A statistical model of the difference between model and data.
pub trait Discrepancy: Component {
    /// Builds the likelihood from the data and what is known about their errors.
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop>;

    /// The likelihood of a part of the known data (some values missing) under the distribution of all of them: whatever
    /// is estimated from the replicates is estimated from all. The log density of the missing values given the part is
    /// the difference of the two log-likelihoods. Hyperparameters keep their names; one that concerns only missing
    /// values may be absent. `None` if the discrepancy has no such form.
    fn likelihood_of_part(
        &self,
        _known: &Known<'_>,
        _part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        Ok(None)
    }

    /// Role of this discrepancy for a model whose response is random.
    fn stochastic_model(&self) -> StochasticModel {
        StochasticModel::Refused
    }

    /// Returns true if the likelihood uses the noise that the data themselves state ([`Measurements::states_noise`]);
    /// otherwise such data are rejected.
    fn takes_stated_noise(&self) -> bool {
        false
    }

    /// The noise of one replicate around a response of this layout, if the options fix its size: it has no unknowns and
    /// is not estimated from the replicates.
    fn stated_noise(&self, _layout: &Layout, _response: &[f64]) -> Option<StatedNoise> {
        None
    }
}

/// Role of a discrepancy for a model that is called directly and whose response is random.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StochasticModel {
    /// The likelihood is that of a response which the parameters determine.
    Refused,
    /// The likelihood may be a random number: it is a distance to data that are simulated.
    Taken,
    /// The likelihood is estimated from several runs of such a model, and has no use otherwise.
    Needed,
}

/// Noise of one replicate as stated by a study.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedNoise {
    /// Standard deviation of each output, in the response's unit.
    pub sd: Vec<f64>,
    /// Correlation time of each output: the time over which correlations along the last axis fall by a factor of e, in
    /// the unit of the axis; `None` for independent values.
    pub correlation_time: Option<Vec<f64>>,
}

/// Input of [`Discrepancy::likelihood`].
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// Measurements of one block.
    pub data: &'a Measurements,
    /// Errors common to all replicates (of the emulator, of the model's numerics, of the replicates' mean): their
    /// covariances are added once to the covariance of the mean curve and never divided by the number of replicates.
    pub common: &'a [CommonError],
    /// Derivative of each output by each parameter, `outputs x parameters`, per prior standard deviation of the
    /// parameter, where the model fits the data best; computed on demand.
    pub slopes: &'a dyn Fn() -> Result<Matrix, Stop>,
    /// Parameters of the columns of `slopes`, in their order; empty in a library of plugins, where they are not known.
    pub parameters: &'a [Parameter],
}

impl<'a> Known<'a> {
    /// Input from measurements and common errors, for callers that do not need slopes.
    pub fn without_slopes(data: &'a Measurements, common: &'a [CommonError]) -> Self {
        Self {
            data,
            common,
            slopes: &|| Err(Stop::new("the slopes of the model are not known")),
            parameters: &[],
        }
    }
}

/// An unknown of a discrepancy or an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hyperparameter {
    /// Name, unique in the study, such as `variance`.
    pub name: String,
    /// Symbol used in figures.
    pub symbol: String,
    /// Unit of the unknown.
    pub unit: Unit,
    /// Prior of the unknown.
    pub prior: Distribution,
    /// True if its logarithm is sampled (the prior keeps its meaning: the Jacobian is added).
    pub log: bool,
    /// Starting value.
    pub start: f64,
}

/// Origin of an error common to all replicates, or of a part of a new replicate's variance.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum ErrorOrigin {
    /// The emulator that replaces the model.
    Emulator,
    /// The model's numerics, such as its mesh or time step.
    Numerics,
    /// The finite number of replicates in the mean.
    Replicates,
    /// Any other origin, as a word.
    Other(String),
}

impl ErrorOrigin {
    /// Name of the origin in reports.
    pub fn as_str(&self) -> &str {
        match self {
            Self::Emulator => "emulator",
            Self::Numerics => "numerics",
            Self::Replicates => "replicates",
            Self::Other(name) => name,
        }
    }
}

impl From<String> for ErrorOrigin {
    fn from(name: String) -> Self {
        let known = [Self::Emulator, Self::Numerics, Self::Replicates];
        known.into_iter().find(|origin| origin.as_str() == name).unwrap_or(Self::Other(name))
    }
}

impl From<&str> for ErrorOrigin {
    fn from(name: &str) -> Self {
        Self::from(name.to_owned())
    }
}

impl From<ErrorOrigin> for String {
    fn from(origin: ErrorOrigin) -> Self {
        origin.to_string()
    }
}

impl fmt::Display for ErrorOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// An error common to all replicates, with covariance `F F'`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommonError {
    /// Origin of the error.
    pub origin: ErrorOrigin,
    /// Factor `F`, `outputs x rank`, in the response's unit.
    pub factor: Shared<Matrix>,
    /// True if a new replicate has this error too, in addition to what the discrepancy adds to a replicate.
    pub predictive: bool,
}

impl CommonError {
    /// Variance of each output, as a part of a new replicate's variance.
    pub fn part(&self) -> VariancePart {
        let variance = self.factor.iter_rows().map(|row| dot(row, row)).collect();
        VariancePart { origin: self.origin.clone(), variance }
    }

    /// One draw of the error.
    pub fn draw(&self, stream: &Stream) -> ErrorPath {
        let mut rng = stream.generator();
        let weights: Vec<f64> = (0..self.factor.columns()).map(|_| normal(&mut rng)).collect();
        let values = self.factor.iter_rows().map(|row| dot(row, &weights)).collect();
        ErrorPath { origin: self.origin.clone(), values }
    }

    /// A response with one draw of each error added.
    pub fn added(errors: &[Self], response: &[f64], stream: &Stream) -> Vec<f64> {
        let mut mean = response.to_vec();
        for (k, error) in errors.iter().enumerate() {
            let drawn = error.draw(&stream.named("common").at(k as u64));
            mean.iter_mut().zip(drawn.values).for_each(|(m, e)| *m += e);
        }
        mean
    }
}

/// The likelihood of fixed measurements as a function of the model's response.
pub trait Likelihood: Send + Sync {
    /// Unknowns of the likelihood besides the model's parameters.
    fn hyperparameters(&self) -> &[Hyperparameter];

    /// Log-likelihood of the data given the model's response (one value per output) and the hyperparameters; minus
    /// infinity outside their support.
    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64;

    /// Number of runs of the model with one set of parameters from which [`Likelihood::log_estimate`] estimates the
    /// likelihood.
    fn runs(&self) -> usize {
        1
    }

    /// Logarithm of the estimated likelihood, given the responses of [`Likelihood::runs`] runs of a stochastic model
    /// (`runs x outputs`, a row of NaN for a run without a response) and the hyperparameters. The estimate itself, not its
    /// logarithm, should be unbiased and not negative: a Markov chain that keeps the estimate of its current point then
    /// samples the posterior exactly (Andrieu and Roberts, Annals of Statistics 37 (2009) 697). By default the
    /// likelihood of the first run.
    fn log_estimate(&self, runs: &Matrix, hyper: &[f64]) -> f64 {
        self.log_likelihood(runs.row(0), hyper)
    }

    /// Log-likelihood for each row of `responses` (`points x outputs`) and `hyper` (`points x hyperparameters`): the
    /// same numbers as [`Likelihood::log_likelihood`].
    fn log_likelihoods(&self, responses: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let rows = responses.iter_rows().zip(hyper.iter_rows());
        rows.map(|(response, hyper)| self.log_likelihood(response, hyper)).collect()
    }

    /// Log density of each measured value given all others, by replicate and output without the missing ones (Bürkner,
    /// Gabry and Vehtari, Computational Statistics 36 (2021) 1243, for dependent values); `None` if the discrepancy has
    /// no such form.
    fn left_out(&self, _response: &[f64], _hyper: &[f64]) -> Option<Vec<f64>> {
        None
    }

    /// Some of the numbers of [`Likelihood::left_out`]: those with these indices, which increase.
    fn left_out_at(&self, response: &[f64], hyper: &[f64], data: &[usize]) -> Option<Vec<f64>> {
        let all = self.left_out(response, hyper)?;
        Some(data.iter().map(|&i| all.get(i).copied().unwrap_or(f64::NAN)).collect())
    }

    /// This likelihood for a part of its data, as [`Discrepancy::likelihood_of_part`] makes it from all that is known,
    /// but with whatever is the same for both: the same values and derivatives in a fraction of the time. `None` if there
    /// is nothing to save.
    fn of_part(&self, _part: &Measurements) -> Option<Box<dyn Likelihood>> {
        None
    }

    /// Derivatives of the log-likelihood by the response and by the hyperparameters.
    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>);

    /// True if value and gradient take a number of operations proportional to the number of data, so that they can be
    /// computed many times for each response of the model.
    fn is_cheap(&self) -> bool {
        false
    }

    /// This likelihood as a function of the basis functions of a linear emulator, at a cost that does not grow with the
    /// number of data; `None` if the discrepancy has no such form.
    fn compress(&self, _linear: &dyn Linear) -> Option<Box<dyn Compressed>> {
        None
    }

    /// Variance of each output of a new replicate around the model's response, split by origin.
    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart>;

    /// One draw of the errors of a new replicate around the model's response: one path for each part of
    /// [`Likelihood::predictive`], in its order, whose values have that variance (their mean square about the response).
    /// By default all values are independent and normal; a discrepancy that knows how they are correlated, or
    /// distributed, draws them so. The paths of one origin are the same whatever is done with the others.
    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let parts = self.predictive(response, hyper);
        let draw = |(k, part): (usize, &VariancePart)| part.independent(&stream.at(k as u64));
        parts.iter().enumerate().map(draw).collect()
    }

    /// Like [`Likelihood::errors`], with whatever the data say about an error that all replicates share, such as a bias of
    /// the model: drawn given the data, it corrects the response where it was measured. Outputs that were not measured
    /// and are independent of the measured ones have the errors of [`Likelihood::errors`]. `None` if the discrepancy has
    /// no such form.
    fn errors_given_data(
        &self,
        _response: &[f64],
        _hyper: &[f64],
        _stream: &Stream,
    ) -> Option<Vec<ErrorPath>> {
        None
    }

    /// Data simulated from this discrepancy: replicates and missing values as in the measurements, new values; one set
    /// per block of scenarios.
    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements>;

    /// Count, mean and scatter of each output of data simulated as by [`Likelihood::simulate`], drawn from their own
    /// distribution without the data; one list per block of scenarios. `None` if the discrepancy has no such form.
    fn simulate_summaries(
        &self,
        _response: &[f64],
        _hyper: &[f64],
        _stream: &Stream,
    ) -> Option<Vec<Vec<Summary>>> {
        None
    }

    /// Treatment of the common errors by a likelihood that samples some of their directions and omits the rest; `None`
    /// if it contains their whole covariance.
    fn sampled_errors(&self, _hyper: &[f64]) -> Option<SampledErrors> {
        None
    }

    /// Facts for the report.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    /// Reason why the likelihood can no longer be computed; from then on its values are meaningless. `None` while it
    /// works.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// Common errors of which a likelihood samples a part.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledErrors {
    /// Variance of the mean curve without common errors, one value per output; infinite where nothing was measured.
    pub noise: Vec<f64>,
    /// Factor of the errors that are sampled, `outputs x directions`.
    pub sampled: Matrix,
    /// Factor of the errors that are omitted, `outputs x any`.
    pub left_out: Matrix,
}

/// A part of the variance of a new replicate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VariancePart {
    /// Origin of the part: `measurement` (scatter between replicates), `model_form` (the rest of the discrepancy), or
    /// `discrepancy` if the two cannot be separated; `emulator` and other common errors.
    pub origin: ErrorOrigin,
    /// Variance of each output, in the squared unit of the response.
    pub variance: Vec<f64>,
}

impl VariancePart {
    /// One draw of an error with these variances whose values are independent and normal.
    pub fn independent(&self, stream: &Stream) -> ErrorPath {
        let mut rng = stream.generator();
        let values = self.variance.iter().map(|v| v.sqrt() * normal(&mut rng)).collect();
        ErrorPath { origin: self.origin.clone(), values }
    }
}

/// One draw of an error of a new replicate.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorPath {
    /// Origin of the error, as in [`VariancePart`].
    pub origin: ErrorOrigin,
    /// Error of each output, in the unit of the response.
    pub values: Vec<f64>,
}

/// A likelihood expressed in the basis functions of a linear emulator.
pub trait Compressed: Send + Sync {
    /// Log-likelihood for each row of `basis` (`points x terms`) and `hyper` (`points x hyperparameters`).
    fn log_likelihood(&self, basis: &Matrix, hyper: &Matrix) -> Vec<f64>;

    /// Like [`Compressed::log_likelihood`] at points in physical units (`points x parameters`), for the emulator that
    /// was compressed. Override it in an implementation that does not need all basis functions.
    fn log_likelihood_at(&self, linear: &dyn Linear, points: &Matrix, hyper: &Matrix) -> Vec<f64> {
        self.log_likelihood(&linear.basis(points), hyper)
    }

    /// Derivatives at one point by the basis functions and by the hyperparameters.
    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>);

    /// Derivatives at a point in physical units by the parameters and by the hyperparameters, for the emulator that was
    /// compressed.
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
