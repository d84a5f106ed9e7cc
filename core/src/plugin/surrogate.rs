//! Surrogates: from runs to an emulator that knows its own error.

use serde::{Deserialize, Serialize};

use super::{Component, Fact, Forward};
use crate::data::{Layouts, Parameter};
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::run::{Progress, Stop};

/// Fits an emulator to simulation runs.
pub trait Surrogate: Component {
    /// Fits an emulator to all outputs.
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop>;

    /// An emulator from what [`Emulator::save`] wrote.
    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop>;

    /// The sum of emulators that this surrogate fitted, each output of each times its weight, plus an offset for each output:
    /// as one emulator of the same form. `None` where the method has no such form, or these emulators do not go together.
    ///
    /// It is asked for the response and its sensitivity only: what it says of its errors means nothing.
    fn sum(
        &self,
        _parts: &[Summand<'_>],
        _offset: &[f64],
    ) -> Result<Option<Box<dyn Emulator>>, Stop> {
        Ok(None)
    }
}

/// A part of a sum of emulators.
#[derive(Debug, Clone, Copy)]
pub struct Summand<'a> {
    /// What [`Emulator::save`] wrote.
    pub bytes: &'a [u8],
    /// One weight an output.
    pub weights: &'a [f64],
}

/// The runs to which a surrogate is fitted.
#[derive(Debug, Clone, Copy)]
pub struct Training<'a> {
    /// The parameters with their design distributions.
    pub parameters: &'a [Parameter],
    /// The shapes of the responses of one run.
    pub layouts: &'a Layouts,
    /// The parameters of each run in physical units, `runs x parameters`.
    pub points: &'a Matrix,
    /// The responses, `runs x outputs`.
    pub responses: &'a Matrix,
}

/// A fitted surrogate. Points are in physical units, one a row.
pub trait Emulator: Forward {
    /// Which parameters matter under the design's distribution, where the method knows it exactly.
    fn sensitivity(&self) -> Option<Sensitivity> {
        None
    }

    /// How well it fits, judged on its own training runs.
    fn fit_error(&self) -> &FitError;

    /// What is worth telling about the fit.
    fn facts(&self) -> Vec<Fact>;

    /// The emulator as bytes, for [`Surrogate::load`].
    fn save(&self) -> Result<Vec<u8>, Stop>;
}

/// The error of a fit estimated from its own training runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FitError {
    /// The leave-one-out error of each output relative to the output's variance over the runs
    /// (corrected for the selection of terms where the method does so).
    pub relative: Vec<f64>,
    /// The leave-one-out residual of each run and output, `runs x outputs`, in the response's unit.
    pub residuals: Matrix,
}

/// The moments of each output under the design's distribution and Sobol' indices: shares of its
/// variance. An output without variance has zero indices.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// The mean of each output.
    pub mean: Vec<f64>,
    /// The variance of each output.
    pub variance: Vec<f64>,
    /// The pairs of parameters to which the columns of [`Indices::pairs`] belong.
    pub pairs: Vec<[usize; 2]>,
    /// The indices of each output, one a row.
    pub outputs: Indices,
    /// The indices of all outputs together, weighted by their variances: one row (Gamboa, Janon,
    /// Klein and Lagnoux 2014).
    pub aggregated: Indices,
}

/// Sobol' indices, one row an output.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Indices {
    /// The share due to each parameter alone, `outputs x parameters`.
    pub first: Matrix,
    /// The share in which each parameter takes part, `outputs x parameters`.
    pub total: Matrix,
    /// The share due to each pair's interaction beyond the first-order shares, `outputs x pairs`.
    pub pairs: Matrix,
}
