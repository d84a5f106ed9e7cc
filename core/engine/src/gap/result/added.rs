//! Comparison of the study with the effects with the study without them, as plain data.

use std::path::PathBuf;

use lacuna::data::Unit;
use lacuna::run::{Stop, files};
use lacuna_run::{RunDirectory, Stage};
use serde::{Deserialize, Serialize};

use super::HeldOut;

/// The result of the study with the effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Augmented {
    /// The hash of the search before it.
    pub search: String,
    /// The file.
    pub study: PathBuf,
    /// The run directory.
    pub run: PathBuf,
    /// The parameters of the model in both studies.
    pub parameters: Vec<ParameterChange>,
    /// The unknowns of the effects.
    pub unknowns: Vec<UnknownPosterior>,
    /// The log evidence of both studies, if it is known.
    pub log_evidence: Option<[f64; 2]>,
    /// The proof on held-out data, with the study calibrated without them.
    pub held_out: Vec<HeldOut>,
    /// The studies of the members of a class, this one among them; empty without a class.
    #[serde(default)]
    pub members: Vec<MemberRun>,
    /// The posteriors of the parameters and derived quantities, averaged over the members; empty without a class.
    #[serde(default)]
    pub averaged: Vec<Averaged>,
}

/// The study of a member of a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MemberRun {
    /// The types of its effects.
    pub kinds: Vec<String>,
    /// The posterior probability among the members.
    pub weight: f64,
    /// The file.
    pub study: PathBuf,
    /// The run directory.
    pub run: PathBuf,
    /// The posteriors of its parameters and of the unknowns of its effects.
    pub unknowns: Vec<UnknownPosterior>,
}

/// A posterior averaged over the members of a class: their mixture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Averaged {
    /// The name.
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub sd: f64,
    /// The 2.5 % quantile.
    pub q025: f64,
    /// The median.
    pub median: f64,
    /// The 97.5 % quantile.
    pub q975: f64,
}

/// A parameter in the study without the effects and in that with them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterChange {
    /// The name.
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// The posterior means.
    pub mean: [f64; 2],
    /// The posterior standard deviations.
    pub sd: [f64; 2],
}

/// The posterior of an unknown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnknownPosterior {
    /// The name, such as `damping.rate`.
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub sd: f64,
    /// The ends of its 95 % interval.
    pub interval: [f64; 2],
}

const FILE: &str = "added.toml";

/// Stores the record beside the result of the search.
pub fn keep(run: &RunDirectory, added: &Augmented) -> Result<(), Stop> {
    files::write_toml(&run.stage_folder(&Stage::Gap.folder()).join(FILE), added)
}

/// The record that follows the search of this hash, if there is one.
pub fn kept(run: &RunDirectory, search: &str) -> Option<Augmented> {
    let added: Augmented =
        files::read_toml(&run.stage_folder(&Stage::Gap.folder()).join(FILE)).ok()?;
    (added.search == search).then_some(added)
}
