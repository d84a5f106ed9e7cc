//! `posterior.nc`: the draws as a NetCDF-4 file in the layout of ArviZ's `InferenceData`.
//!
//! Groups `posterior`, `sample_stats`, `observed_data` and `posterior_predictive`, as specified in the ArviZ schema
//! (`InferenceData` schema, version 1): every variable of the first two has the dimensions `chain` and `draw` first.

use netcdf_writer::{
    DimensionId, Error, NcAttrValue, NcFileBuilder, NcWriteFormat, NcWriteOptions,
};

use crate::data::{Coordinates, Layout, Layouts};
use crate::run::Kept;
use crate::study::Study;

use super::calibrate::Calibrated;
use super::read::Measured;
use super::validate::Validated;

/// The bytes of the file.
pub fn encode(
    study: &Study,
    calibrated: &Calibrated,
    measured: Option<&Measured>,
    validated: Option<&Kept<Validated>>,
) -> Result<Vec<u8>, Error> {
    let mut file = File { builder: NcFileBuilder::new() };
    let version = env!("CARGO_PKG_VERSION");
    file.text_attribute("title", &study.about.title)?;
    file.text_attribute("inference_library", "lacuna")?;
    file.text_attribute("inference_library_version", version)?;
    file.posterior(calibrated)?;
    if let Some(measured) = measured {
        file.observed(measured)?;
    }
    if let Some(validated) = validated {
        file.predictive(&study.layouts, &validated.value)?;
    }
    let options = NcWriteOptions { format: NcWriteFormat::Nc4 };
    Ok(file.builder.to_vec(options)?.1)
}

/// What tells the blocks of scenarios apart in names: nothing where there is one.
fn suffix(block: usize, blocks: usize) -> String {
    if blocks == 1 { String::new() } else { format!("_{}", block + 1) }
}

struct File {
    builder: NcFileBuilder,
}

impl File {
    fn text_attribute(&mut self, name: &str, text: &str) -> Result<(), Error> {
        self.builder.add_attribute(name, NcAttrValue::Chars(text.to_owned()))
    }

    /// A dimension with its coordinate variable of whole numbers.
    fn counted(&mut self, group: &str, name: &str, count: usize) -> Result<DimensionId, Error> {
        let path = format!("{group}/{name}");
        let dimension = self.builder.add_dimension_path(&path, count as u64)?;
        let variable = self.builder.add_variable_path::<i64>(&path, &[dimension])?;
        let numbers: Vec<i64> = (0..count as i64).collect();
        self.builder.write_variable(variable, &numbers)?;
        Ok(dimension)
    }

    fn numbers(
        &mut self,
        path: &str,
        dimensions: &[DimensionId],
        values: &[f64],
        unit: Option<&str>,
    ) -> Result<(), Error> {
        let variable = self.builder.add_variable_path::<f64>(path, dimensions)?;
        if let Some(unit) = unit {
            let unit = NcAttrValue::Chars(unit.to_owned());
            self.builder.add_variable_attribute(variable, "units", unit)?;
        }
        self.builder.write_variable(variable, values)
    }

    fn posterior(&mut self, calibrated: &Calibrated) -> Result<(), Error> {
        let kept = calibrated.draws.from_step(calibrated.outcome.burn_in);
        let chain = self.counted("posterior", "chain", kept.chains)?;
        let draw = self.counted("posterior", "draw", kept.steps)?;
        for (j, coordinate) in calibrated.outcome.coordinates.iter().enumerate() {
            let path = format!("posterior/{}", coordinate.name);
            let unit = coordinate.unit.to_string();
            self.numbers(&path, &[chain, draw], &kept.pooled(j), Some(&unit))?;
        }
        let chain = self.counted("sample_stats", "chain", kept.chains)?;
        let draw = self.counted("sample_stats", "draw", kept.steps)?;
        self.numbers("sample_stats/lp", &[chain, draw], &kept.log_density, None)?;
        let acceptance = &calibrated.outcome.acceptance;
        if acceptance.is_empty() {
            return Ok(());
        }
        self.numbers("sample_stats/acceptance_rate", &[chain], acceptance, None)
    }

    fn observed(&mut self, measured: &Measured) -> Result<(), Error> {
        let group = "observed_data";
        let blocks = &measured.used.blocks;
        for (i, data) in blocks.iter().enumerate() {
            let suffix = suffix(i, blocks.len());
            let names: Vec<String> = data.replicates.iter().map(|r| r.name.clone()).collect();
            let mut dimensions = vec![self.labels(group, &format!("replicate{suffix}"), &names)?];
            dimensions.extend(self.axes(group, &data.layout, &suffix)?);
            let values: Vec<f64> = data
                .replicates
                .iter()
                .flat_map(|r| r.values.iter().map(|y| y.unwrap_or(f64::NAN)))
                .collect();
            let unit = data.layout.unit.to_string();
            let path = format!("{group}/{}{suffix}", data.layout.name);
            self.numbers(&path, &dimensions, &values, Some(&unit))?;
        }
        Ok(())
    }

    fn predictive(&mut self, layouts: &Layouts, validated: &Validated) -> Result<(), Error> {
        let group = "posterior_predictive";
        let Some((low, high)) = &validated.predictive else { return Ok(()) };
        let unit = layouts.unit().to_string();
        for (i, (layout, range)) in layouts.parts().enumerate() {
            let block = suffix(i, layouts.blocks.len());
            let dimensions = self.axes(group, layout, &block)?;
            for (end, values) in [("q025", low), ("q975", high)] {
                let path = format!("{group}/{}_{end}{block}", layout.name);
                self.numbers(&path, &dimensions, &values[range.clone()], Some(&unit))?;
            }
        }
        Ok(())
    }

    fn labels(&mut self, group: &str, name: &str, labels: &[String]) -> Result<DimensionId, Error> {
        let path = format!("{group}/{name}");
        let dimension = self.builder.add_dimension_path(&path, labels.len() as u64)?;
        let variable = self.builder.add_string_variable_path(&path, &[dimension])?;
        self.builder.write_string_variable(variable, labels)?;
        Ok(dimension)
    }

    fn axes(
        &mut self,
        group: &str,
        layout: &Layout,
        suffix: &str,
    ) -> Result<Vec<DimensionId>, Error> {
        let mut dimensions = Vec::new();
        for axis in &layout.axes {
            dimensions.push(match &axis.coordinates {
                Coordinates::Labels(labels) => {
                    self.labels(group, &format!("{}{suffix}", axis.name), labels)?
                }
                Coordinates::Grid { values, unit } => {
                    let path = format!("{group}/{}{suffix}", axis.name);
                    let dimension = self.builder.add_dimension_path(&path, values.len() as u64)?;
                    self.numbers(&path, &[dimension], values, Some(&unit.to_string()))?;
                    dimension
                }
            });
        }
        Ok(dimensions)
    }
}
