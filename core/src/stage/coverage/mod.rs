//! Whether a study's intervals hold the truth: truths are drawn from the prior, data are made of them, and each is
//! calibrated as the study is.

mod ground;
mod log;
mod noise;
mod trial;
mod truths;

use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::diagnose::coverage::{Case, Coordinate, Coverage, Ended, Noise, tally};
use crate::run::{Artifact, Observer, Progress, RunDirectory, Stop, files};
use crate::study::Study;

use ground::Ground;
use log::Log;

/// The folder of the cases.
pub const FOLDER: &str = "7-coverage";
const CASES: &str = "cases.json";

/// What is asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    /// The number of truths.
    pub count: usize,
    /// Whether chains are half as long, where the steps of the sampler are draws.
    pub quick: bool,
    /// The noise of the data that are made.
    pub noise: Option<Noise>,
    /// Whether truths are runs that are held back, even where the model could be run.
    pub from_runs: bool,
}

/// The number of truths that tells coverage to a few per cent.
pub const COUNT: usize = 200;
/// The number of truths of a first look.
pub const QUICK: usize = 40;
/// From so many replicates of every measured value on their residuals are the noise, where nothing else is asked.
///
/// Along one direction n replicates know the variance of their noise to `sqrt(2 / (n - 1))`: ten to 47 %.
const ENOUGH: usize = 10;

/// The cases as they are kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Cases {
    cases: Vec<Tried>,
}

/// A case with the scatter of its replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Tried {
    case: Case,
    /// The mean variance between replicates, where there are any.
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

/// Counts how often the study's intervals hold the truth. Finished cases are kept one by one, so that an interrupted run goes
/// on, and one with more truths takes those that are there.
pub fn coverage(
    study: &Study,
    asked: &Asked,
    directory: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Coverage, Stop> {
    refuse(study)?;
    directory.watch(study.faults());
    let ground = Ground::of(study, asked, directory, observer)?;
    let inputs =
        json!([ground.inputs(), (asked.quick, ground.noise, ground.source), study.about.seed]);
    let wanted = ground.count();
    if directory.has(FOLDER, &inputs)? {
        let there = Cases::load(&directory.stage_folder(FOLDER)).map_or(0, |kept| kept.cases.len());
        if there < wanted {
            directory.reopen(FOLDER)?;
        }
    }
    observer.begin("coverage", "truth", wanted as u64);
    let kept = directory.keep(FOLDER, &inputs, observer, |folder| {
        cases(&ground, folder, observer).map(|cases| Cases { cases })
    })?;
    let tried = &kept.value.cases[..wanted.min(kept.value.cases.len())];
    let cases: Vec<Case> = tried.iter().map(|tried| tried.case.clone()).collect();
    let tally = tally(&ground.coordinates, &cases);
    observer.end("coverage", &format!("{} of {} calibrated", tally.calibrated, tally.truths));
    let found = Coverage {
        title: study.about.title.clone(),
        study: study.name.clone(),
        seed: study.about.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        quick: asked.quick,
        noise: ground.noise,
        source: ground.source,
        noise_ratio: ratio(&ground, tried),
        notes: ground.notes(asked),
        tally,
    };
    let folder = directory.stage_folder(FOLDER);
    files::write_json(&folder.join("coverage.json"), &found)?;
    files::write_atomic(
        &folder.join("coverage.html"),
        crate::report::coverage_page(&found).as_bytes(),
    )?;
    Ok(found)
}

fn refuse(study: &Study) -> Result<(), Stop> {
    if study.target.is_some() {
        return Err(Stop::new("a study with `[target]` has no data that could be made of a truth"));
    }
    let missing = [
        ("measurements", study.measurements.is_none()),
        ("discrepancy", study.discrepancy.is_none()),
        ("sampler", study.sampler.is_none()),
    ];
    match missing.iter().find(|(_, missing)| *missing) {
        Some((section, _)) => Err(Stop::new(format!(
            "the study has no `[{section}]`, with which the data of a truth are made and calibrated"
        ))
        .help(format!(
            "add `[{section}]`: replicates and gaps of the data are those of the measurements"
        ))),
        None => Ok(()),
    }
}

/// All cases, those of an interrupted run taken from its file.
fn cases(ground: &Ground<'_>, folder: &Path, observer: &dyn Observer) -> Result<Vec<Tried>, Stop> {
    let log = Log::open(folder)?;
    let progress = Progress::new(observer);
    (0..ground.count()).into_par_iter().try_for_each(|number| -> Result<(), Stop> {
        if !log.has(number) {
            log.note(number, trial::run(ground, number, folder)?)?;
        }
        progress.add(1);
        Ok(())
    })?;
    // The folders of the cases are gone, but for those that were refined.
    let _ = std::fs::remove_dir(folder.join("cases"));
    Ok(log.into_cases())
}

/// The scatter between replicates in the data that were made over that in the study's own, as standard deviations.
fn ratio(ground: &Ground<'_>, tried: &[Tried]) -> Option<f64> {
    let own = noise::scatter(&ground.measured().used)?;
    let made: Vec<f64> = tried.iter().filter_map(|tried| tried.scatter).collect();
    (!made.is_empty() && own > 0.0).then(|| (crate::math::moments::mean(&made) / own).sqrt())
}

/// A case that has no data, or whose calibration stopped.
fn ended(number: usize, ended: Ended) -> Tried {
    Tried { case: Case { number, ended }, scatter: None }
}

/// The unknowns of a study: its parameters, those of its effects, those of its discrepancy, with what of them is drawn
/// from the priors.
fn coordinates(
    study: &Study,
    hyper: &[crate::plugin::Hyperparameter],
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
    // Residuals of replicates have no unknown of the discrepancy's.
    let known = if noise == Noise::Replicates { effects } else { effects + own };
    parameters.chain(hyper.take(known)).collect()
}
