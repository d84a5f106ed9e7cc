//! A fitted emulator as it is kept, with its errors.

use std::borrow::Cow;
use std::path::Path;

use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::Artifact;
use lacuna_run::arrays::{self, Array};
use serde::{Deserialize, Serialize};

use super::serialised::Serialised;
use crate::screening::ActiveSubspace;
use crate::stage::emulator_error::{Curves, rows_near_prior};
use crate::study::Study;

/// Fitted emulator as it is stored, with its measured errors.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// Serialised emulator.
    pub bytes: Serialised,
    /// Errors of the emulator.
    pub errors: Errors,
    /// Errors of the emulator at runs it was not trained on, `runs x outputs`, in the unit of the response: the
    /// leave-one-out errors of the training runs (of at most 5000, evenly spaced), then those of the validation runs;
    /// `None` if these are the errors of `curves`, or too many to be kept beside them.
    pub own_samples: Option<Matrix>,
    /// Parameters of those runs, `runs x parameters`.
    pub sample_points: Matrix,
    /// Errors that enter the likelihood: at training runs those of emulators that were fitted without the run if that
    /// is feasible, otherwise leave-one-out errors.
    pub curves: Curves,
    /// Directions in which the response changes, if the derivatives at the training runs are known.
    pub active: Option<ActiveSubspace>,
}

/// Errors of an emulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Number of training runs.
    pub training: usize,
    /// Number of validation runs.
    pub validation: usize,
    /// Mean absolute error over validation runs and outputs, in the unit of the response (over leave-one-out errors if
    /// there are no validation runs).
    pub mae: f64,
    /// Root mean square error over the same runs and outputs.
    pub rmse: f64,
    /// Leave-one-out error relative to the variance of the output, mean over outputs.
    pub loo: f64,
    /// Relative leave-one-out error of each output.
    pub loo_by_output: Vec<f64>,
    /// Errors of each group of outputs: name, mean absolute error, root mean square error, relative leave-one-out
    /// error.
    pub by_group: Vec<(String, f64, f64, f64)>,
    /// Pairs of simulated and emulated values of the validation runs, thinned.
    pub pairs: Vec<(f64, f64)>,
    /// Facts that the emulator states of itself.
    pub facts: Vec<Fact>,
    /// Ratio of the root mean square error at the validation runs to the root mean square of the standard deviations
    /// that the emulator states there; `None` if it states none or there are fewer than ten such runs.
    pub inflation: Option<f64>,
}

impl Artifact for Fitted {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_atomic(&folder.join(EMULATOR), &self.bytes.bytes()?)?;
        files::write_json(&folder.join("errors.json"), &self.errors)?;
        let curves = &self.curves;
        let mut arrays = vec![
            Array::matrix("samples", "run", "output", self.samples()),
            Array::matrix("points", "run", "parameter", &self.sample_points),
        ];
        if self.own_samples.is_some() {
            arrays.push(Array::matrix("left_out", "run", "output", &curves.errors));
        }
        let stated = curves.stated.as_ref();
        arrays.extend(stated.map(|s| Array::matrix("left_out_variance", "run", "output", s)));
        arrays::write(&folder.join("errors.nc"), &[], &arrays)?;
        let mut written = [EMULATOR, "errors.json", "errors.nc"].map(str::to_owned).to_vec();
        if let Some(active) = &self.active {
            files::write_json(&folder.join(ACTIVE), active)?;
            written.push(ACTIVE.to_owned());
        }
        Ok(written)
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join("errors.nc");
        let sample_points = arrays::read(&path, "points")?.into_matrix();
        let samples = arrays::read(&path, "samples")?.into_matrix();
        let (own_samples, errors) = match arrays::read_some(&path, "left_out")? {
            Some(left_out) => (Some(samples), left_out.into_matrix()),
            None => (None, samples),
        };
        let curves = Curves {
            points: sample_points.clone(),
            errors,
            stated: arrays::read_some(&path, "left_out_variance")?.map(Array::into_matrix),
        };
        Ok(Self {
            bytes: Serialised::Held(files::read(&folder.join(EMULATOR))?),
            errors: files::read_json(&folder.join("errors.json"))?,
            own_samples,
            sample_points,
            curves,
            active: folder
                .join(ACTIVE)
                .is_file()
                .then(|| files::read_json(&folder.join(ACTIVE)))
                .transpose()?,
        })
    }
}

const ACTIVE: &str = "active_subspace.json";

/// Name of the file with the serialised emulator.
pub(super) const EMULATOR: &str = "emulator.bin";

impl Fitted {
    /// Errors of the emulator at runs it was not trained on, `runs x outputs`, in the unit of the response.
    pub fn samples(&self) -> &Matrix {
        self.own_samples.as_ref().unwrap_or(&self.curves.errors)
    }

    /// Errors at the runs inside the prior's support, `runs x outputs`; at all runs if fewer than fifty are inside.
    pub fn errors_near_prior(&self, study: &Study) -> Cow<'_, Matrix> {
        let rows = rows_near_prior(study, &self.sample_points);
        let all = rows.len() == self.sample_points.rows();
        if all {
            Cow::Borrowed(self.samples())
        } else {
            Cow::Owned(self.samples().select_rows(&rows))
        }
    }

    /// Errors of the emulator near the prior as a factor of their covariance: one sample per column, divided by the
    /// square root of their number. With `stated`, the variances that the emulator states at the point where the data
    /// are fitted best (one per output), the errors are scaled to them, times the square of [`Errors::inflation`] if it
    /// is above 1.
    pub fn error_samples(&self, study: &Study, stated: Option<&[f64]>) -> CommonError {
        let mut errors = self.errors_near_prior(study);
        if let Some(stated) = stated {
            rescale(errors.to_mut(), stated, self.errors.inflation.map_or(1.0, |r| r.max(1.0)));
        }
        let scale = (errors.rows() as f64).sqrt();
        let factor =
            Matrix::from_fn(errors.columns(), errors.rows(), |i, k| errors[(k, i)] / scale);
        CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true }
    }
}

/// Scales the errors of each output to a mean square of `factor^2` times the stated variance.
fn rescale(errors: &mut Matrix, stated: &[f64], factor: f64) {
    let count = errors.rows() as f64;
    for (j, variance) in stated.iter().enumerate() {
        let square = errors.column(j).iter().map(|e| e * e).sum::<f64>() / count;
        if square > 0.0 {
            let scale = factor * (variance / square).sqrt();
            (0..errors.rows()).for_each(|i| errors[(i, j)] *= scale);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn fitted(own_samples: Option<Matrix>) -> Fitted {
        let errors = Errors {
            training: 2,
            validation: 1,
            mae: 0.1,
            rmse: 0.2,
            loo: 0.3,
            loo_by_output: vec![0.3, 0.3],
            by_group: vec![("all".to_owned(), 0.1, 0.2, 0.3)],
            pairs: vec![(1.0, 1.1)],
            facts: vec![Fact::new("terms", 3)],
            inflation: None,
        };
        let points = Matrix::from_fn(3, 2, |i, j| (i + 2 * j) as f64);
        let curves = Curves {
            points: points.clone(),
            errors: Matrix::from_fn(3, 2, |i, j| 0.1 * (i * j) as f64),
            stated: None,
        };
        let bytes = Serialised::Held(vec![1, 2, 3]);
        Fitted { bytes, errors, own_samples, sample_points: points, curves, active: None }
    }

    /// Errors that are those of the curves are written and held once.
    #[test]
    fn what_is_written_is_read_again() {
        let own = Matrix::from_fn(3, 2, |i, j| 0.5 + (i * j) as f64);
        for (samples, arrays) in [(None, 2), (Some(own), 3)] {
            let folder = tempfile::tempdir().unwrap();
            let fitted = fitted(samples);
            fitted.save(folder.path()).unwrap();
            assert_eq!(Fitted::load(folder.path()).unwrap(), fitted);
            let path = folder.path().join("errors.nc");
            let names = ["samples", "points", "left_out"];
            let written = names.iter().filter(|n| arrays::read_some(&path, n).unwrap().is_some());
            assert_eq!(written.count(), arrays);
        }
    }
}
