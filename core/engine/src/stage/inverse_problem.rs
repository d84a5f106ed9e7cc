//! Inverse problem that calibration solves: data, forward map, and the errors of that map.

use std::sync::{Arc, OnceLock};

use lacuna::data::Observations;
use lacuna::math::random::Stream;
use lacuna::plugin::{Emulator, Forward, Likelihood};
use lacuna::run::Stop;
use lacuna_run::Kept;

use super::best_fit::{self, BestFit, Fit};
use super::common_error::Allowance;
use super::direct::Direct;
use super::emulated::Emulated;
use super::numerical_error::NumericalError;
use super::read::Data;
use super::refine::Refinement;
use super::surrogate::Fitted;
use super::{emulator_error, stream};
use crate::study::Study;
use crate::study::file::DiscrepancyKeys;

/// Type of the forward map.
#[derive(Clone, Copy)]
pub enum Route<'a> {
    /// An emulator of the model, with estimates of its errors.
    Emulated(&'a Emulated),
    /// The model itself.
    Direct(&'a Direct<'a>),
}

/// A likelihood, or why there is none.
type Made = Result<Arc<dyn Likelihood>, Stop>;

/// Results that follow from the data and the forward map, each computed on first use.
#[derive(Default)]
pub struct Derived {
    /// Errors of emulator and numerics for these data.
    allowances: OnceLock<Vec<Allowance>>,
    /// Least-squares best fit to these data.
    best_fit: OnceLock<BestFit>,
    /// Likelihood of these data.
    likelihood: OnceLock<Arc<dyn Likelihood>>,
    /// Likelihood of these data with which data are predicted.
    predictive: OnceLock<Arc<dyn Likelihood>>,
}

/// Data, and a forward map from parameters to responses.
pub struct InverseProblem<'a> {
    /// Runs and measurements.
    pub data: &'a Kept<Data>,
    /// Forward map.
    pub route: Route<'a>,
    /// Trial that the data belong to, if they were generated and not measured.
    pub trial: Option<Trial>,
    /// Results for these data, which all problems of the same data and map share.
    derived: Arc<Derived>,
}

impl<'a> InverseProblem<'a> {
    /// Combines data and a forward map; `trial` is set if the data were generated.
    pub fn new(data: &'a Kept<Data>, route: Route<'a>, trial: Option<Trial>) -> Self {
        Self { data, route, trial, derived: Arc::default() }
    }

    /// The same problem with the results that others of the same data and map have computed.
    pub fn sharing(self, derived: &Arc<Derived>) -> Self {
        Self { derived: derived.clone(), ..self }
    }

    /// The forward map: the emulator, including the predicted numerical error, or the model itself.
    pub fn forward(&self) -> &'a dyn Forward {
        match self.route {
            Route::Emulated(by) => by.forward(),
            Route::Direct(by) => &by.forward,
        }
    }

    /// Hash of everything the forward map depends on.
    pub fn origin(&self) -> &'a str {
        match self.route {
            Route::Emulated(by) => &by.origin,
            Route::Direct(by) => &by.origin,
        }
    }

    /// The emulator and its errors, in a study with a surrogate.
    pub fn emulated(&self) -> Option<&'a Emulated> {
        match self.route {
            Route::Emulated(by) => Some(by),
            Route::Direct(_) => None,
        }
    }

    /// The fitted surrogate with its errors, in a study with a surrogate.
    pub fn fitted(&self) -> Option<&'a Kept<Fitted>> {
        self.emulated().map(|by| &by.fitted)
    }

    /// The emulator of the model as it was run, in a study with a surrogate.
    pub fn emulator(&self) -> Option<&'a dyn Emulator> {
        self.emulated().map(|by| &*by.emulator)
    }

    /// The model's numerical error, if the study requests it.
    pub fn numerics(&self) -> Option<&'a Kept<NumericalError>> {
        self.emulated()?.numerics.as_ref()
    }

    /// Interval of each parameter in which the emulator was fitted, if narrower than the design.
    pub fn region(&self) -> Option<&'a [(f64, f64)]> {
        self.emulated()?.region.as_deref()
    }

    /// State of the refinement, if the study requests one.
    pub fn refinement(&self) -> Option<&'a Refinement> {
        self.emulated()?.refinement.as_ref()
    }

    /// The same problem with a best fit that is known.
    pub fn with_best_fit(self, known: Option<&BestFit>) -> Self {
        let best_fit = known.map_or_else(OnceLock::new, |fitted| OnceLock::from(fitted.clone()));
        Self { derived: Arc::new(Derived { best_fit, ..Derived::default() }), ..self }
    }

    /// Least-squares best fit to these data.
    pub(super) fn best_fit(&self, study: &Study, data: &Observations) -> Result<&BestFit, Stop> {
        once(&self.derived.best_fit, || best_fit::fitted(study, data, self.forward()))
    }

    /// Likelihood of these data, made on first use: the decomposition of common errors takes most of a second for a
    /// thousand outputs.
    pub(super) fn likelihood(&self, make: impl FnOnce() -> Made) -> Made {
        once(&self.derived.likelihood, make).cloned()
    }

    /// Likelihood of these data with which data are predicted, made on first use.
    pub(super) fn predictive(&self, make: impl FnOnce() -> Made) -> Made {
        once(&self.derived.predictive, make).cloned()
    }

    /// Errors of emulator and numerics that the study's likelihood includes, for these data.
    pub(super) fn allowances(
        &self,
        study: &Study,
        keys: &DiscrepancyKeys,
        data: &Observations,
    ) -> Result<&[Allowance], Stop> {
        once(&self.derived.allowances, || {
            let (mut found, forward) = (Vec::new(), self.forward());
            if let (Some(fitted), true) = (self.fitted(), keys.emulator_error) {
                let best = self.best_fit(study, data)?;
                let fit = Fit { data, forward, point: &best.point };
                found.push(emulator_error::allowance(study, &fitted.value, fit)?);
            }
            if let (Some(kept), Some(section)) = (self.numerics(), &study.numerical_error) {
                let best = self.best_fit(study, data)?;
                let fit = Fit { data, forward, point: &best.point };
                found.push(kept.value.allowance(study, &section.written, fit)?);
            }
            Ok(found)
        })
        .map(Vec::as_slice)
    }
}

/// The kept result, made on first use; a failure is not kept. `make` runs outside of the lock: it may use the threads of
/// others that wait for the same result.
fn once<T>(kept: &OnceLock<T>, make: impl FnOnce() -> Result<T, Stop>) -> Result<&T, Stop> {
    if let Some(found) = kept.get() {
        return Ok(found);
    }
    let made = make()?;
    Ok(kept.get_or_init(|| made))
}

/// One of many calibrations of generated data, with its own random streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trial {
    /// Number of the trial.
    pub number: u64,
    /// True if the chains have half of their steps, for samplers whose steps are draws.
    pub quick: bool,
}

impl Trial {
    /// Random stream of a stage: that of the study itself outside of trials.
    pub(super) fn stream(trial: Option<Self>, study: &Study, stage: &str) -> Stream {
        match trial {
            None => stream(study, stage),
            Some(trial) => stream(study, "trial").at(trial.number).named(stage),
        }
    }
}
