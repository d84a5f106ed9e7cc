//! What a study's own files hold, looked at before anything is run: what `run` would refuse.

use crate::data::{Ensemble, Scenario};
use crate::plugin::Reader;
use crate::plugin::reader::{EnsembleSource, ReadError};
use crate::plugin::registry::entries;
use crate::run::Stop;
use crate::study::Study;

use super::{imports, read, surrogate};

/// Everything that is wrong with the files that a study names, each in the words of the run that refuses it. No model
/// and no interpreter is run; files are opened by the study's readers.
pub fn check(study: &Study) -> Vec<Stop> {
    let mut wrong = measurements(study).err().unwrap_or_default();
    wrong.extend(simulations(study));
    wrong.extend(imports::read(study).err());
    wrong
}

/// Refuses measurements that no run could use: before a campaign, not after it.
pub(super) fn before_all(study: &Study) -> Result<(), Stop> {
    measurements(study).map_err(|all| one(&all))
}

/// Several reasons to stop as one.
pub(super) fn one(all: &[Stop]) -> Stop {
    let texts: Vec<String> = all.iter().map(Stop::to_string).collect();
    Stop::new(texts.join("\n"))
}

/// Each error of several files as a stop of its own.
pub(super) fn each(errors: Vec<ReadError>) -> Vec<Stop> {
    let mut told: Vec<Stop> = Vec::new();
    for stop in errors.into_iter().flat_map(ReadError::into_each).map(Stop::from) {
        // Scenarios may share a file.
        if !told.contains(&stop) {
            told.push(stop);
        }
    }
    told
}

/// Whether the plugin is there: `check` loads no library.
fn is_there(name: &str) -> bool {
    entries::<dyn Reader>().iter().any(|entry| entry.name == name)
}

fn measurements(study: &Study) -> Result<(), Vec<Stop>> {
    if !study.measurements.as_ref().is_some_and(|s| is_there(s.built.name)) {
        return Ok(());
    }
    let measured = read::measured_or_all(study)?;
    let states_noise = measured.is_some_and(|measured| measured.read.states_noise());
    if states_noise { can_use_noise(study).map_err(|stop| vec![stop]) } else { Ok(()) }
}

/// Noise that the measurements state is used or refused.
fn can_use_noise(study: &Study) -> Result<(), Stop> {
    let added = study.measurements.as_ref().is_some_and(|s| !s.common.added_curves.is_empty());
    if added {
        let text =
            "the measurements state their own noise, and nothing states that of `added_curves`";
        return Err(Stop::new(text).help("take `added_curves` out of `[measurements]`"));
    }
    let Some(section) = &study.discrepancy else { return Ok(()) };
    if section.built.plugin.takes_stated_noise() {
        return Ok(());
    }
    let advice = "`lacuna plugins discrepancy` lists the others; `ignore = [\"sigma\"]` in `[measurements]` leaves the \
                  column out";
    let name = section.built.name;
    let text = format!(
        "the measurements state their own noise (`sigma` or `covariance`), which the discrepancy `{name}` cannot use"
    );
    Err(Stop::new(text).help(advice))
}

fn simulations(study: &Study) -> Vec<Stop> {
    let Some(section) = study.simulations.as_ref() else { return Vec::new() };
    let plugin = &*section.built.plugin;
    if study.surrogate.is_none() || !is_there(section.built.name) || !plugin.names_files() {
        return Vec::new();
    }
    let read = |scenario: &Scenario| -> Option<Result<Ensemble, ReadError>> {
        let (layout, _) = study.layouts.of_scenario(&scenario.name)?;
        let source = EnsembleSource {
            directory: &study.directory,
            simulated: None,
            parameters: &study.parameters,
            scenario: scenario.label(),
            layout: &layout,
        };
        Some(plugin.ensemble(&source))
    };
    // With a single scenario what is read is all, and is not read twice.
    let ensemble = if study.scenarios.len() == 1 {
        read::ensemble(study, None).map_err(|stop| vec![stop])
    } else {
        let errors: Vec<ReadError> =
            study.scenarios.iter().filter_map(&read).filter_map(Result::err).collect();
        if errors.is_empty() {
            read::ensemble(study, None).map_err(|stop| vec![stop])
        } else {
            Err(each(errors))
        }
    };
    match ensemble {
        Err(stops) => stops,
        Ok(ensemble) => surrogate::Fitting::of(study, &ensemble).err().into_iter().collect(),
    }
}
