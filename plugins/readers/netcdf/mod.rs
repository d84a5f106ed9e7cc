//! `netcdf`: runs and measurements in netCDF files with named dimensions.

mod array;
mod inspect;

use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, Layout, Measurements, Replicate, Unit};
use lacuna::plugin::reader::{
    Contents, EnsembleSource, GridSource, MeasurementSource, ReadError, scenario_path,
};
use lacuna::plugin::{Component, Context, Reader};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::array::File;
use super::noise::{self, MASK, REPLICATE, SIGMA};
use super::runs::{self, Run};
use super::{scenario, sierra};
use lacuna::text::values::AllowFailed;

/// Reads netCDF files (classic, 64-bit offset, 64-bit data, netCDF-4) whose dimensions are named like the axes of the
/// response, in any order.
///
/// Each axis has a coordinate variable of its name, with numbers and their `units` or with texts; labels may instead
/// be given by the file's attribute `sensor_labels` (for an axis `sensor`), separated by blanks or, if they have blanks
/// themselves, as a list in JSON (`["top left", "top right"]`). Values are converted by the attribute `units`, unpacked
/// by `scale_factor` and `add_offset`, and missing if they equal `_FillValue` or are NaN.
///
/// **Runs** (section `simulations`): either one file `path` with a further dimension `run` and a variable over it for
/// each parameter, or a table `runs` with one file per run.
///
/// **Measurements** (section `measurements`): one file `path` with a further dimension `replicate`; a variable that
/// has only the axes is one curve.
///
/// **Noise** of the measurements, if it is known: a variable `sigma` with the standard deviation of each value, over
/// the axes and, if it differs between replicates, over `replicate`; or a file `covariance` for one whole curve. A
/// variable `mask` over the same dimensions is non-zero for values to be left out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NetCdf {
    /// File with all runs or all measurements, relative to the study file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Table of runs (CSV), relative to the study file: the columns `run`, `file` and one per parameter. Default, if
    /// `path` is not given either: the runs that the study simulates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<PathBuf>,
    /// Covariance of the noise of one curve, relative to the study file, in the squared unit of the response: a
    /// square variable `covariance` of a netCDF file (`.nc`), or a square of numbers as text. Rows and columns follow
    /// the response, its last axis fastest; it must be symmetric and positive definite.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance: Option<PathBuf>,
    /// Name of the variable that holds the response. Default: the name of the response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variable: Option<String>,
    /// Number of runs without a complete response that may be left out: a fraction if below 1, a count from 1 on.
    /// More of them stop the study.
    pub allow_failed: AllowFailed,
}

impl Component for NetCdf {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.path.is_some() && self.runs.is_some() {
            complaints.at("runs").say("`path` and `runs` exclude each other");
        }
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let paths = [("path", &self.path), ("runs", &self.runs), ("covariance", &self.covariance)];
        let paths = paths.map(|(key, path)| (key, path.as_deref()));
        scenario::check_files(paths, context, complaints);
    }
}

impl NetCdf {
    fn variable<'a>(&'a self, layout: &'a Layout) -> &'a str {
        self.variable.as_deref().unwrap_or(&layout.name)
    }

    fn whole_ensemble(
        &self,
        source: &EnsembleSource<'_>,
        path: &Path,
    ) -> Result<Ensemble, ReadError> {
        let file = File::open(path)?;
        let variable = self.variable(source.layout);
        let values = file.of_scenario(variable, source.layout, Some("run"), source.scenario)?;
        let names = file.names("run", values.len())?;
        let columns = source
            .parameters
            .iter()
            .map(|p| file.along(&p.name, "run", values.len(), Some(&p.unit)))
            .collect::<Result<Vec<_>, _>>()?;
        let valid = if file.has("valid") {
            file.along("valid", "run", values.len(), None)?
        } else {
            vec![1.0; values.len()]
        };
        let runs: Vec<Run> = names
            .into_iter()
            .enumerate()
            .map(|(i, name)| Run {
                name,
                file: None,
                failure: None,
                valid: valid[i] != 0.0,
                point: columns.iter().map(|column| column[i]).collect(),
            })
            .collect();
        for (run, name) in runs.iter().zip(1..) {
            if let Some(p) = run.point.iter().position(|x| !x.is_finite()) {
                let parameter = &source.parameters[p].name;
                let text = format!("run {name} has no finite value of `{parameter}`");
                return Err(ReadError::new(path, text));
            }
        }
        runs::ensemble(source, path, &runs, self.allow_failed, |i, _| {
            let values = values[i].clone();
            runs::finite(path, source.layout, &values).map(|()| values)
        })
    }
}

impl Reader for NetCdf {
    fn recognises(&self, path: &Path, head: &[u8]) -> bool {
        sierra::signal::is_exodus(head) && !sierra::Sierra::default().recognises(path, head)
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        inspect::contents(&File::open(path)?)
    }

    fn names_files(&self) -> bool {
        self.path.is_some() || self.runs.is_some()
    }

    fn allowed_failures(&self, runs: usize) -> Option<usize> {
        Some(self.allow_failed.of(runs))
    }

    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        if let Some(path) = &self.path {
            return self
                .whole_ensemble(source, &scenario_path(source.directory, path, source.scenario));
        }
        let table = runs::table_path(source, self.runs.as_deref(), "runs")?;
        let list = runs::read_runs(&table, source.parameters)?;
        runs::ensemble(source, &table, &list, self.allow_failed, |_, run| {
            let file = run.file.as_ref().ok_or_else(|| {
                ReadError::new(&table, format!("run `{}` has no file", run.name))
                    .help("name it in a column `file`")
            })?;
            self.response(file, source.layout)
        })
    }

    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        let path = self.path.as_ref().ok_or_else(|| {
            ReadError::new(source.directory, "there is no file of measurements")
                .help("name it with `path`")
        })?;
        let path = scenario_path(source.directory, path, source.scenario);
        let file = File::open(&path)?;
        let layout = source.layout;
        let variable = self.variable(layout);
        let values = file.curves(variable, layout, source.scenario)?;
        let names = file.names(REPLICATE, values.len())?;
        let beside = |name: &str| file.has(name) && name != variable;
        let mask = if beside(MASK) {
            let plain = Layout { unit: Unit::dimensionless(), ..layout.clone() };
            Some(repeated(file.curves(MASK, &plain, source.scenario)?, values.len(), &file, MASK)?)
        } else {
            None
        };
        let sigma = if beside(SIGMA) {
            Some(repeated(
                file.widths(SIGMA, layout, source.scenario)?,
                values.len(),
                &file,
                SIGMA,
            )?)
        } else {
            None
        };
        let mut replicates = Vec::new();
        for (r, (name, values)) in names.into_iter().zip(values).enumerate() {
            if let Some(i) = values.iter().position(|y| y.is_infinite()) {
                let text = format!("replicate `{name}` is {} at {}", values[i], layout.describe(i));
                return Err(ReadError::new(&path, text));
            }
            let out = |i: usize| mask.as_ref().is_some_and(|mask| mask[r][i] != 0.0);
            let used = |(i, y): (usize, f64)| (!y.is_nan() && !out(i)).then_some(y);
            let mut replicate =
                Replicate::new(name, values.into_iter().enumerate().map(used).collect());
            replicate.sd = sigma.as_ref().map(|sigma| sigma[r].clone());
            stated(&path, layout, &mut replicate)?;
            replicates.push(replicate);
        }
        let mut data = Measurements::new(layout.clone(), replicates);
        let of_curve = self.covariance.as_ref();
        if let Some(covariance) = of_curve {
            let covariance = scenario_path(source.directory, covariance, source.scenario);
            if data.states_noise() {
                return Err(ReadError::new(
                    &path,
                    "has a variable `sigma`, and the study names a covariance too",
                )
                .help("the noise is stated once: take out `covariance`, or the variable"));
            }
            data.covariance = Some(noise::covariance(&covariance, layout)?);
        }
        Ok(data)
    }

    fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let path = self.path.as_ref().ok_or_else(|| {
            ReadError::new(source.directory, "there is no file of measurements")
                .help("name it with `path`")
        })?;
        let file = File::open(&scenario_path(source.directory, path, source.scenario))?;
        file.grid(source.axis, source.unit)
    }

    fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        let file = File::open(path)?;
        let mut values = file.responses(self.variable(layout), layout, None)?;
        let values = values.pop().unwrap_or_default();
        runs::finite(path, layout, &values)?;
        Ok(values)
    }

    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        let file = |path: &PathBuf| scenario_path(directory, path, scenario);
        let mut files: Vec<PathBuf> =
            [&self.path, &self.runs, &self.covariance].into_iter().flatten().map(file).collect();
        if let Some(table) = &self.runs {
            files.extend(runs::named_files(&file(table)));
        }
        files
    }
}

/// Returns one row per replicate of a variable that is given for each replicate or once for all.
fn repeated(
    mut rows: Vec<Vec<f64>>,
    replicates: usize,
    file: &File,
    name: &str,
) -> Result<Vec<Vec<f64>>, ReadError> {
    if rows.len() == 1 {
        rows.resize(replicates, rows[0].clone());
    }
    if rows.len() != replicates {
        let text = format!("expected {replicates} replicates, found {}", rows.len());
        return Err(file.complain(text).at(format!("variable `{name}`")));
    }
    Ok(rows)
}

/// Fails if a measured value has no standard deviation above zero.
fn stated(path: &Path, layout: &Layout, replicate: &mut Replicate) -> Result<(), ReadError> {
    let Some(sd) = &mut replicate.sd else { return Ok(()) };
    for (i, sd) in sd.iter_mut().enumerate() {
        if replicate.values[i].is_none() {
            *sd = 0.0;
        } else if !(sd.is_finite() && *sd > 0.0) {
            let text = format!(
                "expected a standard deviation above zero, found {sd} at {} of replicate `{}`",
                layout.describe(i),
                replicate.name
            );
            return Err(ReadError::new(path, text).at(format!("variable `{SIGMA}`")));
        }
    }
    Ok(())
}

/// Reads a square variable of a file; see [`noise::covariance`].
pub(super) fn square(path: &Path, name: &str, layout: &Layout) -> Result<noise::Square, ReadError> {
    let values = File::open(path)?.square(name, layout)?;
    Ok(noise::Square { places: (0..layout.len()).collect(), values })
}

lacuna::register!(Reader, "netcdf", NetCdf, aliases: ["nc", "netcdf4"]);

#[cfg(test)]
mod tests;
