//! Surrogates: from simulation runs to an emulator with an estimate of its own error.

use lacuna_base::data::{Layouts, Parameter};
use lacuna_base::math::random::Stream;
use lacuna_base::matrix::Matrix;
use lacuna_base::run::{Progress, Stop, Tasks};
use serde::{Deserialize, Serialize};

use super::{Component, Fact, Forward};

/// Fits an emulator to simulation runs.
pub trait Surrogate: Component {
    /// Fits an emulator to all outputs.
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop>;

    /// Like [`Surrogate::fit`], with the same bits. Searches that do not depend on each other, such as those of the outputs, are
    /// `tasks`, which other processes may compute.
    fn fit_with_tasks(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
        _tasks: Tasks<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        self.fit(training, stream, progress)
    }

    /// Accepts or refuses [`Training::gradients`].
    ///
    /// # Errors
    /// The reason why it does not, as a clause such as `it is fitted to the responses alone`.
    fn takes_gradients(&self) -> Result<(), String> {
        Err("it is fitted to the responses alone".to_owned())
    }

    /// Restores an emulator from the bytes that [`Emulator::save`] wrote.
    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop>;

    /// The surrogate for rotated outputs: from responses `Y Q`, with the rows of `Y` less their mean in the span of the
    /// orthonormal columns of `Q`, it fits the emulator of `Y` times `Q`. `None` if the fit to this many values depends on
    /// the axes of the outputs, or the emulator states its variance.
    fn rotated(&self, _runs: usize, _outputs: usize) -> Option<Box<dyn Surrogate>> {
        None
    }

    /// The weighted sum of emulators that this surrogate fitted, with one weight per emulator and output and one offset
    /// per output, as one emulator of the same form. `None` if the method has no such form, or these emulators cannot
    /// be combined.
    ///
    /// Only the response and the sensitivity of the sum are used; its error estimates are meaningless.
    fn sum(
        &self,
        _parts: &[Summand<'_>],
        _offset: &[f64],
    ) -> Result<Option<Box<dyn Emulator>>, Stop> {
        Ok(None)
    }
}

/// One term of a sum of emulators.
#[derive(Debug, Clone, Copy)]
pub struct Summand<'a> {
    /// The bytes that [`Emulator::save`] wrote.
    pub bytes: &'a [u8],
    /// Weight of each output.
    pub weights: &'a [f64],
}

/// Runs to which a surrogate is fitted.
#[derive(Debug, Clone, Copy)]
pub struct Training<'a> {
    /// Parameters with their design distributions.
    pub parameters: &'a [Parameter],
    /// Layouts of the response of one run.
    pub layouts: &'a Layouts,
    /// Parameters of each run in physical units, `runs x parameters`.
    pub points: &'a Matrix,
    /// Responses, `runs x outputs`.
    pub responses: &'a Matrix,
    /// Derivatives of the responses by the parameters, in physical units: those of the first output by all parameters,
    /// then those of the second, `runs x (outputs * parameters)`; NaN where they are not known. `None` unless the study
    /// requests them and [`Surrogate::takes_gradients`].
    pub gradients: Option<&'a Matrix>,
}

/// A fitted surrogate. Points are in physical units, one per row.
pub trait Emulator: Forward {
    /// Sensitivity to each parameter under the design distribution, if the method computes it exactly.
    fn sensitivity(&self) -> Option<Sensitivity> {
        None
    }

    /// The emulator's own errors with their covariance between points, if the method knows it.
    fn processes(&self) -> Option<&dyn Processes> {
        None
    }

    /// Goodness of fit, estimated from the training runs.
    fn fit_error(&self) -> &FitError;

    /// The error of each output, as [`FitError::relative`] has it.
    fn relative_error(&self) -> &[f64] {
        &self.fit_error().relative
    }

    /// Leave-one-out residuals of some runs and outputs, as [`FitError::residuals`] has them.
    fn left_out(&self, runs: &[usize], outputs: &[usize]) -> Matrix {
        self.fit_error().residuals.select(runs, outputs)
    }

    /// Facts about the fit, for the report.
    fn facts(&self) -> Vec<Fact>;

    /// Serialises the emulator, for [`Surrogate::load`].
    fn save(&self) -> Result<Vec<u8>, Stop>;

    /// The emulator's mean as numbers from which a program without this plugin can compute it.
    ///
    /// # Errors
    /// The reason why it has no such form, as a clause such as `its polynomials are those of another variable`.
    fn tables(&self) -> Result<Tables, String> {
        Err("its plugin states no tables".to_owned())
    }
}

/// Numbers of an emulator, which a file carries to other programs. Names, dimensions and formulas are those of
/// `docs/emulator_file.md`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tables {
    /// Indices of the parameters on which the response depends, in the order of the arrays; empty for all.
    pub parameters: Vec<usize>,
    /// Texts, such as the name of a kernel.
    pub texts: Vec<(String, String)>,
    /// Arrays of numbers.
    pub arrays: Vec<Table>,
}

/// A named array of an emulator.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Name of the array.
    pub name: String,
    /// Name and length of each dimension, slowest-varying first.
    pub dimensions: Vec<(String, usize)>,
    /// Values, row-major.
    pub values: Vec<f64>,
}

impl Tables {
    /// Adds a column of numbers.
    pub fn column(&mut self, name: &str, dimension: &str, values: Vec<f64>) {
        let dimensions = vec![(dimension.to_owned(), values.len())];
        self.arrays.push(Table { name: name.to_owned(), dimensions, values });
    }

    /// Adds a matrix, with names for its rows and columns.
    pub fn matrix(&mut self, name: &str, rows: &str, columns: &str, matrix: &Matrix) {
        self.arrays.push(Table {
            name: name.to_owned(),
            dimensions: vec![
                (rows.to_owned(), matrix.rows()),
                (columns.to_owned(), matrix.columns()),
            ],
            values: matrix.as_slice().to_vec(),
        });
    }
}

/// Errors of an emulator as a sum over components, `e(x) = Σ t_c(x) l_c`, with independent Gaussian processes `t_c` of mean
/// zero and fixed directions `l_c`. Points are in physical units, one per row.
pub trait Processes: Send + Sync {
    /// Directions, `components x outputs`.
    fn directions(&self) -> Matrix;

    /// Covariance of each component among points, `points x points`.
    fn covariances(&self, points: &Matrix) -> Vec<Matrix>;

    /// Variance of the noise of a new run in each component, in addition to [`Processes::covariances`].
    fn noise(&self) -> Vec<f64>;
}

/// Error of a fit, estimated from its own training runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FitError {
    /// Leave-one-out mean squared error of each output divided by the output's variance over the runs (corrected for
    /// the selection of terms if the method does so).
    pub relative: Vec<f64>,
    /// Leave-one-out residual of each run and output, `runs x outputs`, in the response's unit.
    pub residuals: Matrix,
}

/// Moments of each output under the design distribution, and Sobol' indices, which are fractions of its variance. An
/// output without variance has zero indices.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// Mean of each output.
    pub mean: Vec<f64>,
    /// Variance of each output.
    pub variance: Vec<f64>,
    /// Pairs of parameters for the columns of [`Indices::pairs`].
    pub pairs: Vec<[usize; 2]>,
    /// Indices of each output, one per row.
    pub outputs: Indices,
    /// Indices of all outputs together, weighted by their variances: one row (Gamboa, Janon, Klein and Lagnoux 2014).
    pub aggregated: Indices,
}

/// Sobol' indices, one row per output.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Indices {
    /// First-order indices, `outputs x parameters`.
    pub first: Matrix,
    /// Total indices, `outputs x parameters`.
    pub total: Matrix,
    /// Second-order indices: the interaction of each pair beyond the first-order indices, `outputs x pairs`.
    pub pairs: Matrix,
}
