//! Whether the gap shrank, by the study that was written: with an emulator of its own it knows the effects better than the
//! search did.
//!
//! The study is calibrated with what was not set aside, and compared with the response of the study without the effects on what was.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::search::{Base, Beginning, Fitted, Inside, apart};
use crate::gap::account::HeldOut;
use crate::gap::fit::fit_from;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::gap::with_effects::WithEffects;
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop, files};
use crate::stage::Known;
use crate::stage::calibrate::Calibrated;
use crate::study::Study;

/// The folder of the stage.
pub const FOLDER: &str = "7-show";
const FILE: &str = "show.toml";

/// How a study with effects fares on what was set aside.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// Each kind of what was set aside.
    pub held_out: Vec<HeldOut>,
}

impl Artifact for Shown {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_toml(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_toml(&folder.join(FILE))
    }
}

/// Compares the study with `before`, the response of the one without its effects, calibrated with what was not set aside.
pub fn stage(
    study: &Study,
    known: &Known<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    before: &[f64],
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Shown>, Stop> {
    let inputs = json!([super::inputs(study, known), calibrated.map(|kept| &kept.hash), before]);
    run.keep(FOLDER, &inputs, observer, |_| match calibrated {
        Some(calibrated) => shown(study, known, &calibrated.value.outcome.map, before),
        None => Ok(Shown::default()),
    })
}

fn shown(study: &Study, known: &Known<'_>, map: &[f64], before: &[f64]) -> Result<Shown, Stop> {
    let Some(measured) = &known.data.value.measured else { return Ok(Shown::default()) };
    let split = apart(study, &measured.used);
    let inside = Inside::default();
    let beginning = Beginning::own(study, known, &inside);
    let forward = WithEffects::new(known.forward, study.placed_effects());
    let parameters = forward.parameters(&study.parameters);
    let base = Base {
        study,
        known,
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
    // The noise is that about the fit, and the fit that under the noise.
    for _ in 0..ROUNDS {
        let around = base.around(&point);
        let noise = Noise::of(&experiment, &around, None);
        let whitener = Whitener::new(&experiment, &noise, &around.response);
        let fit = fit_from(&system, &whitener, &means, std::slice::from_ref(&point))
            .ok_or_else(|| Stop::new("the model gave no answer at the best fit"))?;
        point.clone_from(&fit.at.point);
        last = Some((fit, noise));
    }
    let mut shown = Shown::default();
    if let Some((fit, noise)) = &last {
        let fitted = Fitted { system: &system, fit, noise };
        for part in &split.held_out {
            shown.held_out.extend(base.proof(part, &measured.used, before, &fitted)?);
        }
    }
    Ok(shown)
}

/// How often noise and fit are found in turn.
const ROUNDS: usize = 3;
