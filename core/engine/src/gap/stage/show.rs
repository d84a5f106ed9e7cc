//! The proof repeated with the study that was written, whose own emulator is more accurate for the effects than that of
//! the search.
//!
//! The study is calibrated without the held-out data, and compared on them with the response of the study without the
//! effects.

use std::path::Path;

use lacuna::run::{Observer, Stop, files};
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::prepared::{BaseModel, FittedSystem, apart};
use super::search_model::SearchModel;
use crate::gap::experiment::with_effects::WithEffects;
use crate::gap::inside::InsideCandidates;
use crate::gap::noise::Noise;
use crate::gap::result::HeldOut;
use crate::gap::system::System;
use crate::gap::system::fit::fit_from;
use crate::gap::system::whitener::Whitener;
use crate::stage::calibrate::Calibrated;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

const FILE: &str = "show.toml";

/// The proof of a study with effects on held-out data.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AugmentedProof {
    /// The proof with each kind of held-out data.
    pub held_out: Vec<HeldOut>,
}

impl Artifact for AugmentedProof {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_toml(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_toml(&folder.join(FILE))
    }
}

/// Compares the study on held-out data with `before`, the response of the study without its effects, both calibrated
/// without these data.
pub fn stage(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    before: &[f64],
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<AugmentedProof>, Stop> {
    let inputs = json!([
        crate::gap::stage::inputs(study, problem),
        calibrated.map(|kept| &kept.hash),
        before
    ]);
    run.keep(&Stage::Show.folder(), &inputs, observer, |_| match calibrated {
        Some(calibrated) => shown(study, problem, &calibrated.value.outcome.map, before),
        None => Ok(AugmentedProof::default()),
    })
}

fn shown(
    study: &Study,
    problem: &InverseProblem<'_>,
    map: &[f64],
    before: &[f64],
) -> Result<AugmentedProof, Stop> {
    let Some(measured) = &problem.data.value.measured else { return Ok(AugmentedProof::default()) };
    let split = apart(study, &measured.used);
    let inside = InsideCandidates::default();
    let beginning = SearchModel::own(study, problem, &inside);
    let forward = WithEffects::new(problem.forward(), study.placed_effects());
    let parameters = forward.parameters(&study.parameters);
    let base = BaseModel {
        study,
        problem,
        beginning: &beginning,
        wide: None,
        forward: &forward,
        parameters: &parameters,
    };
    let start = &map[..parameters.len()];
    let experiment = base.experiment(&split.training, start)?;
    let system = System::new(&experiment, Vec::new());
    let (_, means) = experiment.means();
    let mut point = start.to_vec();
    let mut last = None;
    // The noise is estimated around the fit, and the fit depends on the noise.
    for _ in 0..ROUNDS {
        let around = base.around(&point);
        let noise = Noise::of(&experiment, &around, None);
        let whitener = Whitener::new(&experiment, &noise, &around.response);
        let fit = fit_from(&system, &whitener, &means, std::slice::from_ref(&point))
            .ok_or_else(|| Stop::new("the model gave no answer at the best fit"))?;
        point.clone_from(&fit.at.point);
        last = Some((fit, noise));
    }
    let mut shown = AugmentedProof::default();
    if let Some((fit, noise)) = &last {
        let fitted = FittedSystem { system: &system, fit, noise };
        for part in &split.held_out {
            shown.held_out.extend(base.proof(part, &measured.used, before, &fitted)?);
        }
    }
    Ok(shown)
}

/// The number of rounds in which noise and fit are estimated in turn.
const ROUNDS: usize = 3;
