//! What stands for the difference of data and model, block by block: the discrepancy with the common errors of the study.

use std::ops::Range;
use std::sync::OnceLock;

use crate::data::{Measurements, Observations};
use crate::linalg::Matrix;
use crate::plugin::discrepancy::{self, CommonError};
use crate::plugin::{Discrepancy, Forward, Likelihood};
use crate::run::Stop;
use crate::stage::common_error::Allowance;
use crate::stage::read::Measured;
use crate::stage::{Known, best_fit, common_error};
use crate::study::Study;

/// See the module.
pub struct Law<'a> {
    study: &'a Study,
    data: &'a Observations,
    /// The replicates from which the error of their mean is known, where the study wants it.
    replicates: Option<&'a Observations>,
    forward: &'a dyn Forward,
    plugin: &'a dyn Discrepancy,
    common: Vec<CommonError>,
    slopes: OnceLock<Result<Matrix, Stop>>,
}

impl<'a> Law<'a> {
    /// That of the study's measurements, with the common errors that the study wants, as estimates allow for them.
    pub fn of(study: &'a Study, measured: &'a Measured, known: &Known<'a>) -> Result<Self, Stop> {
        Self::with(study, measured, known, |error| &error.estimates)
    }

    /// The same with errors as large as they are themselves: what predicts data.
    pub fn predicting(
        study: &'a Study,
        measured: &'a Measured,
        known: &Known<'a>,
    ) -> Result<Self, Stop> {
        Self::with(study, measured, known, |error| &error.predictions)
    }

    fn with(
        study: &'a Study,
        measured: &'a Measured,
        known: &Known<'a>,
        size: fn(&Allowance) -> &CommonError,
    ) -> Result<Self, Stop> {
        let section =
            study.discrepancy.as_ref().ok_or_else(|| Stop::new("the study has no discrepancy"))?;
        let errors = known.allowances(study, &section.common, &measured.likelihood)?;
        let common = errors.iter().map(|error| size(error).clone()).collect();
        let replicates = section.common.replicate_error.then_some(&measured.used);
        Ok(Self { replicates, common, ..Self::bare(study, &measured.likelihood, known.forward)? })
    }

    /// That of data without any common error: the discrepancy alone.
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
            slopes: OnceLock::new(),
        })
    }

    /// The likelihood of a block of scenarios.
    pub fn block(&self, i: usize) -> Result<Box<dyn Likelihood>, Stop> {
        self.with_known(i, |known| self.plugin.likelihood(known))
    }

    /// The likelihood of a part of a block's data, some of whose values are missing; `None` where the discrepancy has no
    /// such form.
    pub fn part(&self, i: usize, part: &Measurements) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        self.with_known(i, |known| self.plugin.likelihood_of_part(known, part))
    }

    fn with_known<T>(
        &self,
        i: usize,
        make: impl FnOnce(&discrepancy::Known<'_>) -> Result<T, Stop>,
    ) -> Result<T, Stop> {
        let range = self.study.layouts.ranges().nth(i).unwrap_or_default();
        let part = |error: &CommonError| CommonError {
            factor: rows(&error.factor, range.clone()),
            ..error.clone()
        };
        let mut own: Vec<CommonError> = self.common.iter().map(part).collect();
        // A stated covariance already says what the points of a replicate share.
        let shared = |replicates: &&Observations| replicates.blocks[i].covariance.is_none();
        if let Some(replicates) = self.replicates.filter(shared) {
            let of_replicates = common_error::of_replicates(&replicates.blocks[i]);
            let after = usize::from(own.first().is_some_and(|e| e.origin == "emulator"));
            own.splice(after..after, of_replicates);
        }
        let slopes = || {
            let made = || best_fit::slopes(self.study, self.data, self.forward);
            Ok(rows(self.slopes.get_or_init(made).as_ref().map_err(Clone::clone)?, range.clone()))
        };
        let data = &self.data.blocks[i];
        make(&discrepancy::Known { data, common: &own, slopes: &slopes })
    }
}

/// Some rows of a matrix.
fn rows(matrix: &Matrix, range: Range<usize>) -> Matrix {
    matrix.select_rows(&range.collect::<Vec<_>>())
}
