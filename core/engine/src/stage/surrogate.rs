//! Stage 4: fit of the emulator and estimation of its error.

mod figures;
mod fitted;
mod refits;
mod rotated;
mod serialised;

use std::borrow::Cow;

use lacuna::data::{Ensemble, Parameter};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Emulator, Fact, Surrogate};
use lacuna::run::{Observer, Progress, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, Kept, RunDirectory, Stage};
use serde_json::json;

use self::figures::{by_group, corrected, difference, inflation, mean, pairs, stacked};
use self::fitted::EMULATOR;
pub use self::fitted::{Errors, Fitted};
use self::serialised::Serialised;
use super::emulator_error::{self, Curves};
use super::gradients::{self, Gradients};
use super::idle::Used;
use super::more_runs::is_inside;
use super::read::Data;
use super::{low_fidelity, stream};
use crate::screening::{ActiveSubspace, active_subspace};
use crate::study::Study;
use crate::study::file::InvalidRuns;

/// Largest number of training runs whose error curves are kept, evenly spaced: their covariance is then known to one
/// percent.
const MOST_CURVES: usize = 5000;

/// Number of values of error curves up to which as many are kept (256 MiB), and the number of curves that is kept however
/// many outputs there are.
const MOST_VALUES: usize = 1 << 25;
const FEWEST_CURVES: usize = 50;

/// Number of error curves that are kept.
fn most_curves(outputs: usize) -> usize {
    (MOST_VALUES / outputs.max(1)).clamp(FEWEST_CURVES, MOST_CURVES)
}

/// Input of a fit, and the folder in which it is kept.
pub struct Fitting<'a> {
    /// Folder of the stage.
    pub folder: Folder,
    /// Parameters, with the distributions from which the runs were drawn.
    pub parameters: &'a [Parameter],
    /// Indices of the training runs.
    pub training: Vec<usize>,
    /// Indices of the validation runs.
    pub validation: Vec<usize>,
    /// Use of the emulator.
    pub purpose: Purpose<'a>,
}

/// Use of an emulator, which determines its inputs and the way in which its errors are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose<'a> {
    /// Emulator of the study: without the parameters that the model does not use, with the cheaper runs, and with
    /// errors by refits to nine tenths of the runs if that is feasible.
    Study,
    /// Emulator of further runs in the gap search, under a name such as `gap`: of all its parameters, with errors by
    /// the leave-one-out formula.
    Gap(&'a str),
}

impl Purpose<'_> {
    /// Name under which progress is reported.
    fn label(self) -> &'static str {
        match self {
            Self::Study => Stage::Surrogate.label(),
            Self::Gap(_) => "gap-surrogate",
        }
    }

    /// Parameters on which the surrogate is trained.
    fn used(self, study: &Study, parameters: &[Parameter]) -> Result<Used, Stop> {
        match self {
            Self::Study => Used::of(study),
            Self::Gap(_) => Ok(Used::all(parameters.len())),
        }
    }

    /// Restores the emulator from its serialised form.
    fn load(self, study: &Study, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        match self {
            Self::Study => low_fidelity::load(study, bytes),
            Self::Gap(_) => plugin(study)?.load(bytes),
        }
    }
}

/// The surrogate plugin of the study.
fn plugin(study: &Study) -> Result<&dyn Surrogate, Stop> {
    let section = study.surrogate.as_ref();
    section.map(|s| &*s.built.plugin).ok_or_else(|| Stop::new("the study has no surrogate"))
}

impl<'a> Fitting<'a> {
    /// The split of the study's runs: the first runs for training, the last for validation.
    pub fn of(study: &'a Study, ensemble: &Ensemble) -> Result<Self, Stop> {
        let (training, validation) = split(study, ensemble)?;
        let runs = ensemble.runs.len();
        let wanted = |rows: std::ops::Range<usize>| -> Vec<usize> {
            rows.filter(|&i| is_wanted(study, ensemble, i)).collect()
        };
        let training = wanted(0..training);
        if training.is_empty() {
            return Err(Stop::new("every training run is outside the model's validity").help(
                "narrow the `design` to the region where the model is valid, or set `invalid_runs = \"train\"` in \
                 `[surrogate]`",
            ));
        }
        Ok(Self {
            folder: Stage::Surrogate.folder(),
            parameters: &study.parameters,
            training,
            validation: wanted(runs - validation..runs),
            purpose: Purpose::Study,
        })
    }

    /// All runs in a region, for training; `near` are the parameters with designs in the region.
    pub fn inside(
        study: &Study,
        ensemble: &Ensemble,
        region: &[(f64, f64)],
        near: &'a [Parameter],
    ) -> Self {
        let inside = |i: &usize| {
            is_wanted(study, ensemble, *i) && is_inside(region, ensemble.points.row(*i))
        };
        Self {
            folder: Stage::Surrogate.folder(),
            parameters: near,
            training: (0..ensemble.runs.len()).filter(inside).collect(),
            validation: Vec::new(),
            purpose: Purpose::Study,
        }
    }
}

/// Fits the surrogate; returns the kept result and the emulator itself.
pub fn stage(
    study: &Study,
    data: &Kept<Data>,
    fitting: &Fitting<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Kept<Fitted>, Box<dyn Emulator>), Stop> {
    let section =
        study.surrogate.as_ref().ok_or_else(|| Stop::new("the study has no surrogate"))?;
    let purpose = fitting.purpose;
    let used = purpose.used(study, fitting.parameters)?;
    let parameters = used.parameters(fitting.parameters);
    let laws: Vec<_> = parameters.iter().map(|p| (&p.name, &p.design)).collect();
    let inputs = json!([
        data.value.runs_hash(),
        section.built.identity(),
        (&fitting.training, &fitting.validation),
        laws,
        study.about.seed
    ]);
    let inputs = match low_fidelity::identity(study).filter(|_| purpose == Purpose::Study) {
        Some(identity) => json!([inputs, { "low_fidelity": identity }]),
        None => inputs,
    };
    let slopes = gradients::stage(study, &data.value, fitting, run, observer)?;
    let inputs = match &slopes {
        Some(kept) => json!([inputs, { "gradients": kept.hash }]),
        None => inputs,
    };
    let ensemble = data.value.runs()?;
    observer.begin(purpose.label(), "output", ensemble.layouts.len() as u64);
    let mut kept = run.keep(&fitting.folder, &inputs, observer, |_| {
        let gradients = slopes.as_ref().map(|kept| &kept.value);
        fit(Fit { study, data: &data.value, fitting, used: &used, gradients }, observer)
    })?;
    let emulator = used.widen(purpose.load(study, &kept.value.bytes.bytes()?)?);
    let file = run.stage_folder(&fitting.folder).join(EMULATOR);
    kept.value.bytes = kept.value.bytes.kept_in(&file);
    let errors = &kept.value.errors;
    let unit = study.layouts.unit();
    observer
        .end(purpose.label(), &format!("rmse {:.3e} {unit}, loo {:.2e}", errors.rmse, errors.loo));
    Ok((kept, emulator))
}

/// Returns true if a surrogate may be trained on a run: it is inside the model's validity, or the study permits others.
pub(super) fn is_wanted(study: &Study, ensemble: &Ensemble, run: usize) -> bool {
    let section = study.surrogate.as_ref();
    ensemble.valid[run]
        || section.is_some_and(|section| section.common.invalid_runs == InvalidRuns::Train)
}

/// Numbers of training and validation runs.
fn split(study: &Study, ensemble: &Ensemble) -> Result<(usize, usize), Stop> {
    let common = study.surrogate.as_ref().map(|s| s.common.clone()).unwrap_or_default();
    let (runs, validation) = (ensemble.runs.len(), common.validation);
    let training = common.training.map_or_else(|| runs.saturating_sub(validation), usize::from);
    // Runs that failed reduce the training set, never the validation set.
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

fn fit(fit: Fit<'_>, observer: &dyn Observer) -> Result<Fitted, Stop> {
    let Fit { study, data, fitting, .. } = fit;
    let ensemble = data.runs()?;
    let points = ensemble.points.select_rows(&fitting.training);
    let responses = rows_of(&ensemble.responses, &fitting.training);
    let rows: Vec<usize> = (0..points.rows()).collect();
    let emulator = fit.emulator(&points, &responses, &rows, &[], observer)?;
    let test_points = ensemble.points.select_rows(&fitting.validation);
    let simulated = ensemble.responses.select_rows(&fitting.validation);
    let emulated = emulator.mean(&test_points);
    let held_out = difference(&simulated, &emulated);
    let shown = emulator_error::thinned(points.rows(), most_curves(responses.columns()));
    let runs = emulator_error::Runs { points: &points, responses: &responses };
    let mut facts = emulator.facts();
    let refitted = fit.refitted(runs, &shown).unwrap_or_else(|stop| {
        let why = format!(
            "by the leave-one-out formula, since a fit to nine tenths of the runs failed: {stop}"
        );
        facts.push(Fact::new("errors at runs left out", why));
        None
    });
    let shown_points = points.select_rows(&shown);
    let sample_points = stacked(shown_points.clone(), &test_points);
    let left_out = || corrected(&*emulator, &responses, &shown);
    let (own_samples, curves) = match refitted {
        // Of large tables the errors of the refits stand for those of the formula too.
        Some(curves) if runs.are_large() => (None, curves),
        Some(curves) => (Some(left_out()), curves),
        None => (None, Curves { points: shown_points, errors: left_out(), stated: None }),
    };
    let judged = if held_out.rows() > 0 {
        &held_out
    } else {
        own_samples.as_ref().unwrap_or(&curves.errors)
    };
    let loo_by_output = emulator.relative_error().to_vec();
    let errors = Errors {
        training: fitting.training.len(),
        validation: fitting.validation.len(),
        mae: mean(judged.as_slice().iter().map(|e| e.abs())),
        rmse: mean(judged.as_slice().iter().map(|e| e * e)).sqrt(),
        loo: mean(loo_by_output.iter().copied()),
        by_group: by_group(study, judged, &loo_by_output),
        loo_by_output,
        pairs: pairs(&simulated, &emulated),
        inflation: inflation(&*emulator, &test_points, &held_out),
        facts,
    };
    let own_samples = own_samples.map(|samples| stacked(samples, &held_out));
    let stated = emulator.variance(&test_points);
    let validated = Curves { points: test_points, errors: held_out, stated };
    let curves = curves.with(validated);
    let active = fit.active(&responses);
    let bytes = Serialised::Held(emulator.save()?);
    Ok(Fitted { bytes, errors, own_samples, sample_points, curves, active })
}

/// Runs and settings to which an emulator of the study is fitted.
struct Fit<'a> {
    study: &'a Study,
    data: &'a Data,
    fitting: &'a Fitting<'a>,
    used: &'a Used,
    /// Derivatives at the training runs, if the surrogate is fitted to them too.
    gradients: Option<&'a Gradients>,
}

impl Fit<'_> {
    /// The active subspace of the training runs, if their derivatives are known.
    fn active(&self, responses: &Matrix) -> Option<ActiveSubspace> {
        let width = |parameter: &Parameter| {
            let (design, sd) = (&parameter.design, parameter.design.sd());
            // Laws without variance have a width all the same.
            let middle = || 0.5 * (design.quantile(0.841) - design.quantile(0.159));
            if sd.is_finite() { sd } else { middle() }
        };
        let widths: Vec<f64> = self.fitting.parameters.iter().map(width).collect();
        let stream = stream(self.study, "gradients").named("resampled");
        let blocks = self.study.layouts.ranges();
        active_subspace(&self.gradients?.slopes, &widths, responses, blocks, &stream)
    }

    /// Fits the emulator to some of these runs. Cheaper runs at the parameters of the left-out runs are left out too.
    fn emulator(
        &self,
        points: &Matrix,
        responses: &Matrix,
        kept: &[usize],
        left: &[usize],
        observer: &dyn Observer,
    ) -> Result<Box<dyn Emulator>, Stop> {
        let Self { study, data, fitting, used, gradients } = *self;
        let gradients = gradients.map(|all| all.by(used.indices()).select_rows(kept));
        let runs = Training {
            parameters: &used.parameters(fitting.parameters),
            layouts: &study.layouts,
            points: &used.points(&points.select_rows(kept)),
            responses: &rows_of(responses, kept),
            gradients: gradients.as_ref(),
        };
        let progress = Progress::new(observer);
        if let Purpose::Gap(name) = fitting.purpose {
            let stream = stream(study, "gap-surrogate").named(name);
            return plugin(study)?.fit(&runs, &stream, &progress);
        }
        let cheap = data.cheaper.as_ref().map(|cheap| {
            let known =
                |point: &[f64]| left.iter().any(|&i| low_fidelity::is_same(points.row(i), point));
            let rows: Vec<usize> =
                (0..cheap.points.rows()).filter(|&i| !known(cheap.points.row(i))).collect();
            (used.points(&cheap.points.select_rows(&rows)), cheap.responses.select_rows(&rows))
        });
        let cheap = cheap.as_ref().map(|(points, responses)| (points, responses));
        let wide = used.parameters(&study.parameters);
        let emulator = low_fidelity::fit(study, &runs, cheap, &wide, &progress)?;
        Ok(used.clone().widen(emulator))
    }
}

/// Rows of a matrix; nothing is copied if these are all rows in their order.
fn rows_of<'a>(matrix: &'a Matrix, rows: &[usize]) -> Cow<'a, Matrix> {
    if rows.iter().copied().eq(0..matrix.rows()) {
        Cow::Borrowed(matrix)
    } else {
        Cow::Owned(matrix.select_rows(rows))
    }
}
