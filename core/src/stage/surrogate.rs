//! Stage 4: the emulator is fitted and its error measured.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::data::{Ensemble, Parameter};
use crate::linalg::Matrix;
use crate::plugin::discrepancy::CommonError;
use crate::plugin::surrogate::Training;
use crate::plugin::{Emulator, Fact};
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Kept, Observer, Progress, RunDirectory, Silent, Stop, files};
use crate::study::Study;
use crate::study::file::InvalidRuns;

use super::emulator_error::{self, Curves, rows_near_prior};
use super::idle::Used;
use super::low_fidelity;
use super::read::Data;

/// A fitted emulator as it is kept, with its measured error.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The emulator's own bytes.
    pub bytes: Vec<u8>,
    /// Its errors.
    pub errors: Errors,
    /// Errors of the emulator at runs it was not trained on, `runs x outputs`, in the response's unit: the
    /// leave-one-out errors of the training runs, then those of the validation runs.
    pub samples: Matrix,
    /// The parameters of those runs.
    pub sample_points: Matrix,
    /// The errors that the likelihood allows for: at training runs those of emulators that were fitted without the run, where
    /// that is feasible, else the same.
    pub curves: Curves,
}

/// Errors of an emulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// The number of runs it was trained on.
    pub training: usize,
    /// The number of runs it was tested on.
    pub validation: usize,
    /// Mean absolute error over validation runs and outputs (over leave-one-out errors without any).
    pub mae: f64,
    /// Root mean square error over the same.
    pub rmse: f64,
    /// Relative leave-one-out error, mean over outputs.
    pub loo: f64,
    /// Relative leave-one-out error of each output.
    pub loo_by_output: Vec<f64>,
    /// For each group of outputs: name, mean absolute error, root mean square error, relative leave-one-out error.
    pub by_group: Vec<(String, f64, f64, f64)>,
    /// Pairs of simulated and emulated values of the validation runs, thinned.
    pub pairs: Vec<(f64, f64)>,
    /// What the emulator says of itself.
    pub facts: Vec<Fact>,
    /// The emulator's errors at the validation runs, root mean square, over the standard deviation that it
    /// states there; where it states one and there are at least ten such runs.
    pub inflation: Option<f64>,
}

impl Artifact for Fitted {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_atomic(&folder.join("emulator.bin"), &self.bytes)?;
        files::write_json(&folder.join("errors.json"), &self.errors)?;
        let curves = &self.curves;
        let mut arrays = vec![
            Array::matrix("samples", "run", "output", &self.samples),
            Array::matrix("points", "run", "parameter", &self.sample_points),
            Array::matrix("left_out", "run", "output", &curves.errors),
        ];
        let stated = curves.stated.as_ref();
        arrays.extend(stated.map(|s| Array::matrix("left_out_variance", "run", "output", s)));
        arrays::write(&folder.join("errors.nc"), &[], &arrays)?;
        Ok(["emulator.bin", "errors.json", "errors.nc"].map(str::to_owned).to_vec())
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join("errors.nc");
        let sample_points = arrays::read(&path, "points")?.into_matrix();
        let curves = Curves {
            points: sample_points.clone(),
            errors: arrays::read(&path, "left_out")?.into_matrix(),
            stated: arrays::read_some(&path, "left_out_variance")?.map(Array::into_matrix),
        };
        Ok(Self {
            bytes: files::read(&folder.join("emulator.bin"))?,
            errors: files::read_json(&folder.join("errors.json"))?,
            samples: arrays::read(&path, "samples")?.into_matrix(),
            sample_points,
            curves,
        })
    }
}

/// What a surrogate is fitted to, and where it is kept.
pub struct Fitting<'a> {
    /// The folder of the stage.
    pub folder: &'a str,
    /// The parameters, with the laws under which the runs were made.
    pub parameters: &'a [Parameter],
    /// The runs it is trained on.
    pub training: Vec<usize>,
    /// The runs it is tested on.
    pub validation: Vec<usize>,
}

impl<'a> Fitting<'a> {
    /// The study's own: the first runs for training, the last for validation.
    pub fn of(study: &'a Study, ensemble: &Ensemble) -> Result<Self, Stop> {
        let (training, validation) = split(study, ensemble)?;
        let runs = ensemble.runs.len();
        let wanted = |rows: std::ops::Range<usize>| -> Vec<usize> {
            rows.filter(|&i| is_wanted(study, ensemble, i)).collect()
        };
        let training = wanted(0..training);
        if training.is_empty() {
            return Err(Stop::new("every training run is outside the model's validity").help(
                "narrow the `design` to where the model holds, or set `invalid_runs = \"train\"` in `[surrogate]`",
            ));
        }
        Ok(Self {
            folder: "4-surrogate",
            parameters: &study.parameters,
            training,
            validation: wanted(runs - validation..runs),
        })
    }
}

/// Fits the surrogate; returns what is kept and the emulator itself.
pub fn stage(
    study: &Study,
    data: &Kept<Data>,
    fitting: &Fitting<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Kept<Fitted>, Box<dyn Emulator>), Stop> {
    let section =
        study.surrogate.as_ref().ok_or_else(|| Stop::new("the study has no surrogate"))?;
    let used = Used::of(study)?;
    let parameters = used.parameters(fitting.parameters);
    let laws: Vec<_> = parameters.iter().map(|p| (&p.name, &p.design)).collect();
    let inputs = json!([
        data.hash,
        section.built.identity(),
        (&fitting.training, &fitting.validation),
        laws,
        study.about.seed
    ]);
    let inputs = match low_fidelity::identity(study) {
        Some(identity) => json!([inputs, { "low_fidelity": identity }]),
        None => inputs,
    };
    let ensemble = data.value.runs()?;
    observer.begin("surrogate", "output", ensemble.layouts.len() as u64);
    let kept = run.keep(fitting.folder, &inputs, observer, |_| {
        fit(study, &data.value, fitting, &used, observer)
    })?;
    let emulator = used.widen(low_fidelity::load(study, &kept.value.bytes)?);
    let errors = &kept.value.errors;
    let unit = study.layouts.unit();
    observer.end("surrogate", &format!("rmse {:.3e} {unit}, loo {:.2e}", errors.rmse, errors.loo));
    Ok((kept, emulator))
}

/// Whether a surrogate may learn from a run: it is inside the model's validity, or the study does not mind.
pub(super) fn is_wanted(study: &Study, ensemble: &Ensemble, run: usize) -> bool {
    let section = study.surrogate.as_ref();
    ensemble.valid[run]
        || section.is_some_and(|section| section.common.invalid_runs == InvalidRuns::Train)
}

/// The numbers of training and validation runs.
fn split(study: &Study, ensemble: &Ensemble) -> Result<(usize, usize), Stop> {
    let common = study.surrogate.as_ref().map(|s| s.common.clone()).unwrap_or_default();
    let (runs, validation) = (ensemble.runs.len(), common.validation);
    let training = common.training.map_or_else(|| runs.saturating_sub(validation), usize::from);
    // Runs that failed and may be left out come off the training set, never off the runs kept aside.
    let lost = ensemble.failed.len();
    let training = training.min(runs.saturating_sub(validation)).max(training.saturating_sub(lost));
    if training == 0 || training + validation > runs {
        return Err(Stop::new(format!(
            "{training} runs for training and {validation} for validation are more than the {runs} runs there are"
        ))
        .help("lower `training` or `validation` in `[surrogate]`"));
    }
    Ok((training, validation))
}

fn fit(
    study: &Study,
    data: &Data,
    fitting: &Fitting<'_>,
    used: &Used,
    observer: &dyn Observer,
) -> Result<Fitted, Stop> {
    let ensemble = data.runs()?;
    let points = ensemble.points.select_rows(&fitting.training);
    let responses = ensemble.responses.select_rows(&fitting.training);
    let fit = Fit { study, data, fitting, used };
    let rows: Vec<usize> = (0..points.rows()).collect();
    let emulator = fit.emulator(&points, &responses, &rows, &[], observer)?;
    let test_points = ensemble.points.select_rows(&fitting.validation);
    let simulated = ensemble.responses.select_rows(&fitting.validation);
    let emulated = emulator.mean(&test_points);
    let held_out = difference(&simulated, &emulated);
    let left_out = corrected(&*emulator, &responses);
    let judged = if held_out.rows() > 0 { &held_out } else { &left_out };
    let loo_by_output = emulator.fit_error().relative.clone();
    let mut errors = Errors {
        training: fitting.training.len(),
        validation: fitting.validation.len(),
        mae: mean(judged.as_slice().iter().map(|e| e.abs())),
        rmse: mean(judged.as_slice().iter().map(|e| e * e)).sqrt(),
        loo: mean(loo_by_output.iter().copied()),
        by_group: by_group(study, judged, &loo_by_output),
        loo_by_output,
        pairs: pairs(&simulated, &emulated),
        inflation: inflation(&*emulator, &test_points, &held_out),
        facts: emulator.facts(),
    };
    let runs = emulator_error::Runs { points: &points, responses: &responses };
    let again =
        Curves::refitted(runs, |kept, left| fit.emulator(&points, &responses, kept, left, &Silent));
    let refitted = again.unwrap_or_else(|stop| {
        let why = format!(
            "by the leave-one-out formula, since a fit to nine tenths of the runs failed: {stop}"
        );
        errors.facts.push(Fact::new("errors at runs left out", why));
        None
    });
    let curves = refitted.unwrap_or_else(|| Curves {
        points: points.clone(),
        errors: left_out.clone(),
        stated: None,
    });
    let stated = emulator.variance(&test_points);
    let validated = Curves { points: test_points.clone(), errors: held_out.clone(), stated };
    let curves = curves.with(validated);
    let samples = stacked(&left_out, &held_out);
    let sample_points = stacked(&points, &test_points);
    Ok(Fitted { bytes: emulator.save()?, errors, samples, sample_points, curves })
}

/// The runs and settings that an emulator of the study is fitted to.
struct Fit<'a> {
    study: &'a Study,
    data: &'a Data,
    fitting: &'a Fitting<'a>,
    used: &'a Used,
}

impl Fit<'_> {
    /// The emulator of some of these runs. Cheaper runs at the parameters of those that are left out are left out too.
    fn emulator(
        &self,
        points: &Matrix,
        responses: &Matrix,
        kept: &[usize],
        left: &[usize],
        observer: &dyn Observer,
    ) -> Result<Box<dyn Emulator>, Stop> {
        let Self { study, data, fitting, used } = *self;
        let runs = Training {
            parameters: &used.parameters(fitting.parameters),
            layouts: &study.layouts,
            points: &used.points(&points.select_rows(kept)),
            responses: &responses.select_rows(kept),
        };
        let cheap = data.cheaper.as_ref().map(|cheap| {
            let known =
                |point: &[f64]| left.iter().any(|&i| low_fidelity::is_same(points.row(i), point));
            let rows: Vec<usize> =
                (0..cheap.points.rows()).filter(|&i| !known(cheap.points.row(i))).collect();
            (used.points(&cheap.points.select_rows(&rows)), cheap.responses.select_rows(&rows))
        });
        let cheap = cheap.as_ref().map(|(points, responses)| (points, responses));
        let wide = used.parameters(&study.parameters);
        let progress = Progress::new(observer);
        let emulator = low_fidelity::fit(study, &runs, cheap, &wide, &progress)?;
        Ok(used.clone().widen(emulator))
    }
}

fn inflation(emulator: &dyn Emulator, points: &Matrix, errors: &Matrix) -> Option<f64> {
    let variance = emulator.variance(points).filter(|_| points.rows() >= 10)?;
    let squares: f64 = errors.as_slice().iter().map(|e| e * e).sum();
    let ratio = (squares / variance.as_slice().iter().sum::<f64>()).sqrt();
    ratio.is_finite().then_some(ratio)
}

/// The leave-one-out residuals, scaled so that their mean square is the (corrected) leave-one-out error.
fn corrected(emulator: &dyn Emulator, responses: &Matrix) -> Matrix {
    let error = emulator.fit_error();
    let scale: Vec<f64> = (0..responses.columns())
        .map(|j| {
            let column = responses.column(j);
            let centre = mean(column.iter().copied());
            let variance = mean(column.iter().map(|y| (y - centre).powi(2)));
            let square = mean(error.residuals.column(j).iter().map(|r| r * r));
            let expected = error.relative[j] * variance;
            if square > 0.0 && expected > square { (expected / square).sqrt() } else { 1.0 }
        })
        .collect();
    let residuals = &error.residuals;
    Matrix::from_fn(residuals.rows(), residuals.columns(), |i, j| residuals[(i, j)] * scale[j])
}

fn by_group(study: &Study, errors: &Matrix, loo: &[f64]) -> Vec<(String, f64, f64, f64)> {
    let groups = study.layouts.groups();
    let figures = |group: &crate::data::layout::Group| {
        let all = || errors.iter_rows().flat_map(|row| group.indices.iter().map(|&i| row[i]));
        let loo = mean(group.indices.iter().map(|&i| loo[i]));
        (mean(all().map(f64::abs)), mean(all().map(|e| e * e)).sqrt(), loo)
    };
    groups
        .iter()
        .map(|group| {
            let (mae, rmse, loo) = figures(group);
            (group.name.clone(), mae, rmse, loo)
        })
        .collect()
}

/// At most about 3000 pairs of simulated and emulated values, evenly thinned.
fn pairs(simulated: &Matrix, emulated: &Matrix) -> Vec<(f64, f64)> {
    let step = (simulated.as_slice().len() / 3000).max(1);
    let all = simulated.as_slice().iter().zip(emulated.as_slice());
    all.step_by(step).map(|(a, b)| (*a, *b)).collect()
}

fn difference(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_fn(a.rows(), a.columns(), |i, j| a[(i, j)] - b[(i, j)])
}

fn stacked(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_rows(a.columns(), a.iter_rows().chain(b.iter_rows()))
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

impl Fitted {
    /// The errors at the runs inside the prior's support, or at all runs when those are fewer than fifty.
    pub fn errors_near_prior(&self, study: &Study) -> Matrix {
        self.samples.select_rows(&rows_near_prior(study, &self.sample_points))
    }

    /// The emulator's errors near the prior as samples: one a column, over the root of their number. They have the size that an
    /// emulator states of itself at the point where the data are fitted best.
    pub fn error_samples(&self, study: &Study, stated: Option<&[f64]>) -> CommonError {
        let mut errors = self.errors_near_prior(study);
        if let Some(stated) = stated {
            rescale(&mut errors, stated, self.errors.inflation.map_or(1.0, |r| r.max(1.0)));
        }
        let scale = (errors.rows() as f64).sqrt();
        let factor =
            Matrix::from_fn(errors.columns(), errors.rows(), |i, k| errors[(k, i)] / scale);
        CommonError { origin: "emulator".to_owned(), factor, predictive: true }
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
