//! Coverage of a study's intervals: truths are drawn from the prior, data are generated from them, and each data set is
//! calibrated like the study.

mod ground;
mod log;
mod noise;
mod trial;
mod truths;

use std::path::Path;

use lacuna::diagnose::coverage::{Case, Coordinate, Coverage, Ended, Noise, tally};
use lacuna::run::{Observer, Progress, Silent, Stop, files};
use lacuna::text::memory::{NUMBER, amount, of_machine};
use lacuna_run::progress::Recorded;
use lacuna_run::work::Then;
use lacuna_run::{Artifact, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::stage::cases::{self, Visit};
use crate::study::Study;
use ground::Ground;
use log::Log;

const CASES: &str = "cases.json";

/// Options of a coverage study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    /// Number of truths.
    pub count: usize,
    /// True if chains are half as long, for samplers whose steps are draws.
    pub quick: bool,
    /// Source of the noise in the generated data; `None` for the default.
    pub noise: Option<Noise>,
    /// True if truths are held-out runs, even if the model could be run.
    pub from_runs: bool,
}

/// Default number of truths, which determines coverage to a few per cent.
pub const COUNT: usize = 200;
/// Number of truths of a quick look.
pub const QUICK: usize = 40;
/// Number of replicates of every measured value from which on their residuals are the default noise.
///
/// Along one direction n replicates determine the variance of their noise with relative error `sqrt(2 / (n - 1))`: 47 %
/// for ten.
const ENOUGH: usize = 10;

/// Cases as they are kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Cases {
    cases: Vec<Tried>,
}

/// A case with the scatter of its replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Tried {
    case: Case,
    /// Mean variance between replicates, if there are any.
    scatter: Option<f64>,
}

impl Artifact for Cases {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(CASES), self)?;
        Ok(vec![CASES.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join(CASES))
    }
}

/// Counts how often the study's intervals contain the truth. Finished cases are kept one by one, so that an interrupted
/// run continues, and one with more truths reuses them.
pub fn coverage(
    study: &Study,
    asked: &Asked,
    directory: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Coverage, Stop> {
    refuse(study)?;
    fits(study, asked.count)?;
    directory.watch(study.faults());
    directory.uses(study.libraries.all().map(|library| library.sha256.clone()));
    let recorded = Recorded::new(directory.root(), observer);
    let found = counted(study, asked, directory, &recorded);
    recorded.finish(&found);
    found
}

/// Cases of [`coverage`], their count and its page.
fn counted(
    study: &Study,
    asked: &Asked,
    directory: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Coverage, Stop> {
    let ground = Ground::of(study, asked, directory, observer)?;
    let inputs = inputs(&ground);
    let hash = directory.hash_of(&Stage::Coverage.folder(), &inputs)?;
    let wanted = ground.count();
    if directory.has(&Stage::Coverage.folder(), &inputs)? {
        let there = Cases::load(&directory.stage_folder(&Stage::Coverage.folder()))
            .map_or(0, |kept| kept.cases.len());
        if there < wanted {
            directory.reopen(&Stage::Coverage.folder())?;
        }
    }
    observer.begin(Stage::Coverage.label(), "truth", wanted as u64);
    let kept = directory.keep(&Stage::Coverage.folder(), &inputs, observer, |folder| {
        let (inputs, asked) = (&hash, json!(asked));
        let all = cases::Cases { study, stage: Stage::Coverage, folder, inputs, asked };
        tried(&ground, &all, observer).map(|cases| Cases { cases })
    })?;
    let counted = &kept.value.cases[..wanted.min(kept.value.cases.len())];
    let cases: Vec<Case> = counted.iter().map(|tried| tried.case.clone()).collect();
    let tally = tally(&ground.coordinates, &cases);
    observer.end(
        Stage::Coverage.label(),
        &format!("{} of {} calibrated", tally.calibrated, tally.truths),
    );
    let found = Coverage {
        title: study.about.title.clone(),
        study: study.name.clone(),
        seed: study.about.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        quick: asked.quick,
        noise: ground.noise,
        source: ground.source,
        noise_ratio: ratio(&ground, counted),
        notes: ground.notes(asked),
        tally,
    };
    let folder = directory.stage_folder(&Stage::Coverage.folder());
    files::write_json(&folder.join("coverage.json"), &found)?;
    files::write_atomic(
        &folder.join("coverage.html"),
        crate::report::coverage_page(&found).as_bytes(),
    )?;
    Ok(found)
}

fn refuse(study: &Study) -> Result<(), Stop> {
    if study.target.is_some() {
        return Err(Stop::new("a study with `[target]` has no data to generate from a truth"));
    }
    if study.is_stochastic() {
        let text =
            "the data of a stochastic model cannot be generated from one response to a truth";
        return Err(Stop::new(text).help("calibrate data that the model itself generated"));
    }
    let missing = [
        ("measurements", study.measurements.is_none()),
        ("discrepancy", study.discrepancy.is_none()),
        ("sampler", study.sampler.is_none()),
    ];
    match missing.iter().find(|(_, missing)| *missing) {
        Some((section, _)) => Err(Stop::new(format!(
            "the study has no `[{section}]`, which is needed to generate and calibrate the data of a truth"
        ))
        .help(format!(
            "add `[{section}]`: replicates and gaps of the data are those of the measurements"
        ))),
        None => Ok(()),
    }
}

/// Refuses a number of truths that this machine cannot hold with their responses.
fn fits(study: &Study, count: usize) -> Result<(), Stop> {
    let Some(memory) = of_machine() else { return Ok(()) };
    let values = study.parameters.len() + study.layouts.len();
    let bytes = NUMBER * values as f64 * count as f64;
    if bytes <= memory {
        return Ok(());
    }
    let (needed, has) = (amount(bytes), amount(memory));
    let text = format!(
        "{count} truths with their responses need {needed} of memory; this machine has {has}"
    );
    Err(Stop::new(text).help("ask for fewer: `--count`"))
}

/// Everything on which the cases depend, except for their numbers.
fn inputs(ground: &Ground<'_>) -> Value {
    json!([ground.inputs(), (ground.quick, ground.noise, ground.source), ground.study.about.seed])
}

impl cases::Outcome for Tried {
    /// A calibration that stopped may not have stopped for a reason of the study.
    fn is_settled(&self) -> bool {
        !matches!(self.case.ended, Ended::Failed(_))
    }
}

/// The cases in a process that is asked for some of them, as a model.
pub fn elsewhere(visit: &Visit, then: Then<'_>) -> Result<(), Stop> {
    let mut directory = visit.directory()?;
    let ground = Ground::of(&visit.study, &visit.asked()?, &mut directory, &Silent)?;
    let folder = directory.stage_folder(&visit.stage.folder());
    let make = |number: usize| trial::run(&ground, number, &folder);
    visit.serve(&directory, &inputs(&ground), &make, then)
}

/// All cases; those of an interrupted run are read from its file.
fn tried(
    ground: &Ground<'_>,
    all: &cases::Cases<'_>,
    observer: &dyn Observer,
) -> Result<Vec<Tried>, Stop> {
    let folder = all.folder;
    let log = Log::open(folder)?;
    let progress = Progress::new(observer);
    let missing: Vec<usize> = (0..ground.count()).filter(|&number| !log.has(number)).collect();
    progress.add((ground.count() - missing.len()) as u64);
    let make = |number: usize| trial::run(ground, number, folder);
    let note = |number: usize, tried: Tried| {
        log.note(number, tried)?;
        progress.add(1);
        Ok(())
    };
    all.compute(&missing, &make, &note, observer)?;
    // The folders of the cases have been removed, except for refined cases.
    let _ = std::fs::remove_dir(folder.join("cases"));
    Ok(log.into_cases())
}

/// Ratio of the scatter between replicates in the generated data to that in the study's own, as standard deviations.
fn ratio(ground: &Ground<'_>, tried: &[Tried]) -> Option<f64> {
    let own = noise::scatter(&ground.measured().used)?;
    let made: Vec<f64> = tried.iter().filter_map(|tried| tried.scatter).collect();
    (!made.is_empty() && own > 0.0).then(|| (lacuna::math::moments::mean(&made) / own).sqrt())
}

/// A case without data, or whose calibration stopped.
fn ended(number: usize, ended: Ended) -> Tried {
    Tried { case: Case { number, ended }, scatter: None }
}

/// Unknowns of a study: its parameters, those of its effects, those of its discrepancy, each with the flag that its
/// truths are drawn from the prior.
fn coordinates(
    study: &Study,
    hyper: &[lacuna::plugin::Hyperparameter],
    own: usize,
    noise: Noise,
) -> Vec<Coordinate> {
    let parameters = study.parameters.iter().map(|p| Coordinate {
        name: p.name.clone(),
        unit: p.unit.clone(),
        prior: p.prior.clone(),
        of_prior: true,
    });
    let effects = hyper.len() - own;
    let hyper = hyper.iter().enumerate().map(|(i, h)| Coordinate {
        name: h.name.clone(),
        unit: h.unit.clone(),
        prior: h.prior.clone(),
        of_prior: i < effects || noise == Noise::Prior,
    });
    // With residuals of replicates the discrepancy's unknowns have no true value.
    let known = if noise == Noise::Replicates { effects } else { effects + own };
    parameters.chain(hyper.take(known)).collect()
}
