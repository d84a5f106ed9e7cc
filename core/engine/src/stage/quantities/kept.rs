//! Files of predicted quantities: `quantities.json` describes them, `draws.nc` has the draws.

use std::path::Path;

use lacuna::run::{Stop, files};
use lacuna_run::Artifact;
use lacuna_run::arrays::{self, Array};

use super::Quantified;

/// The description, and the figures of the quantities for people.
const ABOUT: &str = "quantities.json";
const DRAWS: &str = "draws.nc";

impl Artifact for Quantified {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(ABOUT), &self.about)?;
        let map = Array {
            name: "map".to_owned(),
            dimensions: vec![("quantity".to_owned(), self.map.len())],
            values: self.map.clone(),
            unit: None,
        };
        let draws = Array::matrix("draws", "variant_quantity", "draw", &self.draws);
        arrays::write(&folder.join(DRAWS), &[], &[draws, map])?;
        Ok([ABOUT, DRAWS].map(str::to_owned).to_vec())
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join(DRAWS);
        Ok(Self {
            about: files::read_json(&folder.join(ABOUT))?,
            draws: arrays::read(&path, "draws")?.into_matrix(),
            map: arrays::read(&path, "map")?.values,
        })
    }
}
