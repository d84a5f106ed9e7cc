//! Candidates inside a companion: a cheap model of the same physics as a simulator that is a black box.
//!
//! The response with a candidate is `emulator(theta) + [companion(theta, candidate) - companion(theta)]`, so that the
//! companion's own error cancels to first order, as in space mapping with an additive correction (Bandler et al., IEEE
//! Transactions on Microwave Theory and Techniques 52 (2004) 337). A companion is admitted by its error on simulation
//! runs that did not identify its constants; no measurement is involved.

pub mod edit;
mod effect;
mod gate;
mod identify;
mod learned;
mod line;
mod reach;

use std::sync::Arc;

use lacuna::data::Ensemble;
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{RunDirectory, Stage};
use serde_json::json;

use self::effect::{CompanionCandidates, Extent, Learning};
use self::learned::Region;
use super::pieces::Pieces;
use crate::gap::candidates::Candidate;
use crate::gap::result::companion::IdentifiedCompanion;
use crate::stage::direct::ModelMap;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::stream;
use crate::study::Study;
use crate::study::gap::{AddedCandidate, Companion};

/// A companion that is admitted, from which candidates are learned.
pub struct AdmittedCompanion {
    found: IdentifiedCompanion,
    pieces: Option<Pieces>,
}

/// The companion of a study with its constants; `None` if the study has none.
pub fn prepared(
    study: &Study,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<AdmittedCompanion>, Stop> {
    let Some(companion) = &study.gap.companion else { return Ok(None) };
    let found = identified(study, companion, problem.data.value.runs()?, problem, run, observer)?;
    let pieces = if found.admitted { Pieces::of(&companion.study)? } else { None };
    Ok(Some(AdmittedCompanion { found, pieces }))
}

impl AdmittedCompanion {
    /// The companion with its constants.
    pub fn identified(&self) -> &IdentifiedCompanion {
        &self.found
    }

    /// The forms of its errors, `forms x outputs`, in the response's unit; none if it is not admitted.
    pub fn forms(&self) -> Matrix {
        if self.pieces.is_some() { self.found.errors.clone() } else { Matrix::default() }
    }

    /// The candidates, learned near a point of the study's parameters for changes as large as a misfit (root mean square, in
    /// the response's unit); none if the companion is not admitted. Those that
    /// are part of the study are left out.
    pub fn candidates(
        &self,
        study: &Study,
        point: &[f64],
        misfit: f64,
    ) -> Result<CompanionCandidates, Stop> {
        let (Some(companion), Some(pieces)) = (&study.gap.companion, &self.pieces) else {
            return Ok(CompanionCandidates::default());
        };
        learning(study, companion, &self.found, pieces, point, Extent::Change(misfit))
            .candidates(|name| !companion.keys.add.iter().any(|added| added == name))
    }
}

fn learning<'a>(
    study: &Study,
    companion: &'a Companion,
    found: &'a IdentifiedCompanion,
    pieces: &'a Pieces,
    point: &[f64],
    extent: Extent,
) -> Learning<'a> {
    let point = point[..study.parameters.len()].to_vec();
    let region = Region::around(&study.parameters, &point);
    let random = stream(study, "gap").named("changes");
    Learning { companion, found, pieces, region, point, extent, random }
}

/// Builds the effects of the candidates inside the companion that are part of the study, which every stage after this
/// uses.
pub fn build_added(study: &Study) -> Result<(), Stop> {
    let Some(companion) = study.gap.companion.as_ref().filter(|own| !own.keys.add.is_empty())
    else {
        return Ok(());
    };
    let constants = companion.stated().ok_or_else(|| {
        Stop::new("`[gap.companion]` adds candidates, but its constants have no values")
    })?;
    let found = IdentifiedCompanion { constants, ..IdentifiedCompanion::default() };
    let names = &companion.keys.add;
    let candidates = match Pieces::of(&companion.study)? {
        Some(pieces) => {
            let point = companion.centre();
            let sizes = Extent::Sizes(companion.keys.around.clone());
            let learning = learning(study, companion, &found, &pieces, &point, sizes);
            learning.candidates(|name| names.iter().any(|added| added == name))?.candidates
        }
        None => Vec::new(),
    };
    let of_name = |name: &String| {
        let own = candidates.iter().find(|candidate| candidate.kind == *name);
        let added = |own: &Candidate| AddedCandidate {
            name: name.clone(),
            effect: Arc::clone(&own.effect),
            origin: files::hash(companion.identity().to_string().as_bytes()),
        };
        own.map(added).ok_or_else(|| {
            Stop::new(format!("the companion has no candidate `{name}` that it answers")).help(
                "list it in `[[gap.companion.switch]]` or `[[gap.companion.term]]`, or take it out of `add`",
            )
        })
    };
    companion.set_added(names.iter().map(of_name).collect::<Result<_, Stop>>()?);
    Ok(())
}

/// The inputs on which the identification depends.
fn inputs(companion: &Companion, problem: &InverseProblem<'_>) -> serde_json::Value {
    let laws: Vec<_> = companion.study.parameters.iter().map(|p| (&p.name, &p.prior)).collect();
    json!([problem.data.value.runs_hash(), companion.identity(), laws])
}

/// The companion with its constants: as the study states them, or as the runs identify them; kept in the run directory.
fn identified(
    study: &Study,
    companion: &Companion,
    ensemble: &Ensemble,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<IdentifiedCompanion, Stop> {
    let folder = Stage::Gap.part("companion");
    let kept = run.keep(&folder, &inputs(companion, problem), observer, |_| {
        observer.begin("gap-companion", "", 0);
        let map = ModelMap::of(&companion.study)?;
        let split = gate::split(ensemble, companion)?;
        let (constants, used) = if let Some(constants) = companion.stated() {
            (constants, Vec::new())
        } else {
            let random = stream(study, "gap").named("companion");
            (identify::constants(&map, companion, ensemble, &split, &random)?, split.identify)
        };
        let found = gate::checked(&map, companion, ensemble, &split.check, &constants)?;
        let runs = used.iter().map(|&r| ensemble.runs[r].clone()).collect();
        let found = IdentifiedCompanion { constants, runs, ..found };
        observer.end("gap-companion", &found.words(companion));
        Ok(found)
    })?;
    Ok(kept.value)
}
