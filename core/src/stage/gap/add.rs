//! The study with what is missing: written, run, and compared with the study without.

use std::path::Path;

use super::show::{self, Shown};
use super::{FOLDER, study_file};
use crate::gap::added::{Added, Moved, Posterior};
use crate::plugin::effect::Placed;
use crate::report::findings::{CalibrationFindings, Findings, GapFindings, Role};
use crate::run::{Artifact as _, Observer, RunDirectory, Stop, files};
use crate::stage;
use crate::study::Study;
use crate::study::resolve;

const FILE: &str = "added.toml";

/// A study with its file, its run and what was set on the command line.
pub struct Begun<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its file.
    pub path: &'a Path,
    /// The folder into which the study with the effects is written; beside the study's file when left out.
    pub folder: Option<&'a Path>,
    /// What was set on the command line.
    pub settings: &'a [String],
    /// What it found.
    pub findings: &'a Findings,
    /// What is missing.
    pub gap: &'a GapFindings,
}

/// Writes the study with the effects, runs it in a directory beside that of the study, and keeps what both found.
pub fn add(
    begun: &Begun<'_>,
    run: &RunDirectory,
    observer: &dyn Observer,
) -> Result<(Added, Findings), Stop> {
    let Begun { study, path, folder, settings, findings, gap } = begun;
    let account = &gap.account;
    let file = study_file::write(study, path, *folder, account)?;
    let checked = resolve::load(&file, settings);
    let complaints = checked.complaints();
    let Some(augmented) = checked.study else {
        return Err(Stop::new(format!(
            "the study with the effects, {}, has problems:\n{complaints}",
            file.display()
        ))
        .help("mend it there and run it with `lacuna run`: nothing that was found is lost"));
    };
    let own = run.root().file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = run.root().with_file_name(study_file::with_names(&own, study, account));
    let mut directory = RunDirectory::open(&folder)?;
    if !account.additions.iter().any(|addition| addition.model) {
        directory.adopt(run.root(), is_of_the_model)?;
    }
    let with = stage::show(&augmented, &account.response[0], &mut directory, observer)?;
    let shown = Shown::load(&directory.stage_folder(show::FOLDER))?;
    let added = Added {
        search: gap.hash.clone(),
        study: file,
        run: folder,
        parameters: moved(findings, &with),
        unknowns: unknowns(study, &augmented, &with),
        log_evidence: evidence(findings).zip(evidence(&with)).map(|(a, b)| [a, b]),
        held_out: shown.held_out,
    };
    files::write_toml(&run.stage_folder(FOLDER).join(FILE), &added)?;
    Ok((added, with))
}

/// What was added after this search, if it was.
pub fn kept(run: &RunDirectory, search: &str) -> Option<Added> {
    let added: Added = files::read_toml(&run.stage_folder(FOLDER).join(FILE)).ok()?;
    (added.search == search).then_some(added)
}

/// Stages that effects on the response do not change: the runs, the data, the surrogate.
fn is_of_the_model(stage: &str) -> bool {
    ["1-", "2-", "3-", "4-"].iter().any(|begin| stage.starts_with(begin))
}

fn evidence(findings: &Findings) -> Option<f64> {
    Some(findings.calibration.as_ref()?.evidence.as_ref()?.log)
}

fn moved(before: &Findings, after: &Findings) -> Vec<Moved> {
    let (Some(before), Some(after)) = (&before.calibration, &after.calibration) else {
        return Vec::new();
    };
    let both = before.coordinates.iter().filter(|c| c.role == Role::Parameter).filter_map(|c| {
        let other = after.coordinates.iter().find(|other| other.name == c.name)?;
        Some(Moved {
            name: c.name.clone(),
            unit: c.unit.clone(),
            mean: [c.mean, other.mean],
            sd: [c.sd, other.sd],
        })
    });
    both.collect()
}

/// The unknowns of the effects of a study: those on the response, and the parameters that it has besides those of `before`.
fn unknowns(before: &Study, study: &Study, findings: &Findings) -> Vec<Posterior> {
    let effects = study.placed_effects();
    let on_top = effects.iter().flat_map(Placed::hyperparameters).map(|unknown| unknown.name);
    let new = |name: &str| !before.parameters.iter().any(|known| known.name == name);
    let inside = study.parameters.iter().map(|p| p.name.clone()).filter(|name| new(name));
    let names: Vec<String> = inside.chain(on_top).collect();
    let of = |calibration: &CalibrationFindings| -> Vec<Posterior> {
        let own = calibration.coordinates.iter().filter(|c| names.contains(&c.name));
        own.map(|c| Posterior {
            name: c.name.clone(),
            unit: c.unit.clone(),
            mean: c.mean,
            sd: c.sd,
            interval: [c.q025, c.q975],
        })
        .collect()
    };
    findings.calibration.as_ref().map(of).unwrap_or_default()
}
