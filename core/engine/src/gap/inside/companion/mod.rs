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
mod memory;

use std::sync::Arc;

use lacuna::data::Ensemble;
use lacuna::run::{Observer, Stop};
use lacuna_run::{RunDirectory, Stage};
use serde_json::json;

use self::effect::{BareCompanion, CompanionEffect};
use super::pieces::Pieces;
use crate::gap::candidates::Candidate;
use crate::gap::result::companion::IdentifiedCompanion;
use crate::stage::direct::ModelMap;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::stream;
use crate::study::Study;
use crate::study::gap::companion::Companion;

/// The candidates inside the companion of a study; none if it has no companion, or if that is not admitted.
pub fn candidates(
    study: &Study,
    problem: &InverseProblem<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Vec<Candidate>, Option<IdentifiedCompanion>), Stop> {
    let Some(companion) = &study.gap.companion else { return Ok((Vec::new(), None)) };
    let ensemble = problem.data.value.runs()?;
    let found = identified(study, companion, ensemble, problem, run, observer)?;
    if !found.admitted {
        return Ok((Vec::new(), Some(found)));
    }
    let Some(pieces) = Pieces::of(&companion.study)? else { return Ok((Vec::new(), Some(found))) };
    let (pieces, bare) = (Arc::new(pieces), Arc::new(BareCompanion::new(companion, &found)));
    let all = (0..pieces.all.len()).map(|p| CompanionEffect::candidate(&bare, &pieces, p));
    let mut candidates: Vec<Candidate> = all.collect::<Result<_, Stop>>()?;
    candidates.retain(|candidate| !companion.keys.add.contains(&candidate.kind));
    Ok((candidates, Some(found)))
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
    let bare = Arc::new(BareCompanion::new(companion, &found));
    let pieces = Pieces::of(&companion.study)?.map(Arc::new);
    let mut added = Vec::new();
    for name in &companion.keys.add {
        let missing = || {
            Stop::new(format!("the companion has no candidate `{name}`"))
                .help("list it in `[[gap.companion.switch]]` or `[[gap.companion.term]]`, or take it out of `add`")
        };
        let pieces = pieces.as_ref().ok_or_else(missing)?;
        let all = (0..pieces.all.len()).map(|p| CompanionEffect::candidate(&bare, pieces, p));
        let all: Vec<Candidate> = all.collect::<Result<_, Stop>>()?;
        let own = all.into_iter().find(|candidate| candidate.kind == *name);
        added.push((name.clone(), own.ok_or_else(missing)?.effect));
    }
    companion.set_added(added);
    Ok(())
}

/// The inputs on which the identification depends.
fn inputs(companion: &Companion, problem: &InverseProblem<'_>) -> serde_json::Value {
    let laws: Vec<_> = companion.study.parameters.iter().map(|p| (&p.name, &p.prior)).collect();
    json!([problem.data.hash, companion.identity(), laws])
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
        let (constants, used) = match companion.stated() {
            Some(constants) => (constants, Vec::new()),
            None => {
                let random = stream(study, "gap").named("companion");
                (identify::constants(&map, companion, ensemble, &split, &random)?, split.identify)
            }
        };
        let found = gate::checked(&map, companion, ensemble, &split.check, &constants)?;
        let runs = used.iter().map(|&r| ensemble.runs[r].clone()).collect();
        let found = IdentifiedCompanion { constants, runs, ..found };
        observer.end("gap-companion", &found.words(companion));
        Ok(found)
    })?;
    Ok(kept.value)
}
