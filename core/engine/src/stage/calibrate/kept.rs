//! Files of a calibration: `draws.nc` with the draws and the sampler's statistics of each step, and the rest as JSON.

use std::path::Path;

use lacuna::data::Draws;
use lacuna::data::statistics::{Kind, Statistics};
use lacuna::run::{Stop, files};
use lacuna_run::Artifact;
use lacuna_run::arrays::{self, Array};

use super::{Calibrated, Outcome};

/// Name of a statistic's array.
fn told(name: &str) -> String {
    format!("step_{name}")
}

fn array<'a>(name: &str, values: &'a [f64], dimensions: Vec<(String, usize)>) -> Array<'a> {
    Array { name: name.to_owned(), dimensions, values: values.into(), unit: None }
}

impl Artifact for Calibrated {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let d = &self.draws;
        let axes = |last: Option<usize>| {
            let both = [("chain".to_owned(), d.chains), ("step".to_owned(), d.steps)];
            both.into_iter().chain(last.map(|n| ("coordinate".to_owned(), n))).collect()
        };
        let mut arrays = vec![
            array("draws", &d.values, axes(Some(d.dimension()))),
            array("log_density", &d.log_density, axes(None)),
        ];
        let count = self.statistics.names.len();
        for (i, (name, _)) in self.statistics.names.iter().enumerate() {
            let all = self.statistics.values.len() / count;
            let own = &self.statistics.values[i * all..(i + 1) * all];
            arrays.push(array(&told(name), own, axes(None)));
        }
        let names = d.names.join(" ");
        arrays::write(&folder.join("draws.nc"), &[("coordinates", names)], &arrays)?;
        files::write_json(&folder.join("outcome.json"), &self.outcome)?;
        files::write_json(&folder.join("statistics.json"), &self.statistics.names)?;
        Ok(["draws.nc", "outcome.json", "statistics.json"].map(str::to_owned).to_vec())
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
            values: values.into_values(),
            log_density: log_density.into_values(),
        };
        let names: Vec<(String, Kind)> = files::read_json(&folder.join("statistics.json"))?;
        let mut told_values = Vec::new();
        for (name, _) in &names {
            told_values.extend(arrays::read(&path, &told(name))?.into_values());
        }
        let (chains, steps) = (draws.chains, draws.steps);
        let statistics = Statistics { names, chains, steps, values: told_values };
        Ok(Self { draws, statistics, outcome })
    }
}
