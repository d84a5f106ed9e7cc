//! Files of predicted quantities: `quantities.json` describes them, `draws.nc` has the draws, and `sensitivity.nc` what the
//! priors of a study without data imply.

use std::path::Path;

use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::Artifact;
use lacuna_run::arrays::{self, Array};
use serde::{Deserialize, Serialize};

use super::{About, Bands, BoundsFindings, Propagated, Quantified};
use crate::sensitivity::Indices;

/// The description, and the figures of the quantities for people.
const ABOUT: &str = "quantities.json";
const DRAWS: &str = "draws.nc";
const SENSITIVITY: &str = "sensitivity.nc";

/// Names of the arrays of indices, after `response_` for those of the response.
const INDICES: [&str; 6] =
    ["first_order", "first_order_error", "total", "total_error", "shapley", "shapley_error"];

/// Names of the arrays of the response's distribution.
const BANDS: [&str; 5] =
    ["response_mean", "response_sd", "response_q025", "response_median", "response_q975"];

/// Contents of the description.
#[derive(Serialize, Deserialize)]
struct Written {
    #[serde(flatten)]
    about: About,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    inputs: Option<Vec<String>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    samples: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    bounds: Option<BoundsFindings>,
}

impl Artifact for Quantified {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let propagated = self.propagated.as_ref();
        let written = Written {
            about: self.about.clone(),
            inputs: propagated.map(|found| found.inputs.clone()),
            samples: propagated.map(|found| found.samples),
            bounds: propagated.and_then(|found| found.bounds.clone()),
        };
        files::write_json(&folder.join(ABOUT), &written)?;
        let mut names = vec![ABOUT];
        if !self.map.is_empty() {
            let map = vector("map", "quantity", &self.map);
            let draws = Array::matrix("draws", "variant_quantity", "draw", &self.draws);
            arrays::write(&folder.join(DRAWS), &[], &[draws, map])?;
            names.push(DRAWS);
        }
        if let Some(found) = propagated {
            let asked: Vec<&str> = self.about.quantities.iter().map(|q| &*q.name).collect();
            let labels = [("inputs", found.inputs.join(" ")), ("quantities", asked.join(" "))];
            arrays::write(&folder.join(SENSITIVITY), &labels, &all(found))?;
            names.push(SENSITIVITY);
        }
        Ok(names.into_iter().map(str::to_owned).collect())
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join(DRAWS);
        let Written { about, inputs, samples, bounds } = files::read_json(&folder.join(ABOUT))?;
        let asked = !about.quantities.is_empty();
        let propagated = match (inputs, samples) {
            (Some(inputs), Some(samples)) => {
                let found = propagated(&folder.join(SENSITIVITY), inputs, samples, asked)?;
                Some(Propagated { bounds, ..found })
            }
            _ => None,
        };
        let (draws, map) = if asked {
            (arrays::read(&path, "draws")?.into_matrix(), arrays::read(&path, "map")?.into_values())
        } else {
            (Matrix::zeros(0, about.steps.len()), Vec::new())
        };
        Ok(Self { about, draws, map, propagated })
    }
}

fn vector<'a>(name: &str, dimension: &str, values: &'a [f64]) -> Array<'a> {
    Array {
        name: name.to_owned(),
        dimensions: vec![(dimension.to_owned(), values.len())],
        values: values.into(),
        unit: None,
    }
}

/// All arrays of `sensitivity.nc`.
fn all(found: &Propagated) -> Vec<Array<'_>> {
    let mut all = Vec::new();
    let varies = !found.inputs.is_empty();
    if found.quantities.first.rows() > 0 {
        let own = INDICES.iter().zip(found.quantities.parts());
        all.extend(own.map(|(name, part)| Array::matrix(name, "quantity", "input", part)));
    }
    for (name, part) in INDICES.iter().zip(found.response.parts()).filter(|_| varies) {
        all.push(Array::matrix(&format!("response_{name}"), "output", "input", part));
    }
    let bands = &found.bands;
    let parts = [&bands.mean, &bands.sd, &bands.q025, &bands.median, &bands.q975];
    all.extend(BANDS.iter().zip(parts).map(|(name, part)| vector(name, "output", part)));
    all
}

fn propagated(
    path: &Path,
    inputs: Vec<String>,
    samples: usize,
    asked: bool,
) -> Result<Propagated, Stop> {
    let read = |prefix: &str| -> Result<Indices, Stop> {
        let one = |k: usize| {
            let name = [prefix, INDICES[k]].concat();
            arrays::read(path, &name).map(Array::into_matrix)
        };
        Ok(Indices {
            first: one(0)?,
            first_error: one(1)?,
            total: one(2)?,
            total_error: one(3)?,
            shapley: one(4)?,
            shapley_error: one(5)?,
        })
    };
    let band = |k: usize| arrays::read(path, BANDS[k]).map(Array::into_values);
    let bands =
        Bands { mean: band(0)?, sd: band(1)?, q025: band(2)?, median: band(3)?, q975: band(4)? };
    let none = || Indices::none(inputs.len());
    let quantities = if asked && !inputs.is_empty() { read("")? } else { none() };
    let response = if inputs.is_empty() { none() } else { read("response_")? };
    Ok(Propagated { inputs, samples, quantities, response, bands, bounds: None })
}
