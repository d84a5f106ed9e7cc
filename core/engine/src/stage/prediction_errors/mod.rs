//! Errors of a prediction: draws for a new replicate, correlated over all outputs, and those of emulator and numerics as
//! functions of standard normal variables.

mod given;
mod variables;

use std::ops::Range;

use lacuna::data::Shared;
use lacuna::math::random::Stream;
use lacuna::plugin::Likelihood;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, ErrorPath};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use self::given::GivenData;
pub use self::variables::ErrorVariables;
use crate::stage::calibrate::{Law, Parts};
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::Measured;
use crate::stage::{emulator_error, predict};
use crate::study::Study;

/// Errors of a new replicate.
pub enum Errors {
    /// Errors of emulator and numerics without data, or none.
    Prior(Vec<CommonError>),
    /// Those of a discrepancy that samples a part of the common errors, and the common errors from their prior: their
    /// weights were sampled at another size.
    Sampled { law: Parts, common: Vec<CommonError> },
    /// Those of the discrepancy, and the common errors as the data know them.
    Given(Box<Given>),
}

/// Errors given the data. The common errors are drawn for all blocks of scenarios together, because a discrepancy may not
/// know their correlation; then the errors of the discrepancy alone are drawn around the response with the common errors.
pub struct Given {
    /// Likelihood of the data with the common errors.
    whole: Parts,
    /// Likelihood without the common errors.
    alone: Parts,
    weights: GivenData,
    /// Origin and columns of each common error that a new replicate has too.
    predictive: Vec<(ErrorOrigin, Range<usize>)>,
}

impl Errors {
    /// Errors under the discrepancy of a study with data.
    pub fn of(
        study: &Study,
        measured: &Measured,
        problem: &InverseProblem<'_>,
        map: &[f64],
    ) -> Result<Self, Stop> {
        let law = Law::predicting(study, measured, problem)?;
        let whole = Parts::predicting(study, measured, problem)?;
        let alone = Parts::bare(study, &measured.likelihood, problem.forward())?;
        let unknowns = |parts: &Parts| parts.likelihood().hyperparameters().len();
        let (count, own) = (unknowns(&whole), unknowns(&alone));
        let all = law.common().iter().copied();
        let common: Vec<CommonError> = all.filter(|error| error.predictive).cloned().collect();
        let mut predictive = Vec::new();
        let mut columns = 0..0;
        for error in &common {
            columns = columns.end..columns.end + error.factor.columns();
            predictive.push((error.origin.clone(), columns.clone()));
        }
        let factor = factor_of_all(study, &law, &common)?;
        let ranges = study.layouts.ranges();
        let point = Matrix::from_vec(1, map.len(), map.to_vec());
        let at_map = &predict::responses(study, problem.forward(), &point)[0];
        let there = (&at_map[..], hyper(whole.likelihood(), map));
        let weights = (count == own)
            .then(|| GivenData::new(factor, ranges, whole.likelihood(), there))
            .flatten();
        Ok(match weights {
            Some(weights) => Self::Given(Box::new(Given { whole, alone, weights, predictive })),
            None => Self::Sampled { law: whole, common },
        })
    }

    /// Errors of emulator and numerics where nothing was measured, with their mean size over the prior.
    pub fn of_priors(study: &Study, problem: &InverseProblem<'_>) -> Result<Self, Stop> {
        let mut common = Vec::new();
        if let Some(fitted) = problem.fitted() {
            common.push(emulator_error::over_prior(study, &fitted.value)?);
        }
        if let (Some(kept), Some(section)) = (problem.numerics(), &study.numerical_error) {
            common.push(kept.value.error_samples(&section.written));
        }
        Ok(Self::Prior(common))
    }

    /// No errors.
    pub fn none() -> Self {
        Self::Prior(Vec::new())
    }

    /// Returns true if there are no errors.
    pub fn is_none(&self) -> bool {
        matches!(self, Self::Prior(common) if common.is_empty())
    }

    /// Number of errors of emulator and numerics.
    pub fn count(&self) -> usize {
        match self {
            Self::Prior(common) | Self::Sampled { common, .. } => common.len(),
            Self::Given(given) => given.predictive.len(),
        }
    }

    /// One draw of all errors around the response at a point of the posterior.
    pub fn draw(&self, response: &[f64], point: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        match self {
            Self::Prior(common) => drawn(common, stream).collect(),
            Self::Sampled { law, common } => {
                let mut paths = of_discrepancy(law.likelihood(), response, point, stream);
                paths.retain(|path| common.iter().all(|error| error.origin != path.origin));
                paths.extend(drawn(common, stream));
                paths
            }
            Self::Given(given) => given.draw(response, point, stream),
        }
    }
}

impl Given {
    fn draw(&self, response: &[f64], point: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let whole = self.whole.likelihood();
        let (gradient, _) = whole.gradient(response, hyper(whole, point));
        let weights = self.weights.draw(&gradient, &stream.named("common"));
        let common = self.weights.values(&weights, 0..weights.len());
        let shifted: Vec<f64> = response.iter().zip(&common).map(|(r, e)| r + e).collect();
        let mut paths = of_discrepancy(self.alone.likelihood(), &shifted, point, stream);
        paths.extend(self.predictive.iter().map(|(origin, columns)| ErrorPath {
            origin: origin.clone(),
            values: self.weights.values(&weights, columns.clone()),
        }));
        paths
    }
}

/// Hyperparameters of a point.
fn hyper<'p>(likelihood: &dyn Likelihood, point: &'p [f64]) -> &'p [f64] {
    &point[point.len() - likelihood.hyperparameters().len()..]
}

fn of_discrepancy(
    likelihood: &dyn Likelihood,
    response: &[f64],
    point: &[f64],
    stream: &Stream,
) -> Vec<ErrorPath> {
    let hyper = hyper(likelihood, point);
    let stream = stream.named("discrepancy");
    likelihood
        .errors_given_data(response, hyper, &stream)
        .unwrap_or_else(|| likelihood.errors(response, hyper, &stream))
}

/// One draw of each error from its prior.
fn drawn(common: &[CommonError], stream: &Stream) -> impl Iterator<Item = ErrorPath> {
    let stream = stream.named("common");
    common.iter().enumerate().map(move |(k, error)| error.draw(&stream.at(k as u64)))
}

/// Factor of all common errors side by side, `outputs x weights`: those of all blocks together, then the errors of the mean
/// of the replicates, which are independent between blocks.
fn factor_of_all(study: &Study, law: &Law<'_>, common: &[CommonError]) -> Result<Matrix, Stop> {
    let mut parts: Vec<(usize, Shared<Matrix>)> =
        common.iter().map(|error| (0, error.factor.clone())).collect();
    for (b, outputs) in study.layouts.ranges().enumerate() {
        let own = law.errors(b)?.into_iter().filter(|error| !error.predictive);
        parts.extend(own.map(|error| (outputs.start, error.factor)));
    }
    let columns = parts.iter().map(|(_, factor)| factor.columns()).sum();
    let mut all = Matrix::zeros(study.layouts.len(), columns);
    let mut left = 0;
    for (first, factor) in parts {
        for (i, row) in factor.iter_rows().enumerate() {
            all.row_mut(first + i)[left..left + row.len()].copy_from_slice(row);
        }
        left += factor.columns();
    }
    Ok(all)
}
