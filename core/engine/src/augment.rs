//! The study with the effects that were found: written, run, and compared with the study without them.

use std::path::Path;

use lacuna::plugin::effect::Placed;
use lacuna::run::{Observer, Stop};
use lacuna_run::{Artifact as _, RunDirectory, Stage};

use crate::gap::result::added::{Augmented, ParameterChange, UnknownPosterior};
use crate::gap::result::{GapFindings, added};
use crate::gap::stage::show::AugmentedProof;
use crate::gap::stage::study_file;
use crate::pipeline;
use crate::report::findings::{CalibrationFindings, Findings, Role};
use crate::study::{Study, resolve};

/// A study with its file, its run and its command-line settings.
pub struct Begun<'a> {
    /// The study.
    pub study: &'a Study,
    /// File of the study.
    pub path: &'a Path,
    /// Folder into which the study with the effects is written; `None` for the folder of the study's file.
    pub folder: Option<&'a Path>,
    /// Keys set on the command line.
    pub settings: &'a [String],
    /// Findings of the run.
    pub findings: &'a Findings,
    /// Result of the search for missing physics.
    pub gap: &'a GapFindings,
}

/// Writes the study with the effects, runs it in a directory beside that of the study, and keeps the findings of both.
pub fn add(
    begun: &Begun<'_>,
    run: &RunDirectory,
    observer: &dyn Observer,
) -> Result<(Augmented, Findings), Stop> {
    let Begun { study, path, folder, settings, findings, gap } = begun;
    let result = &gap.result;
    let file = study_file::write(study, path, *folder, result)?;
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
    let folder = run.root().with_file_name(study_file::with_names(&own, study, result));
    let mut directory = RunDirectory::open(&folder)?;
    if !result.additions.iter().any(|addition| addition.model) {
        directory.adopt(run.root(), is_of_the_model)?;
    }
    let with = pipeline::show(&augmented, &result.response[0], &mut directory, observer)?;
    let shown = AugmentedProof::load(&directory.stage_folder(&Stage::Show.folder()))?;
    let added = Augmented {
        search: gap.hash.clone(),
        study: file,
        run: folder,
        parameters: moved(findings, &with),
        unknowns: unknowns(study, &augmented, &with),
        log_evidence: evidence(findings).zip(evidence(&with)).map(|(a, b)| [a, b]),
        held_out: shown.held_out,
    };
    added::keep(run, &added)?;
    Ok((added, with))
}

/// Returns true for stages that effects on the response do not change: the runs, the data, the surrogate.
fn is_of_the_model(stage: &str) -> bool {
    ["1-", "2-", "3-", "4-"].iter().any(|begin| stage.starts_with(begin))
}

fn evidence(findings: &Findings) -> Option<f64> {
    Some(findings.calibration.as_ref()?.evidence.as_ref()?.log)
}

fn moved(before: &Findings, after: &Findings) -> Vec<ParameterChange> {
    let (Some(before), Some(after)) = (&before.calibration, &after.calibration) else {
        return Vec::new();
    };
    let both = before.coordinates.iter().filter(|c| c.role == Role::Parameter).filter_map(|c| {
        let other = after.coordinates.iter().find(|other| other.name == c.name)?;
        Some(ParameterChange {
            name: c.name.clone(),
            unit: c.unit.clone(),
            mean: [c.mean, other.mean],
            sd: [c.sd, other.sd],
        })
    });
    both.collect()
}

/// Posteriors of the unknowns of a study's effects: those on the response, and the parameters that it has in addition
/// to those of `before`.
fn unknowns(before: &Study, study: &Study, findings: &Findings) -> Vec<UnknownPosterior> {
    let effects = study.placed_effects();
    let on_top = effects.iter().flat_map(Placed::hyperparameters).map(|unknown| unknown.name);
    let new = |name: &str| !before.parameters.iter().any(|known| known.name == name);
    let inside = study.parameters.iter().map(|p| p.name.clone()).filter(|name| new(name));
    let names: Vec<String> = inside.chain(on_top).collect();
    let of = |calibration: &CalibrationFindings| -> Vec<UnknownPosterior> {
        let own = calibration.coordinates.iter().filter(|c| names.contains(&c.name));
        own.map(|c| UnknownPosterior {
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
