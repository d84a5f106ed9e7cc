//! The draws of a finished run, read from its directory.

use std::path::{Path, PathBuf};

use lacuna::data::Unit;
use lacuna::diagnose::Diagnosis;
use lacuna::math::distribution::Distribution;
use lacuna::run::{Stop, files};
use lacuna_run::{Stage, arrays};
use serde::Deserialize;

/// Part of the results of a calibration that is read.
#[derive(Deserialize)]
struct Outcome {
    coordinates: Vec<Coordinate>,
    burn_in: usize,
    diagnosis: Diagnosis,
}

/// A coordinate of the posterior.
#[derive(Deserialize)]
pub(super) struct Coordinate {
    pub(super) name: String,
    pub(super) unit: Unit,
    pub(super) prior: Option<Distribution>,
}

/// The posterior of a run.
pub(super) struct Posterior {
    /// Coordinates of the posterior.
    pub(super) coordinates: Vec<Coordinate>,
    /// Draws after the burn-in by chain, each of all coordinates.
    pub(super) chains: Vec<Vec<Vec<f64>>>,
    /// Number of independent draws that each coordinate is worth.
    pub(super) effective: Vec<f64>,
    /// True if the chains converged.
    pub(super) converged: bool,
}

impl Posterior {
    /// Reads the posterior of a run directory: that of the last round, if the run refined its surrogate.
    pub(super) fn read(run: &Path) -> Result<Self, Stop> {
        let folder = last(run);
        let outcome: Outcome = files::read_json(&folder.join("outcome.json"))?;
        let array = arrays::read(&folder.join("draws.nc"), "draws")?;
        let sizes: Vec<usize> = array.dimensions.iter().map(|d| d.1).collect();
        let d = outcome.coordinates.len();
        if sizes.len() != 3 || sizes[2] != d || outcome.diagnosis.coordinates.len() < d {
            return Err(Stop::new(format!("{} is damaged", folder.join("draws.nc").display())));
        }
        let chain = |values: &[f64]| {
            values.chunks_exact(d).skip(outcome.burn_in).map(<[f64]>::to_vec).collect()
        };
        let chains = array.values.chunks_exact(sizes[1] * d).map(chain).collect();
        let effective = outcome.diagnosis.coordinates.iter().map(|c| c.ess_bulk).collect();
        let converged = outcome.diagnosis.converged;
        Ok(Self { coordinates: outcome.coordinates, chains, effective, converged })
    }

    /// Place of the coordinate with a name.
    pub(super) fn place(&self, name: &str) -> Option<usize> {
        self.coordinates.iter().position(|c| c.name == name)
    }
}

/// Folder of the last calibration of a run.
fn last(run: &Path) -> PathBuf {
    let of_round = |round: usize| {
        let part = format!("refine-{round}");
        run.join(Stage::Calibrate.inside(Stage::Calibrate, &part).name())
    };
    let rounds = (1..).map(of_round).take_while(|folder| folder.join("outcome.json").exists());
    rounds.last().unwrap_or_else(|| run.join(Stage::Calibrate.folder().name()))
}
