//! The program in one file: the stages of a study in order, on each of its three routes.
//!
//! A study with a `[target]` samples that density. A study with a `[surrogate]` calibrates with an emulator of its
//! model, any other with the model itself. The stages after the posterior are the same for both. A sequential design
//! repeats simulate and read for each of its batches before the surrogate.
//!
//! ```text
//! emulated  design  simulate  read  surrogate  calibrate (repeated to refine) ┐
//! direct                      read             calibrate                      ┴ evidence validate quantities reliability assess gap report
//! target                                       calibrate                        evidence          quantities reliability assess     report
//! ```

use lacuna::plugin::Density;
use lacuna::plugin::registry::{NoKeys, Section};
use lacuna::run::{Listener, Observer, Silent, Stop, files};
use lacuna_run::progress::Recorded;
use lacuna_run::work::Then;
use lacuna_run::{Kept, RunDirectory, Stage};

use crate::gap::inside::{companion, runs};
use crate::gap::power::{PowerDesign, Rates, stage as power};
use crate::gap::report::reliability::power_page;
use crate::gap::stage as gap;
use crate::posterior::{Given, Posterior};
use crate::report::findings::Findings;
use crate::report::stage as report;
use crate::stage::artifacts::Artifacts;
use crate::stage::calibrate::Calibrated;
use crate::stage::cases::Visit;
use crate::stage::direct::Direct;
use crate::stage::emulated::Emulated;
use crate::stage::evidence::Weighed;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::more_runs::{Intervals, within};
use crate::stage::predictions::{Predicting, Predictor};
use crate::stage::surrogate::Fitting;
use crate::stage::{
    assess, calibrate, contents, design, evidence, grouped, inference_data, low_fidelity, manifest,
    numerical_error, quantities, read, refine, reliability, room, sequential, simulate, surrogate,
    target, validate,
};
use crate::study::Study;

/// Purpose for which a study is run.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Goal<'a> {
    /// Find the posterior.
    Calibrate,
    /// Find the posterior and the physics that the model lacks.
    FindGap,
    /// Compare its predictions of held-out data with this response of the study without its effects.
    Show(&'a [f64]),
}

/// Runs a study: unchanged results are reused, the rest is made.
pub fn run(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    pursue(study, Goal::Calibrate, run, observer)
}

/// Runs a study and searches for physics that its model lacks.
pub fn find_gap(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    if study.target.is_some() {
        return Err(Stop::new("a study with `[target]` has no data to compare with"));
    }
    if study.measurements.is_none() {
        return Err(Stop::new("the study has no `[measurements]` to search for a gap"));
    }
    independent(study)?;
    pursue(study, Goal::FindGap, run, observer)
}

/// Refuses dependent priors, whose curvature the Gauss-Newton fits of the search do not contain, and parameters by group with a
/// surrogate, of which the search trains others.
fn independent(study: &Study) -> Result<(), Stop> {
    if !study.cut().is_empty() {
        let text = "the search for missing physics fits all parameters to the data";
        return Err(Stop::new(text).help("search with a copy of the study without `cut`"));
    }
    if study.is_stochastic() {
        let text = "the search for missing physics needs a response that the parameters determine";
        return Err(
            Stop::new(text).help("search with a copy of the study that has a `[surrogate]`")
        );
    }
    if study.has_populations() || study.hierarchy.trained.is_some() {
        let text = "the search for missing physics does not know populations, nor parameters by group with a surrogate";
        return Err(Stop::new(text).help(
            "search with a copy of the study whose parameters have neither `by` nor `population`",
        ));
    }
    if study.dependence.is_none() {
        return Ok(());
    }
    Err(Stop::new("the search for missing physics needs priors that are independent of each other").help(
        "search with a copy of the study without `[[dependence]]`, `[[constraint]]` and priors of an earlier run",
    ))
}

/// Runs a study with added effects, and compares it on held-out data with the study without them: with its response
/// `before`, calibrated with the remaining data.
pub fn show(
    study: &Study,
    before: &[f64],
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    independent(study)?;
    pursue(study, Goal::Show(before), run, observer)
}

/// Counts which effects a search for what is missing would have found in a study, in many cases made of its own data.
pub fn power(
    study: &Study,
    design: &PowerDesign,
    simulations: Option<usize>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Rates, Stop> {
    if study.target.is_some() {
        return Err(Stop::new(
            "a study with `[target]` has no data in which anything could be planted",
        ));
    }
    independent(study)?;
    run.watch(study.faults());
    run.uses(study.libraries.all().map(|library| library.sha256.clone()));
    let recorded = Recorded::new(run.root(), observer);
    let rates = plant(study, design, simulations, run, &recorded);
    recorded.finish(&rates);
    rates
}

/// Stages of [`power`], and its page.
fn plant(
    study: &Study,
    design: &PowerDesign,
    simulations: Option<usize>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Rates, Stop> {
    let kept = if study.surrogate.is_some() {
        let (emulated, _) = calibrate_emulated(study, run, observer)?;
        power::stage(study, design, simulations, &emulated.problem(), run, observer)?
    } else {
        let direct = Direct::of(study, run, observer)?.fitted(study, run, observer)?;
        power::stage(study, design, simulations, &direct.problem(), run, observer)?
    };
    let page = run.stage_folder(&Stage::Power.folder()).join("power.html");
    files::write_atomic(&page, power_page(&study.about.title, &kept.value).as_bytes())?;
    Ok(kept.value)
}

/// Hands over the cases of [`power()`], in a process that is asked for some of them, as a model.
pub fn power_elsewhere(visit: &Visit, then: Then<'_>) -> Result<(), Stop> {
    let (study, mut run) = (&visit.study, visit.directory()?);
    if study.surrogate.is_some() {
        let (emulated, _) = calibrate_emulated(study, &mut run, &Silent)?;
        power::elsewhere(visit, &emulated.problem(), &mut run, then)
    } else {
        let direct = Direct::of(study, &mut run, &Silent)?.fitted(study, &mut run, &Silent)?;
        power::elsewhere(visit, &direct.problem(), &mut run, then)
    }
}

fn pursue(
    study: &Study,
    goal: Goal<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    contents::before_all(study)?;
    room::check(study, run.root())?;
    manifest::begin(study, run)?;
    let recorded = Recorded::new(run.root(), observer);
    let listener = Listener::new(&recorded);
    let findings = all_stages(study, goal, run, &listener)
        .and_then(|findings| manifest::end(study, run).map(|()| findings));
    recorded.finish(&findings);
    findings
}

fn all_stages(
    study: &Study,
    goal: Goal<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    match (&study.target, &study.surrogate) {
        (Some(given), _) => sample_target(study, given, run, observer),
        (None, Some(_)) => {
            let (emulated, calibrated) = calibrate_emulated(study, run, observer)?;
            conclude(study, goal, &emulated.problem(), calibrated.as_ref(), run, observer)
        }
        (None, None) => {
            let direct = Direct::of(study, run, observer)?.fitted(study, run, observer)?;
            let calibrated = calibrate_direct(study, &direct, run, observer)?;
            conclude(study, goal, &direct.problem(), calibrated.as_ref(), run, observer)
        }
    }
}

/// Stages of a study with a surrogate up to its emulator and the estimates of its errors.
pub fn emulate(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Emulated, Stop> {
    companion::build_added(study)?;
    let (data, region) = runs_to_fit(study, run, observer)?;
    let trained = study.trained();
    let near = region.as_ref().map(|place| within(&trained.parameters, place));
    let fitting = Fitting::over(trained, data.value.runs()?, region.as_deref(), near.as_deref())?;
    let fitted = surrogate::stage(trained, &data, &fitting, run, observer)?;
    let (folders, place) = (numerical_error::folders(), region.as_deref());
    let numerics = numerical_error::stage(trained, &data, place, &folders, run, observer)?;
    let numerics = numerics.map(|own| grouped::numerical_error(study, own));
    let (data, fitted) = grouped::by_group(study, data, fitted);
    let mut emulated = Emulated::new(study, data, fitted, numerics, None)?;
    emulated.region = region;
    runs::build_added(study, &emulated.problem(), run, observer)?;
    Ok(emulated)
}

/// The runs of a study with a surrogate, and the region of those to which it is fitted if that is not all of them.
fn runs_to_fit(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Kept<read::Data>, Option<Intervals>), Stop> {
    // Runs and emulator know no groups.
    let trained = study.trained();
    let placed = design::stage(trained, run, observer)?;
    let simulated = simulate::stage(trained, placed.as_ref(), run, observer)?;
    let data = read::stage(study, simulated.as_ref(), run, observer)?;
    let data = low_fidelity::stage(study, placed.as_ref(), data, run, observer)?;
    sequential::stage(study, data, run, observer)
}

/// Hands over the tasks of the fit of a surrogate, in a process that is asked for some of them, as a model.
pub fn surrogate_elsewhere(visit: &Visit, then: Then<'_>) -> Result<(), Stop> {
    let (study, mut run) = (&visit.study, visit.directory()?);
    let (data, region) = runs_to_fit(study, &mut run, &Silent)?;
    let trained = study.trained();
    let near = region.as_ref().map(|place| within(&trained.parameters, place));
    let fitting = Fitting::over(trained, data.value.runs()?, region.as_deref(), near.as_deref())?;
    surrogate::elsewhere(visit, &data, &fitting, &mut run, then)
}

/// Stages of a study with a surrogate up to the posterior, which exists if the study has measurements.
pub fn calibrate_emulated(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Emulated, Option<Kept<Calibrated>>), Stop> {
    let emulated = emulate(study, run, observer)?;
    refine::stage(study, emulated, run, observer)
}

/// Posterior of a study without a surrogate.
fn calibrate_direct(
    study: &Study,
    direct: &Direct<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Calibrated>>, Stop> {
    let folder = Stage::Calibrate.folder();
    let calibrated = calibrate::stage(study, &direct.problem(), &folder, run, observer)?;
    if let Some(tally) = direct.tally() {
        // The number depends on where a run was interrupted; the assessment counts the failures anew.
        observer.remark(&tally);
    }
    Ok(calibrated)
}

/// Evidence, validation, gap and report of a calibration.
fn conclude(
    study: &Study,
    goal: Goal<'_>,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    let weighed = weigh(study, problem, calibrated, run, observer)?;
    let validated = validate::stage(study, problem, calibrated, run, observer)?;
    let quantified = quantities::stage(study, problem, calibrated, run, observer)?;
    let rare = reliability::stage(study, problem, calibrated, run, observer)?;
    let made = Artifacts {
        problem: Some(problem),
        calibrated,
        weighed: weighed.as_ref(),
        validated: validated.as_ref(),
        quantities: quantified.as_ref(),
        reliability: rare.as_ref(),
    };
    let assessed = assess::stage(study, &made, run, observer)?;
    let gap = match goal {
        Goal::FindGap => gap::stage(study, problem, run, observer)?,
        // A report that is written again keeps the result of an earlier search.
        Goal::Calibrate | Goal::Show(_) => gap::kept(study, problem, run, observer)?,
    };
    let gap = gap.map(|kept| match power::kept(study, problem, run) {
        Some(counted) if counted.reliability.cases() > 0 => {
            Kept { value: kept.value.corrected(counted.reliability), ..kept }
        }
        _ => kept,
    });
    if let Goal::Show(before) = goal {
        gap::show::stage(study, problem, calibrated, before, run, observer)?;
    }
    if let Some(calibrated) = calibrated {
        let (weighed, validated) = (weighed.as_ref(), validated.as_ref());
        let quantities = quantified.as_ref();
        let finished = inference_data::Finished { calibrated, weighed, validated, quantities };
        inference_data::stage(study, problem, &finished, run)?;
    }
    let results = report::Results { artifacts: made, assessed: &assessed, gap: gap.as_ref() };
    report::stage(study, &results, run, observer)
}

/// Evidence of a calibration, if there is one.
fn weigh(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Weighed>>, Stop> {
    let (Some(calibrated), Some(measured)) = (calibrated, &problem.data.value.measured) else {
        return Ok(None);
    };
    let parts = calibrate::Parts::of(study, measured, problem)?;
    let centred: Vec<f64> = calibrated.value.outcome.centred().collect();
    let posterior = parts.posterior(study, problem).with_centred(&centred, &[]);
    let densities = Predicting {
        forward: problem.forward(),
        likelihood: parts.likelihood(),
        law: calibrate::Law::of(study, measured, problem)?,
        data: &measured.likelihood,
    };
    let predictive = calibrate::Parts::predicting(study, measured, problem)?;
    let predictor = Predictor { densities, makes: predictive.likelihood() };
    evidence::stage(study, &posterior, calibrated, Some(&predictor), run, observer).map(Some)
}

/// Samples a given log density: nothing is simulated, read or emulated.
fn sample_target(
    study: &Study,
    target: &Section<dyn Density, NoKeys>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    let density = target.built.plugin.bind(&study.parameters)?;
    let likelihood = if target.built.plugin.includes_prior() {
        Given::posterior(&*density, study.prior())
    } else {
        Given::likelihood(&*density)
    };
    let posterior = Posterior::new(study.prior(), likelihood);
    let calibrated = target::stage(study, target, &posterior, run, observer)?;
    let weighed = evidence::stage(study, &posterior, &calibrated, None, run, observer)?;
    let quantified = quantities::of_target(study, &calibrated, run, observer)?;
    let rare = reliability::of_target(study, &posterior, &calibrated, run, observer)?;
    let finished = inference_data::Finished {
        calibrated: &calibrated,
        weighed: Some(&weighed),
        validated: None,
        quantities: quantified.as_ref(),
    };
    inference_data::of_target(study, &posterior, &finished, run)?;
    let made = Artifacts {
        problem: None,
        calibrated: Some(&calibrated),
        weighed: Some(&weighed),
        validated: None,
        quantities: quantified.as_ref(),
        reliability: rare.as_ref(),
    };
    let assessed = assess::stage(study, &made, run, observer)?;
    let results = report::Results { artifacts: made, assessed: &assessed, gap: None };
    report::stage(study, &results, run, observer)
}
