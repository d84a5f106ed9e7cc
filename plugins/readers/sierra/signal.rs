//! Signals of the gauges, in their direction, on the response's time axis and in its unit.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use lacuna::plugin::reader::ReadError;

use super::exodus::Kind;
use super::heartbeat::Heartbeat;
use super::parts::Results;
use super::probe::Probe;

/// Components of a symmetric tensor, in Sierra's order.
pub const COMPONENTS: [&str; 6] = ["xx", "yy", "zz", "xy", "yz", "zx"];

/// Sierra's output of one run.
pub enum Output {
    /// Exodus II: results or history, in one file or several parts.
    Exodus(Results),
    /// Heartbeat text.
    Heartbeat(Heartbeat),
}

impl Output {
    /// Opens a file of either format.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        if path.is_dir() {
            return Err(ReadError::new(path, "is a folder, expected a file"));
        }
        let mut head = [0; 4];
        let length = match File::open(path) {
            // The common name of a parallel run's parts is not the name of a file.
            Err(_) => return Results::open(path).map(Self::Exodus),
            Ok(mut file) => file
                .read(&mut head)
                .map_err(|e| ReadError::new(path, format!("cannot be read: {e}")))?,
        };
        if is_exodus(&head[..length]) {
            Results::open(path).map(Self::Exodus)
        } else {
            Heartbeat::read(path).map(Self::Heartbeat)
        }
    }

    /// Returns the signal of one gauge.
    pub fn signal(&self, probe: &Probe) -> Result<Signal, ReadError> {
        let Some(direction) = probe.direction else {
            return self.variable(&probe.variable, probe);
        };
        let weights = normal_weights(direction).map_err(|text| self.complain(text))?;
        let mut sum: Option<Signal> = None;
        for (component, weight) in COMPONENTS.into_iter().zip(weights) {
            // A plane mesh has no components normal to its plane, and none is required.
            if weight == 0.0 {
                continue;
            }
            let name = if probe.variable.contains("{component}") {
                probe.variable.replace("{component}", component)
            } else {
                format!("{}_{component}", probe.variable)
            };
            let part = self.variable(&name, probe)?;
            match &mut sum {
                None => {
                    let values = part.values.iter().map(|x| weight * x).collect();
                    sum = Some(Signal { times: part.times, values });
                }
                Some(sum) => {
                    for (total, x) in sum.values.iter_mut().zip(part.values) {
                        *total += weight * x;
                    }
                }
            }
        }
        sum.ok_or_else(|| self.complain("the vector `direction` is zero"))
    }

    fn variable(&self, name: &str, probe: &Probe) -> Result<Signal, ReadError> {
        let (times, values) = match self {
            Self::Exodus(results) => results.series(name, probe)?,
            Self::Heartbeat(table) if probe.is_placed() || probe.kind.is_some() => {
                let text = format!("is a heartbeat file, which has columns only: `{name}` is one");
                return Err(ReadError::new(&table.path, text)
                    .help("leave out `kind`, `block`, `id` and `nearest`"));
            }
            Self::Heartbeat(table) => table.series(name)?,
        };
        Ok(Signal::increasing(times, values))
    }

    fn complain(&self, text: impl Into<String>) -> ReadError {
        ReadError::new(self.path(), text)
    }

    /// Names of the signals that need no place: columns of a heartbeat file, global variables of a history file.
    pub fn column_names(&self) -> &[String] {
        match self {
            Self::Exodus(results) => results.parts()[0].names(Kind::Global),
            Self::Heartbeat(table) => &table.names,
        }
    }

    /// Returns true for heartbeat text.
    pub fn is_heartbeat(&self) -> bool {
        matches!(self, Self::Heartbeat(_))
    }

    /// Returns the path of the file, or of the first of several parts.
    pub fn path(&self) -> &Path {
        match self {
            Self::Exodus(results) => results.parts()[0].path(),
            Self::Heartbeat(table) => &table.path,
        }
    }
}

/// Returns true if the beginning of a file shows a netCDF container.
pub(crate) fn is_exodus(head: &[u8]) -> bool {
    head.starts_with(b"CDF") || head.starts_with(b"\x89HDF")
}

/// Returns the weights of the tensor's components in e = d·E·d, with d of unit length.
fn normal_weights(direction: [f64; 3]) -> Result<[f64; 6], String> {
    let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
    if !(length.is_finite() && length > 0.0) {
        return Err(format!("the vector `direction` {direction:?} must be finite and not zero"));
    }
    let [x, y, z] = direction.map(|d| d / length);
    Ok([x * x, y * y, z * z, 2.0 * x * y, 2.0 * y * z, 2.0 * z * x])
}

/// A quantity over increasing times.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Strictly increasing times.
    pub times: Vec<f64>,
    /// Value at each time.
    pub values: Vec<f64>,
}

impl Signal {
    /// Makes the times increase: of steps repeated by a restart the later ones are kept.
    fn increasing(times: Vec<f64>, values: Vec<f64>) -> Self {
        if times.is_sorted_by(|a, b| a < b) {
            return Self { times, values };
        }
        let mut kept = Self { times: Vec::new(), values: Vec::new() };
        for (t, y) in times.into_iter().zip(values) {
            while kept.times.last().is_some_and(|last| *last >= t) {
                kept.times.pop();
                kept.values.pop();
            }
            kept.times.push(t);
            kept.values.push(y);
        }
        kept
    }

    /// Interpolates linearly to the given increasing times.
    ///
    /// Files print times with few digits and write the first step after the requested time, so that up to `tolerance`
    /// times the mean spacing of `times` may be missing at either end; there the end value is used. A larger gap is
    /// an error, as is a value that is not finite.
    pub fn resampled(&self, times: &[f64], tolerance: f64) -> Result<Vec<f64>, String> {
        let (Some(&first), Some(&last)) = (self.times.first(), self.times.last()) else {
            return Err("has no time steps".to_owned());
        };
        let (Some(&from), Some(&to)) = (times.first(), times.last()) else {
            return Ok(Vec::new());
        };
        let spacing = match times.len() {
            1 => to.abs(),
            n => (to - from) / (n as f64 - 1.0),
        };
        let slack = tolerance * spacing;
        if first > from + slack || last < to - slack {
            return Err(format!(
                "times go from {first:e} to {last:e} and do not cover the response's {from:e} to \
                 {to:e}: an unfinished run?"
            ));
        }
        times.iter().map(|&t| self.at(t)).collect()
    }

    fn at(&self, t: f64) -> Result<f64, String> {
        let after = self.times.partition_point(|&x| x < t);
        let value = if after == 0 {
            self.values[0]
        } else if after == self.times.len() {
            self.values[after - 1]
        } else if self.times[after] == t {
            // Exact, and independent of a neighbour that is not finite.
            self.values[after]
        } else {
            let (t0, t1) = (self.times[after - 1], self.times[after]);
            let (y0, y1) = (self.values[after - 1], self.values[after]);
            y0 + (y1 - y0) * (t - t0) / (t1 - t0)
        };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(format!("the value at time {t:e} is {value}"))
        }
    }
}
