//! Arrays in memory, read as groups and stacked, on the axis and off it.
#![allow(clippy::unwrap_used)]
#![allow(clippy::unnecessary_wraps, reason = "the form of `Open`")]

use std::f64::consts::PI;
use std::path::Path;

use lacuna::data::{Axis, Layout, Measurements, Unit};
use lacuna::plugin::reader::{MeasurementSource, ReadError};

use super::Records;
use super::store::{Array, Store, by_number, captured};

struct Memory {
    names: Vec<String>,
    arrays: Vec<Array>,
}

impl Memory {
    fn add(&mut self, name: &str, shape: &[usize], values: Vec<f64>, unit: Option<&str>) {
        assert_eq!(shape.iter().product::<usize>(), values.len());
        self.names.push(name.to_owned());
        let unit = unit.map(str::to_owned);
        self.arrays.push(Array { shape: shape.to_vec(), values, unit });
    }
}

impl Store for Memory {
    fn path(&self) -> &Path {
        Path::new("memory")
    }

    fn format(&self) -> String {
        "memory".to_owned()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn array(&self, name: &str) -> Result<Array, ReadError> {
        Ok(self.arrays[self.names.iter().position(|n| n == name).unwrap()].clone())
    }
}

/// The value of replicate 1, 2, ... at sensor `B` (0) or `C` (1) and time 1, 2, 3 ms, in microstrain.
fn value(replicate: usize, sensor: usize, time: usize) -> f64 {
    (100 * replicate + 10 * (sensor + 1) + time) as f64
}

/// The file `groups`: a group per pulse, pulse 2 without sensor C and with a missing value of B; `stacked`: all in one
/// array, sensors in the order C, A, B; `lacking`: pulse 1 with one time too few.
fn open(path: &Path) -> Result<Box<dyn Store>, ReadError> {
    let mut file = Memory { names: Vec::new(), arrays: Vec::new() };
    let stem = path.file_name().unwrap().to_str().unwrap();
    if stem == "stacked" {
        let mut values = Vec::new();
        for pulse in 1..=2 {
            for sensor in [Some(1), None, Some(0)] {
                values.extend((1..=3).map(|t| sensor.map_or(-1.0, |s| value(pulse, s, t))));
            }
        }
        file.add("all", &[2, 3, 3, 1], values, Some("microstrain"));
        file.add("time", &[1, 3], vec![1.0, 2.0, 3.0], Some("ms"));
        return Ok(Box::new(file));
    }
    for pulse in [1, 10, 2] {
        for (sensor, label) in ["B", "C"].into_iter().enumerate() {
            let mut values: Vec<f64> = (1..=3).map(|t| value(pulse, sensor, t)).collect();
            if (pulse, label) == (2, "C") {
                continue;
            }
            if pulse == 2 {
                values[1] = f64::NAN;
            }
            file.add(&format!("pulse_{pulse}/strain_{label}"), &[3], values, Some("microstrain"));
        }
        let count = if stem == "lacking" { 2 } else { 3 };
        let times = (1..=count).map(f64::from).collect();
        file.add(&format!("pulse_{pulse}/time"), &[count as usize], times, Some("ms"));
    }
    Ok(Box::new(file))
}

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap()
}

fn layout() -> Layout {
    let axes = vec![
        Axis::labels("sensor", ["B", "C"]),
        Axis::grid("time", vec![1e-3, 2e-3, 3e-3], unit("s")),
    ];
    Layout { name: "strain".into(), unit: unit("1"), axes }
}

fn read(file: &str, options: &str) -> Result<Measurements, String> {
    let records: Records = toml::from_str(&format!("path = \"{file}\"\n{options}")).unwrap();
    let layout = layout();
    let source = MeasurementSource { directory: Path::new("."), scenario: None, layout: &layout };
    records.measurements(open, &source).map_err(|e| e.to_string())
}

const GROUPS: &str =
    "dataset = \"pulse_{replicate}/strain_{sensor}\"\ntime = \"pulse_{replicate}/time\"";

#[test]
fn a_group_per_pulse_is_a_replicate_each_in_the_order_of_numbers() {
    let data = read("groups", GROUPS).unwrap();
    let names: Vec<&str> = data.replicates.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(names, ["1", "2", "10"]);
    let right = |pulse: usize| (0..6).map(move |i| 1e-6 * value(pulse, i / 3, i % 3 + 1));
    for (replicate, pulse) in data.replicates.iter().zip([1, 2, 10]) {
        for (i, (found, right)) in replicate.values.iter().zip(right(pulse)).enumerate() {
            if pulse == 2 && (i == 1 || i >= 3) {
                assert_eq!(*found, None);
            } else {
                assert!((found.unwrap() - right).abs() < 1e-12, "{pulse} {i}");
            }
        }
    }
}

#[test]
fn a_stacked_array_is_cut_along_named_dimensions() {
    let options = "dataset = \"all\"\ntime = \"time\"\naxes = [\"replicate\", \"sensor\", \"time\"]\n\
                   labels = { sensor = [\"C\", \"A\", \"B\"] }";
    let stacked = read("stacked", options).unwrap();
    let groups = read("groups", GROUPS).unwrap();
    assert_eq!(stacked.replicates.len(), 2);
    assert_eq!(stacked.replicates[0], groups.replicates[0]);
    // The axes are in the order of the response by default.
    let default = "dataset = \"all\"\ntime = \"time\"\nlabels = { sensor = [\"C\", \"A\", \"B\"] }";
    assert_eq!(read("stacked", default).unwrap(), stacked);
}

#[test]
fn errors_name_dataset_shape_and_what_was_expected() {
    for (file, options, right) in [
        (
            "lacking",
            GROUPS,
            "memory, dataset `pulse_1/time`: expected 3 times, as many as samples of \
          `pulse_1/strain_B`, found the shape [2]",
        ),
        (
            "stacked",
            "dataset = \"all\"\ntime = \"time\"",
            "expected 2 values of `sensor`, found 3 along dimension 2 \
          of the shape [2, 3, 3]",
        ),
        (
            "stacked",
            "dataset = \"none\"\ntime = \"time\"",
            "has no dataset `none`; it has `all`, `time`",
        ),
        (
            "stacked",
            "dataset = \"all\"\ntime = \"time\"\naxes = [\"sensor\", \"time\"]",
            "expected the dimensions `sensor`, `time`, found the shape [2, 3, 3, 1]",
        ),
        (
            "groups",
            "dataset = \"pulse_{replicate}/strain_{sensor}\"\nstep = 1e-3",
            "time 0 s is not on the \
          response's axis of 3 values from 0.001 to 0.003 s; `resample` takes other times",
        ),
        (
            "groups",
            "dataset = \"pulse_{replicate}/strain_{sensor}\"\nstep = 1e-3\nfirst = 2e-3\nresample = \"linear\"",
            "no record reaches sensor `B`, time 0.001 s and 1 more values",
        ),
        (
            "groups",
            "dataset = \"pulse_{replicate}/strain_{sensor}\"\nstep = 1e-3\nfirst = 1e-3\nresample = \"linear\"\n\
          trigger = { channel = \"pulse_{replicate}/time\", level = 7 }",
            "dataset `pulse_1/time`: never rises through the \
          trigger level 7: its 3 samples are from 1 to 3",
        ),
        (
            "groups",
            "dataset = \"pulse_{replicate}/strain_{sensor}\"\nstep = 1\ntime_unit = \"m\"",
            "is in `m`, which does not convert to `s`",
        ),
    ] {
        let found = read(file, options).unwrap_err();
        assert!(found.contains(right), "{options}\n{found}\nand not\n{right}");
    }
}

/// Three records of sin(2 pi 40 t + 1), each with a clock that starts at another time, and a ramp that reaches 0.5 when t is
/// 0: resampled, they agree with the sine at the times of the response.
#[test]
fn records_with_different_clocks_are_aligned_by_a_trigger() {
    fn clocks(_: &Path) -> Result<Box<dyn Store>, ReadError> {
        let mut file = Memory { names: Vec::new(), arrays: Vec::new() };
        for (pulse, start) in [(1, 0.0), (2, 0.123_4), (3, -7.77)] {
            let t = |n: usize| n as f64 * 1e-4 - 0.300_03;
            let values = (0..9000).map(|n| (2.0 * PI * 40.0 * t(n) + 1.0).sin()).collect();
            file.add(&format!("s{pulse}"), &[9000], values, None);
            let ramp = (0..9000).map(|n| 0.5 + t(n)).collect();
            file.add(&format!("ramp{pulse}"), &[9000], ramp, None);
            let times = (0..9000).map(|n| t(n) + start).collect();
            file.add(&format!("time{pulse}"), &[9000], times, None);
        }
        Ok(Box::new(file))
    }
    let grid: Vec<f64> = (0..50).map(|k| 0.002 * f64::from(k)).collect();
    let axes = vec![Axis::grid("time", grid.clone(), unit("s"))];
    let layout = Layout { name: "s".into(), unit: unit("1"), axes };
    // The bound of linear interpolation is h^2/8 max |s''|; that of the filter is the ripple of its pass band.
    let linear = 1e-8 / 8.0 * (2.0 * PI * 40.0_f64).powi(2);
    for (how, bound) in [("linear", linear), ("filtered", 1e-3)] {
        let options = format!(
            "path = \"x\"\ndataset = \"s{{replicate}}\"\ntime = \"time{{replicate}}\"\nresample = \"{how}\"\n\
             trigger = {{ channel = \"ramp{{replicate}}\", level = 0.5 }}"
        );
        let records: Records = toml::from_str(&options).unwrap();
        let source =
            MeasurementSource { directory: Path::new("."), scenario: None, layout: &layout };
        let data = records.measurements(clocks, &source).unwrap();
        assert_eq!(data.replicates.len(), 3);
        for replicate in &data.replicates {
            for (found, t) in replicate.values.iter().zip(&grid) {
                let error = (found.unwrap() - (2.0 * PI * 40.0 * t + 1.0).sin()).abs();
                assert!(error <= bound * 1.01, "{how} {t}: {error}");
            }
        }
    }
}

#[test]
fn names_are_captured_and_ordered_by_their_numbers() {
    assert_eq!(captured("p_{replicate}/x", "p_12/x").as_deref(), Some("12"));
    assert_eq!(captured("p_{replicate}/x{replicate}", "p_a/xa").as_deref(), Some("a"));
    assert_eq!(captured("p_{replicate}/x{replicate}", "p_a/xb"), None);
    assert_eq!(captured("p_{replicate}x", "p_x"), None);
    assert_eq!(captured("{replicate}x", "a/x"), None);
    let mut names = ["p10", "p9", "q1", "p09b", "p9a", "10", "9"];
    names.sort_by(|a, b| by_number(a, b));
    assert_eq!(names, ["9", "10", "p9", "p9a", "p09b", "p10", "q1"]);
}
