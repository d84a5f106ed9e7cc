//! Emulator of a model, fitted to runs, with its errors and the measurements.

use std::sync::Arc;

use lacuna::plugin::{Emulator, Forward};
use lacuna::run::{Stop, files};
use lacuna_run::Kept;
use serde_json::json;

use super::inverse_problem::{Derived, InverseProblem, Route, Trial};
use super::numerical_error::NumericalError;
use super::read::Data;
use super::refine::Refinement;
use super::surrogate::Fitted;
use crate::study::Study;

/// An emulator of the model with the runs that it was fitted to and the data that it is compared with.
pub struct Emulated {
    /// Runs and measurements. They stay as they are, because the problems made of this share what follows from them.
    pub(crate) data: Kept<Data>,
    /// Fitted surrogate with its errors.
    pub fitted: Kept<Fitted>,
    /// Numerical error of the model, if the study requests it.
    pub numerics: Option<Kept<NumericalError>>,
    /// The emulator.
    pub emulator: Box<dyn Emulator>,
    /// The emulator with the predicted numerical error added, if any is predicted.
    pub corrected: Option<Box<dyn Emulator>>,
    /// Hash of everything the forward map depends on.
    pub origin: String,
    /// Region of the fit; see [`InverseProblem::region`].
    pub region: Option<Vec<(f64, f64)>>,
    /// State of the refinement, if the study requests one.
    pub refinement: Option<Refinement>,
    /// Trial that the data belong to; see [`InverseProblem::trial`].
    pub trial: Option<Trial>,
    /// Results for the data, shared by the problems that are made of this.
    derived: Arc<Derived>,
}

impl Emulated {
    /// Combines a study's runs, the emulator fitted to them and the model's numerical error.
    pub fn new(
        study: &Study,
        data: Kept<Data>,
        (fitted, emulator): (Kept<Fitted>, Box<dyn Emulator>),
        numerics: Option<Kept<NumericalError>>,
        trial: Option<Trial>,
    ) -> Result<Self, Stop> {
        let corrected = match &numerics {
            Some(numerics) => numerics.value.corrected(study, &fitted.value)?,
            None => None,
        };
        let section = study.numerical_error.as_ref();
        let origin = match (&corrected, &numerics, section) {
            (Some(_), Some(numerics), Some(section)) => {
                let of = json!([fitted.hash, numerics.hash, section.written.whole()]);
                files::hash(of.to_string().as_bytes())
            }
            _ => fitted.hash.clone(),
        };
        let (region, refinement) = (None, None);
        let derived = Arc::default();
        Ok(Self {
            data,
            fitted,
            numerics,
            emulator,
            corrected,
            origin,
            region,
            refinement,
            trial,
            derived,
        })
    }

    /// Runs and measurements. Other measurements need a problem of their own, by [`InverseProblem::new`].
    pub fn data(&self) -> &Kept<Data> {
        &self.data
    }

    /// The emulator, including the predicted numerical error.
    pub fn forward(&self) -> &dyn Forward {
        self.corrected.as_deref().map_or(&*self.emulator as &dyn Forward, |c| c)
    }

    /// The data with this emulator as the forward map.
    pub fn problem(&self) -> InverseProblem<'_> {
        InverseProblem::new(&self.data, Route::Emulated(self), self.trial).sharing(&self.derived)
    }
}
