//! Statistical model of the difference between data and model, block by block: the discrepancy with the common errors
//! of the study.

use std::ops::Range;
use std::sync::OnceLock;

use lacuna::data::{Measurements, Observations};
use lacuna::plugin::discrepancy::{self, CommonError, ErrorOrigin};
use lacuna::plugin::{Discrepancy, Forward, Likelihood};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::stage::common_error::Allowance;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::Measured;
use crate::stage::{best_fit, replicate_error};
use crate::study::Study;

/// Discrepancy and common errors of a study; see the module.
pub struct Law<'a> {
    study: &'a Study,
    data: &'a Observations,
    /// Replicates from which the error of their mean is estimated, if the study includes it.
    replicates: Option<&'a Observations>,
    forward: &'a dyn Forward,
    plugin: &'a dyn Discrepancy,
    common: Vec<&'a CommonError>,
    /// Response at the best fit, if the error of the replicates' mean needs it.
    fitted: Option<Vec<f64>>,
    slopes: OnceLock<Result<Matrix, Stop>>,
}

impl<'a> Law<'a> {
    /// For the study's measurements, with the common errors that the study includes, enlarged for estimates.
    pub fn of(
        study: &'a Study,
        measured: &'a Measured,
        problem: &'a InverseProblem<'_>,
    ) -> Result<Self, Stop> {
        Self::with(study, measured, problem, |error| &error.estimates)
    }

    /// Like [`Self::of`], but with errors at their actual size, for predictions of data.
    pub fn predicting(
        study: &'a Study,
        measured: &'a Measured,
        problem: &'a InverseProblem<'_>,
    ) -> Result<Self, Stop> {
        Self::with(study, measured, problem, |error| &error.predictions)
    }

    fn with(
        study: &'a Study,
        measured: &'a Measured,
        problem: &'a InverseProblem<'_>,
        size: fn(&Allowance) -> &CommonError,
    ) -> Result<Self, Stop> {
        let section =
            study.discrepancy.as_ref().ok_or_else(|| Stop::new("the study has no discrepancy"))?;
        let errors = problem.allowances(study, &section.common, &measured.likelihood)?;
        let common = errors.iter().map(size).collect();
        // Replicates of a stochastic model scatter about no common curve.
        let stochastic = problem.forward().is_stochastic();
        let included = section.common.replicate_error && !stochastic;
        let replicates = included.then_some(&measured.used);
        let fitted = if replicate_error::needs_best_fit(study, measured) {
            problem.best_fit(study, &measured.likelihood)?.response.clone()
        } else {
            None
        };
        Ok(Self {
            replicates,
            common,
            fitted,
            ..Self::bare(study, &measured.likelihood, problem.forward())?
        })
    }

    /// For data without any common error: the discrepancy alone.
    pub fn bare(
        study: &'a Study,
        data: &'a Observations,
        forward: &'a dyn Forward,
    ) -> Result<Self, Stop> {
        let section =
            study.discrepancy.as_ref().ok_or_else(|| Stop::new("the study has no discrepancy"))?;
        Ok(Self {
            study,
            data,
            replicates: None,
            forward,
            plugin: &*section.built.plugin,
            common: Vec::new(),
            fitted: None,
            slopes: OnceLock::new(),
        })
    }

    /// Common errors of all blocks together, without that of the replicates' mean.
    pub fn common(&self) -> &[&'a CommonError] {
        &self.common
    }

    /// Likelihood of a block of scenarios.
    pub fn block(&self, i: usize) -> Result<Box<dyn Likelihood>, Stop> {
        self.with_known(i, |problem| self.plugin.likelihood(problem))
    }

    /// Common errors of a block of scenarios, including that of the replicates' mean.
    pub fn errors(&self, i: usize) -> Result<Vec<CommonError>, Stop> {
        self.with_known(i, |problem| Ok(problem.common.to_vec()))
    }

    /// Likelihood of a part of a block's data, in which some values are missing; `None` if the discrepancy has no such
    /// form.
    pub fn part(&self, i: usize, part: &Measurements) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        self.with_known(i, |problem| self.plugin.likelihood_of_part(problem, part))
    }

    fn with_known<T>(
        &self,
        i: usize,
        make: impl FnOnce(&discrepancy::Known<'_>) -> Result<T, Stop>,
    ) -> Result<T, Stop> {
        let range = self.study.layouts.ranges().nth(i).unwrap_or_default();
        let part = |mut error: CommonError| {
            if range.len() < error.factor.rows() {
                error.factor = rows(&error.factor, range.clone()).into();
            }
            error
        };
        let mut own: Vec<CommonError> = self.common.iter().copied().cloned().map(part).collect();
        // A stated covariance already contains the correlation within a replicate.
        let shared = |replicates: &&Observations| replicates.blocks[i].covariance.is_none();
        if let Some(replicates) = self.replicates.filter(shared) {
            let fitted = self.fitted.as_ref().map(|all| &all[range.clone()]);
            let of_replicates = replicate_error::of_replicates(&replicates.blocks[i], fitted);
            let after = usize::from(own.first().is_some_and(|e| e.origin == ErrorOrigin::Emulator));
            own.splice(after..after, of_replicates);
        }
        let slopes = || {
            let made = || best_fit::slopes(self.study, self.data, self.forward);
            Ok(rows(self.slopes.get_or_init(made).as_ref().map_err(Clone::clone)?, range.clone()))
        };
        let data = &self.data.blocks[i];
        let parameters = &self.study.parameters;
        make(&discrepancy::Known { data, common: &own, slopes: &slopes, parameters })
    }
}

/// A range of rows of a matrix.
fn rows(matrix: &Matrix, range: Range<usize>) -> Matrix {
    matrix.select_rows(&range.collect::<Vec<_>>())
}
