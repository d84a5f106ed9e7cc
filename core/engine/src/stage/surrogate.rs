//! Stage 4: fit of the emulator and estimation of its error.

mod figures;
mod fit;
mod fitted;
mod refits;
mod rotated;
mod serialised;

use lacuna::data::{Ensemble, Parameter};
use lacuna::plugin::{Emulator, Surrogate};
use lacuna::run::{Observer, Silent, Stop, Tasks};
use lacuna_run::work::Then;
use lacuna_run::{Folder, Kept, RunDirectory, Stage};
use serde_json::{Value, json};

use self::fit::Fit;
use self::fitted::EMULATOR;
pub use self::fitted::{Errors, Fitted};
use super::gradients::{self, Gradients};
use super::idle::Used;
use super::low_fidelity;
use super::more_runs::is_inside;
use super::read::Data;
use crate::stage::cases::{Spreading, Visit, Visiting};
use crate::study::Study;
use crate::study::file::InvalidRuns;

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

    /// All runs, or those of a region, in which the parameters have the designs `near`.
    pub fn over(
        study: &'a Study,
        ensemble: &Ensemble,
        region: Option<&[(f64, f64)]>,
        near: Option<&'a [Parameter]>,
    ) -> Result<Self, Stop> {
        match region.zip(near) {
            Some((place, near)) => Ok(Self::inside(study, ensemble, place, near)),
            None => Self::of(study, ensemble),
        }
    }

    /// Returns true if its tasks are computed by the executor of `[cases]`.
    fn is_spread(&self, study: &Study) -> bool {
        let stage = Stage::Surrogate;
        let own = self.folder == stage.folder() && self.purpose == Purpose::Study;
        own && study.cases.as_ref().is_some_and(|section| section.common.include(stage))
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
    let purpose = fitting.purpose;
    let used = purpose.used(study, fitting.parameters)?;
    let slopes = gradients::stage(study, &data.value, fitting, run, observer)?;
    let inputs = inputs(study, data, fitting, &used, slopes.as_ref())?;
    let hash = run.hash_of(&fitting.folder, &inputs)?;
    let ensemble = data.value.runs()?;
    observer.begin(purpose.label(), "output", ensemble.layouts.len() as u64);
    let mut kept = run.keep(&fitting.folder, &inputs, observer, |folder| {
        let gradients = slopes.as_ref().map(|kept| &kept.value);
        let fit = Fit { study, data: &data.value, fitting, used: &used, gradients };
        let spreading = Spreading::new(study, Stage::Surrogate, folder, &hash, observer);
        let tasks =
            if fitting.is_spread(study) { Tasks::elsewhere(&spreading) } else { Tasks::here() };
        fit.all(tasks, observer)
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

/// The tasks of the fit in a process that is asked for some of them, as a model.
pub fn elsewhere(
    visit: &Visit,
    data: &Kept<Data>,
    fitting: &Fitting<'_>,
    run: &mut RunDirectory,
    then: Then<'_>,
) -> Result<(), Stop> {
    let study = &visit.study;
    let used = fitting.purpose.used(study, fitting.parameters)?;
    let slopes = gradients::stage(study, &data.value, fitting, run, &Silent)?;
    visit.is_of(run, &inputs(study, data, fitting, &used, slopes.as_ref())?)?;
    let visiting = Visiting::new(visit, then)?;
    let gradients = slopes.as_ref().map(|kept| &kept.value);
    let fit = Fit { study, data: &data.value, fitting, used: &used, gradients };
    let ended = fit.main(Tasks::elsewhere(&visiting), &Silent);
    visiting.end(ended)
}

/// Everything on which a fit depends.
fn inputs(
    study: &Study,
    data: &Kept<Data>,
    fitting: &Fitting<'_>,
    used: &Used,
    slopes: Option<&Kept<Gradients>>,
) -> Result<Value, Stop> {
    let section =
        study.surrogate.as_ref().ok_or_else(|| Stop::new("the study has no surrogate"))?;
    let parameters = used.parameters(fitting.parameters);
    let laws: Vec<_> = parameters.iter().map(|p| (&p.name, &p.design)).collect();
    let inputs = json!([
        data.value.runs_hash(),
        section.built.identity(),
        (&fitting.training, &fitting.validation),
        laws,
        study.about.seed
    ]);
    let inputs = match low_fidelity::identity(study).filter(|_| fitting.purpose == Purpose::Study) {
        Some(identity) => json!([inputs, { "low_fidelity": identity }]),
        None => inputs,
    };
    Ok(match slopes {
        Some(kept) => json!([inputs, { "gradients": kept.hash }]),
        None => inputs,
    })
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
