//! Names, scales and plan of chains, written before the first step: with them another process understands the draws of a
//! calibration that is not finished.

use std::path::Path;

use lacuna::data::Unit;
use lacuna::plugin::sampler::Plan;
use lacuna::plugin::{Sampler, Target as _};
use lacuna::run::{Stop, files};
use serde::{Deserialize, Serialize};

use super::Coordinate;
use crate::posterior::{CoordinateScale, Posterior};

const FILE: &str = "sampling.json";

/// Names, scales and plan of the chains of one calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outline {
    /// Coordinates, parameters first.
    pub coordinates: Vec<OutlinedCoordinate>,
    /// Size of the run.
    pub plan: Plan,
    /// Fraction of the steps that is dropped at the beginning.
    pub burn_in: f64,
    /// True if the points of each step are draws; false for methods whose draws are made at the end.
    pub steps_are_draws: bool,
}

/// A coordinate of the sampler.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutlinedCoordinate {
    /// Name of the unknown.
    pub name: String,
    /// Symbol used in figures.
    pub symbol: String,
    /// Unit of the unknown.
    pub unit: Unit,
    /// Scale of the coordinate.
    pub scale: CoordinateScale,
}

impl Outline {
    /// The outline of a calibration of this posterior.
    pub(super) fn of(
        posterior: &Posterior<'_>,
        coordinates: &[Coordinate],
        sampler: &dyn Sampler,
        burn_in: f64,
    ) -> Self {
        let one = |(c, scale): (&Coordinate, CoordinateScale)| OutlinedCoordinate {
            name: c.name.clone(),
            symbol: c.symbol.clone(),
            unit: c.unit.clone(),
            scale,
        };
        Self {
            coordinates: coordinates.iter().zip(posterior.scales()).map(one).collect(),
            plan: sampler.plan(posterior.dimension()),
            burn_in,
            steps_are_draws: sampler.steps_are_draws(),
        }
    }

    /// Writes the outline into the folder of the stage.
    pub fn write(&self, folder: &Path) -> Result<(), Stop> {
        files::write_json(&folder.join(FILE), self)
    }

    /// Reads the outline in the folder of a stage; `None` if there is none.
    pub fn read(folder: &Path) -> Option<Self> {
        files::read_json(&folder.join(FILE)).ok()
    }
}
