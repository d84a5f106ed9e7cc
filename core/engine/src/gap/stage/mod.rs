//! Stage 7: the gap search, and the proof on held-out data.
//!
//! Data are held out before the search, so that the stage calibrates again with the other data only.

mod counted;
mod laws;
mod models;
pub mod prepared;
pub mod search_model;
pub mod show;
pub mod study_file;

use std::path::Path;

use counted::{Counted, counted};
use lacuna::run::{Observer, Progress, Stop, files};
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use models::ModelSearch;
use serde_json::{Value, json};

use super::inside;
use super::inside::Pieces;
use crate::gap::inside::InsideCandidates;
use crate::gap::result::GapResult;
use crate::gap::search::VerdictKind;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

const FILE: &str = "gap.toml";

impl Artifact for GapResult {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_toml(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_toml(&folder.join(FILE))
    }
}

/// Runs the gap workflow of a study, or loads its stored result; `None` if the study has no measurements.
pub fn stage(
    study: &Study,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<GapResult>>, Stop> {
    let Some(measured) = &problem.data.value.measured else { return Ok(None) };
    let pieces = Pieces::of(study)?;
    let progress = Progress::new(observer);
    let forward = Counted::new(problem.forward(), &progress);
    let mut inside = InsideCandidates::of(pieces.as_ref(), study, problem, run, observer)?;
    inside.wide = inside.wide.map(|wide| counted(wide, &progress));
    let alternatives = inside::alternatives(study, problem, run, observer)?;
    observer.begin(Stage::Gap.label(), "evaluation", 0);
    let kept = run.keep(&Stage::Gap.folder(), &inputs(study, problem), observer, |_| {
        let (inside, alternatives) = (&inside, &alternatives);
        ModelSearch {
            study,
            problem,
            forward: &forward,
            inside,
            alternatives,
            measured,
            progress: &progress,
        }
        .result(observer)
    })?;
    observer.end(Stage::Gap.label(), &summary(&kept.value));
    Ok(Some(kept))
}

/// The result of an earlier run with the same inputs, if there is one.
pub fn kept(
    study: &Study,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<GapResult>>, Stop> {
    if run.has(&Stage::Gap.folder(), &inputs(study, problem))? {
        return stage(study, problem, run, observer);
    }
    Ok(None)
}

/// All inputs on which the result of the search depends.
pub fn inputs(study: &Study, problem: &InverseProblem<'_>) -> Value {
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.prior)).collect();
    let effects = study.effects_identity();
    let candidates = study.gap.candidates.iter();
    let candidates: Vec<_> = candidates.map(|c| (c.built.identity(), &c.common)).collect();
    json!([
        problem.data.hash,
        problem.origin(),
        problem.numerics().map(|n| &n.hash),
        study.numerical_error.as_ref().map(|section| section.written.scales()),
        problem.region(),
        laws,
        effects,
        study.gap.keys,
        study.positions,
        pieces(study),
        candidates,
        study.discrepancy.as_ref().map(|section| section.built.identity()),
        study.about.seed,
    ])
}

/// Candidates inside the model, as the study defines them.
fn pieces(study: &Study) -> Value {
    let inside = &study.gap.inside;
    let terms = inside.terms.iter().map(|t| (t.built.identity(), &t.common));
    let models = inside.models.iter().map(|m| (m.section.built.identity(), &m.keys));
    let lists = json!([inside.switches, terms.collect::<Vec<_>>(), models.collect::<Vec<_>>()]);
    let runs: Vec<_> = study.gap.runs.iter().map(|r| (r.built.identity(), &r.common)).collect();
    let lists = if runs.is_empty() { lists } else { json!([lists, runs]) };
    match &study.gap.companion {
        None => lists,
        Some(companion) => json!([lists, companion.identity()]),
    }
}

/// The verdict of a search in a few words.
pub fn summary(result: &GapResult) -> String {
    let names: Vec<&str> = result.additions.iter().map(|a| a.name.as_str()).collect();
    match result.verdict.word {
        VerdictKind::None => "data and model agree within the noise".to_owned(),
        VerdictKind::Named => format!("missing: {}", names.join(", ")),
        VerdictKind::Approximate => format!(
            "missing: something like {}, {:.0} % of the gap",
            names.join(", "),
            100.0 * result.verdict.closed
        ),
        VerdictKind::Class => {
            let class: Vec<&str> =
                result.additions.iter().flat_map(|a| a.class.iter().map(String::as_str)).collect();
            format!("missing: one of {}", class.join(", "))
        }
        VerdictKind::Unlisted => match (result.explained(), &names[..]) {
            (_, []) => "something is missing that no candidate explains".to_owned(),
            (None, _) => {
                format!("something is missing without a sure name; nearest: {}", names.join(", "))
            }
            (Some(share), _) => format!(
                "something is missing without a sure name; {:.0} % of it explained by: {}",
                100.0 * share,
                names.join(", ")
            ),
        },
        VerdictKind::NotVisible => "whatever may be missing, the parameters absorb it".to_owned(),
    }
}
