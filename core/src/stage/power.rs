//! What the gap workflow would find in a study: everything that it can name, planted in the study's own noise.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::Path;
use std::sync::Mutex;

use rayon::prelude::*;
use serde_json::json;

use crate::gap::power::{Amount, Ground, Outcome, Rates, plan, rates, run};
use crate::run::{Artifact, Kept, Observer, Progress, RunDirectory, Stop, files};
use crate::study::Study;

use super::gap::search::{Beginning, Inside, Prepared, prepared};
use super::gap_model::Pieces;
use super::{Known, direct, gap, learn};

const CASES: &str = "cases.jsonl";
const FILE: &str = "power.json";

impl Artifact for Rates {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join(FILE))
    }
}

/// Runs a study as far as its data and emulator, and the search on many cases made of them. Finished cases are kept one by
/// one, so that an interrupted run goes on.
pub fn power(
    study: &Study,
    amount: &Amount,
    simulations: Option<usize>,
    directory: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Rates, Stop> {
    if study.target.is_some() {
        return Err(Stop::new(
            "a study with `[target]` has no data in which anything could be planted",
        ));
    }
    directory.watch(study.faults());
    let kept = if study.surrogate.is_some() {
        let (learned, _) = learn(study, directory, observer)?;
        with(study, amount, simulations, &learned.known(), directory, observer)?
    } else {
        let ready = direct::Prepared::of(study, directory, observer)?;
        with(study, amount, simulations, &ready.known(), directory, observer)?
    };
    Ok(kept.value)
}

fn with(
    study: &Study,
    amount: &Amount,
    simulations: Option<usize>,
    known: &Known<'_>,
    directory: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Rates>, Stop> {
    let inputs = json!([gap::inputs(study, known), amount, simulations]);
    let pieces = Pieces::of(study)?;
    let inside = Inside::of(pieces.as_ref(), study, known, directory, observer)?;
    directory.keep("7-power", &inputs, observer, |folder| {
        let beginning = Beginning::own(study, known, &inside);
        prepared(study, known, &beginning, &super::stream(study, "gap"), |prepared| {
            outcomes(prepared, amount, simulations, folder, observer)
        })
        .map(|outcomes| rates(&outcomes))
    })
}

/// The outcomes of all cases, those of an interrupted run taken from its file.
fn outcomes(
    prepared: &Prepared<'_>,
    amount: &Amount,
    simulations: Option<usize>,
    folder: &Path,
    observer: &dyn Observer,
) -> Result<Vec<Outcome>, Stop> {
    let found = prepared.search()?;
    // What the data themselves hide is part of no case.
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    let mut options = prepared.options;
    options.simulations = simulations.unwrap_or(options.simulations);
    let ground = Ground {
        experiment: prepared.experiment,
        candidates: prepared.candidates,
        options,
        fit: &first.fit,
        noise: &found.noise,
    };
    let plan = plan(amount, prepared.candidates);
    let path = folder.join(CASES);
    let done = Mutex::new(read(&path)?);
    let file = Mutex::new(append(&path)?);
    observer.begin("power", "case", plan.len() as u64);
    let progress = Progress::new(observer);
    let stream = prepared.random.named("power");
    plan.par_iter().enumerate().try_for_each(|(case, wanted)| -> Result<(), Stop> {
        let is_done = done.lock().is_ok_and(|done| done.contains_key(&case));
        if !is_done {
            let outcome = run(&ground, case, wanted, &stream.at(case as u64));
            write(&file, &path, case, outcome.as_ref())?;
            if let Ok(mut done) = done.lock() {
                done.insert(case, outcome);
            }
        }
        progress.add(1);
        Ok(())
    })?;
    let done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    observer.end("power", &format!("{} cases", done.len()));
    Ok(done.into_values().flatten().collect())
}

/// The finished cases; a last line that was cut is no case.
fn read(path: &Path) -> Result<BTreeMap<usize, Option<Outcome>>, Stop> {
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let text = String::from_utf8_lossy(&files::read(path)?).into_owned();
    Ok(text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect())
}

/// The file to which cases are added, a last line that was cut ended.
fn append(path: &Path) -> Result<File, Stop> {
    let is_cut = path.exists() && !files::read(path)?.ends_with(b"\n");
    let mut file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(path)
        .map_err(|error| files::cannot_write(path, &error))?;
    if is_cut {
        file.write_all(b"\n").map_err(|error| files::cannot_write(path, &error))?;
    }
    Ok(file)
}

fn write(
    file: &Mutex<File>,
    path: &Path,
    case: usize,
    outcome: Option<&Outcome>,
) -> Result<(), Stop> {
    let line = json!([case, outcome]).to_string() + "\n";
    let mut file = file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    file.write_all(line.as_bytes()).map_err(|error| files::cannot_write(path, &error))
}
