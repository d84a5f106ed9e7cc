//! A calibration in files.

use std::path::Path;

use super::{Calibrated, Outcome};
use crate::data::Draws;
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Stop, files};

impl Artifact for Calibrated {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let d = &self.draws;
        let axes = |last: Option<usize>| {
            let both = [("chain".to_owned(), d.chains), ("step".to_owned(), d.steps)];
            both.into_iter().chain(last.map(|n| ("coordinate".to_owned(), n))).collect()
        };
        let array = |name: &str, values: &[f64], last| Array {
            name: name.to_owned(),
            dimensions: axes(last),
            values: values.to_vec(),
            unit: None,
        };
        let arrays = [
            array("draws", &d.values, Some(d.dimension())),
            array("log_density", &d.log_density, None),
        ];
        let names = d.names.join(" ");
        arrays::write(&folder.join("draws.nc"), &[("coordinates", names)], &arrays)?;
        files::write_json(&folder.join("outcome.json"), &self.outcome)?;
        Ok(["draws.nc", "outcome.json"].map(str::to_owned).to_vec())
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let outcome: Outcome = files::read_json(&folder.join("outcome.json"))?;
        let path = folder.join("draws.nc");
        let values = arrays::read(&path, "draws")?;
        let log_density = arrays::read(&path, "log_density")?;
        let draws = Draws {
            names: outcome.coordinates.iter().map(|c| c.name.clone()).collect(),
            chains: values.dimensions[0].1,
            steps: values.dimensions[1].1,
            values: values.values,
            log_density: log_density.values,
        };
        Ok(Self { draws, outcome })
    }
}
