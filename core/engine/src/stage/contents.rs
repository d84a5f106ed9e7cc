//! Checks of the contents of a study's own files before anything is run, for faults that `run` would reject.

use lacuna::data::{Ensemble, Scenario};
use lacuna::plugin::Reader;
use lacuna::plugin::reader::{EnsembleSource, ReadError};
use lacuna::plugin::registry::entries;
use lacuna::run::Stop;

use super::{imports, read, surrogate};
use crate::study::Study;

/// Number of measured values, or all faults in the files that a study names, with the messages of the run that would reject
/// them. No model and no interpreter is started; files are opened by the study's readers.
pub fn check(study: &Study) -> Result<usize, Vec<Stop>> {
    let (measured, mut wrong) = match measurements(study) {
        Ok(measured) => (measured, Vec::new()),
        Err(wrong) => (0, wrong),
    };
    wrong.extend(simulations(study));
    wrong.extend(imports::read(study).err());
    if wrong.is_empty() { Ok(measured) } else { Err(wrong) }
}

/// Rejects measurements that no run could use, before a simulation campaign rather than after it.
pub fn before_all(study: &Study) -> Result<(), Stop> {
    measurements(study).map(|_| ()).map_err(|all| one(&all))
}

/// Combines several errors into one.
pub(super) fn one(all: &[Stop]) -> Stop {
    let texts: Vec<String> = all.iter().map(Stop::to_string).collect();
    Stop::new(texts.join("\n"))
}

/// Converts each error of several files into an error of its own.
pub(super) fn each(errors: Vec<ReadError>) -> Vec<Stop> {
    let mut told: Vec<Stop> = Vec::new();
    for stop in errors.into_iter().flat_map(ReadError::into_each).map(Stop::from) {
        // Scenarios may share a file, whose errors are reported once.
        if !told.contains(&stop) {
            told.push(stop);
        }
    }
    told
}

/// Returns true if the plugin is available: `check` loads no library.
fn is_there(name: &str) -> bool {
    entries::<dyn Reader>().iter().any(|entry| entry.name == name)
}

/// Number of measured values.
fn measurements(study: &Study) -> Result<usize, Vec<Stop>> {
    if !study.measurements.as_ref().is_some_and(|s| is_there(s.built.name)) {
        return Ok(0);
    }
    let Some(measured) = read::measured_or_all(study)? else { return Ok(0) };
    if measured.read.states_noise() {
        can_use_noise(study).map_err(|stop| vec![stop])?;
    }
    Ok(measured.read.count())
}

/// Checks that noise stated by the measurements can be used.
fn can_use_noise(study: &Study) -> Result<(), Stop> {
    let added = study.measurements.as_ref().is_some_and(|s| !s.common.added_curves.is_empty());
    if added {
        let text =
            "the measurements state their own noise, but the noise of `added_curves` is not stated";
        return Err(Stop::new(text).help("remove `added_curves` from `[measurements]`"));
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
    let study = study.trained();
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
    // With a single scenario the ensemble is complete as read, and is not read twice.
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
        Ok(ensemble) => {
            let inside = read::outside::refuse(study, &ensemble);
            let fits = inside.and_then(|()| surrogate::Fitting::of(study, &ensemble).map(drop));
            fits.err().into_iter().collect()
        }
    }
}
