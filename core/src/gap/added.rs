//! What a study with the effects that were missing found, against the study without, as plain data.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::account::HeldOut;
use crate::data::Unit;

/// What the study with the effects found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Added {
    /// The hash of the search that it follows.
    pub search: String,
    /// Its file.
    pub study: PathBuf,
    /// Its run directory.
    pub run: PathBuf,
    /// The parameters of the model in both studies.
    pub parameters: Vec<Moved>,
    /// The unknowns of the effects.
    pub unknowns: Vec<Posterior>,
    /// The log evidence of both studies, where it is known.
    pub log_evidence: Option<[f64; 2]>,
    /// How the study with the effects fares on what was set aside, when it is calibrated without it.
    pub held_out: Vec<HeldOut>,
}

/// A parameter in the study without the effects and in that with them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Moved {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// Its posterior means.
    pub mean: [f64; 2],
    /// Its posterior standard deviations.
    pub sd: [f64; 2],
}

/// The posterior of an unknown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// Its name, such as `damping.rate`.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// The ends of its 95 % interval.
    pub interval: [f64; 2],
}
