//! `sierra`: output of Sierra/SM, Exodus II and heartbeat files.
//!
//! The folder also provides the formats to other readers and writers: [`exodus`], [`heartbeat`] and [`mod@write`].

pub mod container;
pub mod exodus;
pub mod heartbeat;
mod inspect;
mod legend;
pub mod locate;
pub mod parts;
pub mod probe;
pub mod signal;
pub mod write;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::data::{Axis, Coordinates, Ensemble, Layout, Unit};
use lacuna::plugin::reader::{Contents, EnsembleSource, ReadError, scenario_path};
use lacuna::plugin::{Component, Context, Reader};
use lacuna::text::problem::Complaints;
use lacuna::text::values::Fraction;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::probe::Probe;
use self::signal::Output;
use super::runs::{self, Run};
use super::scenario;
use lacuna::text::values::AllowFailed;

/// Reads Sierra's output of each run: Exodus II results or history files, in any netCDF container and in one file or
/// one per processor, and heartbeat text in any of its formats.
///
/// ```toml
/// [simulations]
/// use = "sierra"
/// runs = "runs.csv"
/// file = "run_{run}/strain.h"
/// variable = "strain_{sensor}"
///
/// [simulations.sensors.B]
/// variable = "log_strain"
/// nearest = [0.055, 0.0, 0.0]
/// direction = [1.0, 1.0, 0.0]
/// ```
///
/// Each sensor's signal is interpolated linearly to the response's times. A run whose file is missing, damaged or too
/// short, or holds a value that is not finite, counts as failed.
///
/// Sources: the format descriptions in the SEACAS library's `exodusII_int.h`, `Iohb_DatabaseIO.C` and
/// `Iohb_Layout.C`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sierra {
    /// Table of runs (CSV), relative to the study file: the columns `run`, one per parameter, and `file` unless the
    /// key `file` is given. Default: the runs that the study simulates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<PathBuf>,
    /// File of each run, relative to the table of runs; `{run}` is replaced by the name of the run. For the files of
    /// a parallel run the common name suffices: `strain.e` for `strain.e.96.00` and so on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Variable of every sensor that has no entry of its own under `sensors`. The name of an axis in braces is
    /// replaced by the label on it: `strain_{sensor}`. Default, if there are no `sensors` either: the column of a heartbeat file, or
    /// the global variable of a history file, that is named like response and sensor, `strain_B` or `B_strain`, or like the sensor
    /// alone, in upper or lower case; without sensors, like the response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variable: Option<String>,
    /// Locations of single sensors in the output, by label.
    pub sensors: BTreeMap<String, Probe>,
    /// Unit of the values in the files. Default: the response's unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Unit of the times in the files. Default: the unit of the response's time axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<Unit>,
    /// Part of the response's time axis that a file may lack at either end, as a fraction of the axis spacing; there
    /// the first or last value is used.
    pub tolerance: Fraction,
    /// Number of runs without a usable file that may be left out: a fraction if below 1, a count from 1 on. More of
    /// them stop the study.
    pub allow_failed: AllowFailed,
}

impl Default for Sierra {
    fn default() -> Self {
        Self {
            runs: None,
            file: None,
            variable: None,
            sensors: BTreeMap::new(),
            unit: None,
            time_unit: None,
            tolerance: Fraction::new(0.01).expect("0.01 is a fraction"),
            allow_failed: AllowFailed::default(),
        }
    }
}

impl Component for Sierra {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        match Curves::new(context.layout) {
            Err(text) => {
                complaints.at("").say(text);
            }
            Ok(curves) => self.check_sensors(&curves, complaints),
        }
        let time = context.layout.axes.iter().find_map(|axis| match &axis.coordinates {
            Coordinates::Grid { unit, .. } => Some(unit),
            Coordinates::Labels(_) => None,
        });
        for (key, from, to) in
            [("unit", &self.unit, Some(&context.layout.unit)), ("time_unit", &self.time_unit, time)]
        {
            if let (Some(from), Some(to)) = (from, to)
                && from.factor_to(to).is_none()
            {
                complaints
                    .at(key)
                    .say(format!("`{key}` does not convert to the response's"))
                    .expected(format!("a unit like `{to}`"))
                    .found(format!("`{from}`"));
            }
        }
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        scenario::check_files([("runs", self.runs.as_deref())], context, complaints);
    }
}

impl Sierra {
    fn check_sensors(&self, curves: &Curves<'_>, complaints: &mut Complaints<'_>) {
        let names: Vec<&str> = curves.list.iter().map(|curve| curve.name.as_str()).collect();
        for sensor in self.sensors.keys().filter(|sensor| !names.contains(&sensor.as_str())) {
            complaints
                .at(&format!("sensors.{sensor}"))
                .say(format!("the response has no sensor `{sensor}`"))
                .expected(super::listed(&names));
        }
        if self.variable.is_none()
            && !self.sensors.is_empty()
            && let Some(name) = names.iter().find(|name| !self.sensors.contains_key(**name))
        {
            complaints
                .at("sensors")
                .say(format!("the options do not state where sensor `{name}` is read"))
                .help("add it under `sensors`, or give a pattern such as `variable = \"strain_{sensor}\"`");
        }
        if let Some(pattern) = &self.variable {
            let varies = curves.labels.iter().all(|axis| pattern.contains(&format!("{{{axis}}}")));
            if !varies && names.len() > 1 {
                complaints.at("variable").say("`variable` is the same for several sensors").help(
                    format!("write `{{{}}}` where the name varies", curves.labels.join("}{")),
                );
            }
        }
    }

    fn probe(&self, curve: &Curve, response: &str, output: &Output) -> Result<Probe, ReadError> {
        if let Some(probe) = self.sensors.get(&curve.name) {
            return Ok(probe.clone());
        }
        let Some(pattern) = &self.variable else {
            if !self.sensors.is_empty() {
                let name = &curve.name;
                let text =
                    format!("neither `variable` nor `sensors` states where `{name}` is read");
                return Err(ReadError::new(output.path(), text));
            }
            let labels: Vec<&str> = curve.labels.iter().map(|(_, label)| label.as_str()).collect();
            return Ok(Probe::named(legend::column(output, response, &labels)?));
        };
        let name = curve.labels.iter().fold(pattern.clone(), |name, (axis, label)| {
            name.replace(&format!("{{{axis}}}"), label)
        });
        Ok(Probe::named(name))
    }

    fn run_file(&self, table: &Path, run: &Run) -> Result<PathBuf, ReadError> {
        let pattern =
            self.file.as_ref().map(|file| table.with_file_name(file.replace("{run}", &run.name)));
        pattern.or_else(|| run.file.clone()).ok_or_else(|| {
            ReadError::new(table, format!("run `{}` has no file", run.name))
                .help("name it in a column `file`, or give `file = \"run_{run}/strain.h\"`")
        })
    }
}

impl Reader for Sierra {
    fn recognises(&self, path: &Path, head: &[u8]) -> bool {
        if signal::is_exodus(head) {
            return inspect::looks_like_exodus(path, head);
        }
        !head.contains(&0) && heartbeat::recognised(head)
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        inspect::contents(path)
    }

    fn names_files(&self) -> bool {
        self.runs.is_some()
    }

    fn allowed_failures(&self, runs: usize) -> Option<usize> {
        Some(self.allow_failed.of(runs))
    }

    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        let table = runs::table_path(source, self.runs.as_deref(), "runs")?;
        let list = runs::read_runs(&table, source.parameters)?;
        // The simulate stage names its files in its own table; the pattern applies to the user's table.
        let named = source.simulated.is_none() || self.runs.is_some();
        runs::ensemble(source, &table, &list, self.allow_failed, |_, run| {
            let file = match &run.file {
                Some(file) if !named => file.clone(),
                _ => self.run_file(&table, run)?,
            };
            self.response(&file, source.layout)
        })
    }

    fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        let complain = |text: String| ReadError::new(path, text);
        let curves = Curves::new(layout).map_err(complain)?;
        let factor = |from: &Option<Unit>, to: &Unit| match from {
            None => Ok(1.0),
            Some(from) => from
                .factor_to(to)
                .ok_or_else(|| complain(format!("unit `{from}` does not convert to `{to}`"))),
        };
        let scale = factor(&self.unit, &layout.unit)?;
        let time_scale = factor(&self.time_unit, curves.time_unit)?;
        let output = Output::open(path)?;
        let mut response = vec![0.0; layout.len()];
        for curve in &curves.list {
            let probe = self.probe(curve, &layout.name, &output)?;
            let mut signal = output.signal(&probe)?;
            signal.times.iter_mut().for_each(|t| *t *= time_scale);
            let values = signal.resampled(curves.times, self.tolerance.get()).map_err(|text| {
                complain(text).at(format!("sensor `{}`, variable `{}`", curve.name, probe.variable))
            })?;
            for (&place, value) in curve.places.iter().zip(values) {
                response[place] = scale * value;
            }
        }
        Ok(response)
    }

    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        let Some(runs) = &self.runs else { return Vec::new() };
        let table = scenario_path(directory, runs, scenario);
        let list = runs::read_runs(&table, &[]).unwrap_or_default();
        let mut files: Vec<PathBuf> = list
            .iter()
            .filter_map(|run| self.run_file(&table, run).ok())
            .flat_map(|file| parts::part_paths(&file).0)
            .collect();
        files.insert(0, table);
        files
    }
}

/// The response as curves over time, one per sensor.
struct Curves<'a> {
    times: &'a [f64],
    time_unit: &'a Unit,
    labels: Vec<&'a str>,
    list: Vec<Curve>,
}

struct Curve {
    name: String,
    labels: Vec<(String, String)>,
    places: Vec<usize>,
}

impl<'a> Curves<'a> {
    fn new(layout: &'a Layout) -> Result<Self, String> {
        let grids: Vec<(&[f64], &Unit)> = layout
            .axes
            .iter()
            .filter_map(|axis| match &axis.coordinates {
                Coordinates::Grid { values, unit } => Some((&values[..], unit)),
                Coordinates::Labels(_) => None,
            })
            .collect();
        let [(times, time_unit)] = grids[..] else {
            return Err(format!(
                "this reader gives signals over time: it needs a response with one numeric axis, \
                 `{}` has {}",
                layout.name,
                grids.len()
            ));
        };
        let is_label = |axis: &&Axis| matches!(axis.coordinates, Coordinates::Labels(_));
        let labels = layout.axes.iter().filter(is_label).map(|axis| axis.name.as_str()).collect();
        let list = layout.groups().into_iter().map(|group| {
            let place = layout.place(group.indices[0]);
            let labels = layout
                .axes
                .iter()
                .zip(place)
                .filter(|(axis, _)| is_label(axis))
                .map(|(axis, i)| (axis.name.clone(), axis.text(i)))
                .collect();
            Curve { name: group.name, labels, places: group.indices }
        });
        Ok(Self { times, time_unit, labels, list: list.collect() })
    }
}

lacuna::register!(Reader, "sierra", Sierra, aliases: ["exodus", "exodusii"]);

#[cfg(test)]
mod tests;
