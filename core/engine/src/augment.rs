//! The study with the effects that were found: written, run, and compared with the study without them.

mod average;

use std::path::{Path, PathBuf};

use lacuna::plugin::effect::Placed;
use lacuna::run::{Observer, Stop, files};
use lacuna_run::{Artifact as _, RunDirectory, Stage};

use crate::gap::result::added::{Augmented, MemberRun, ParameterChange, UnknownPosterior};
use crate::gap::result::members::Member;
use crate::gap::result::{GapFindings, GapResult, HeldOut, added};
use crate::gap::stage::show::AugmentedProof;
use crate::gap::stage::study_file;
use crate::pipeline;
use crate::report::findings::{CalibrationFindings, CoordinateFindings, Findings, Role};
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
///
/// If the effects are one member of a class, the study of every other member is written and run as well, and the
/// posteriors and predictions of all are averaged by the posterior probabilities of the members. The caller chooses the
/// effects: [`GapResult::worth_adding`] leaves out those that held-out data contradict.
pub fn add(
    begun: &Begun<'_>,
    run: &RunDirectory,
    observer: &dyn Observer,
) -> Result<(Augmented, Findings), Stop> {
    let Begun { study, findings, gap, .. } = begun;
    let result = &gap.result;
    let mut own = one(begun, result, run, observer)?;
    own.findings.warnings.extend(result.warning().map(str::to_owned));
    let is_chosen = |member: &Member| member.additions == result.additions;
    let mut members = Vec::new();
    if result.members.iter().any(is_chosen) {
        for member in &result.members {
            let other = if is_chosen(member) {
                None
            } else {
                let additions = member.additions.clone();
                Some(one(begun, &GapResult { additions, ..result.clone() }, run, observer)?)
            };
            members.push((member, other));
        }
    }
    let all: Vec<(&Member, &With)> =
        members.iter().map(|(member, with)| (*member, with.as_ref().unwrap_or(&own))).collect();
    let weighed: Vec<(f64, &Findings)> =
        all.iter().map(|(member, with)| (member.weight, &with.findings)).collect();
    if !weighed.is_empty()
        && let Some(table) = average::predictions(&study.layouts, &weighed)
    {
        let folder = run.stage_folder(&Stage::Gap.folder());
        files::write_atomic(&folder.join(PREDICTIONS), table.as_bytes())?;
    }
    let added = Augmented {
        search: gap.hash.clone(),
        study: own.file.clone(),
        run: own.folder.clone(),
        parameters: moved(findings, &own.findings),
        unknowns: own.unknowns.clone(),
        log_evidence: evidence(findings).zip(evidence(&own.findings)).map(|(a, b)| [a, b]),
        held_out: own.held_out.clone(),
        members: all.iter().map(|(member, with)| with.member(member)).collect(),
        averaged: average::posteriors(&weighed),
    };
    added::keep(run, &added)?;
    Ok((added, own.findings))
}

/// File of the averaged predictions of a class, in the folder of the search.
const PREDICTIONS: &str = "averaged.csv";

/// A study with effects: its file, its run and the findings.
struct With {
    file: PathBuf,
    folder: PathBuf,
    unknowns: Vec<UnknownPosterior>,
    held_out: Vec<HeldOut>,
    findings: Findings,
}

impl With {
    /// The study as one of a class.
    fn member(&self, member: &Member) -> MemberRun {
        let of = |calibration: &CalibrationFindings| -> Vec<UnknownPosterior> {
            let all = calibration.coordinates.iter();
            let own = |c: &&CoordinateFindings| {
                c.role != Role::Hyperparameter || self.unknowns.iter().any(|u| u.name == c.name)
            };
            all.filter(own).map(posterior).collect()
        };
        MemberRun {
            kinds: member.kinds.clone(),
            weight: member.weight,
            study: self.file.clone(),
            run: self.folder.clone(),
            unknowns: self.findings.calibration.as_ref().map(of).unwrap_or_default(),
        }
    }
}

/// Writes and runs the study with the effects of a result.
fn one(
    begun: &Begun<'_>,
    result: &GapResult,
    run: &RunDirectory,
    observer: &dyn Observer,
) -> Result<With, Stop> {
    let Begun { study, path, folder, settings, .. } = begun;
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
    let findings = pipeline::show(&augmented, &result.response[0], &mut directory, observer)?;
    let shown = AugmentedProof::load(&directory.stage_folder(&Stage::Show.folder()))?;
    let unknowns = unknowns(study, &augmented, &findings);
    Ok(With { file, folder, unknowns, held_out: shown.held_out, findings })
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
        own.map(posterior).collect()
    };
    findings.calibration.as_ref().map(of).unwrap_or_default()
}

fn posterior(c: &CoordinateFindings) -> UnknownPosterior {
    UnknownPosterior {
        name: c.name.clone(),
        unit: c.unit.clone(),
        mean: c.mean,
        sd: c.sd,
        interval: [c.q025, c.q975],
    }
}
