//! Files written by `netcdf-writer` and by the engine's own `write_response`.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;

use hdf5_reader::BytesStorage;
use lacuna::data::{Axis, Layout, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, below};
use lacuna::plugin::Reader;
use lacuna::plugin::model::Response;
use lacuna::plugin::reader::{EnsembleSource, MeasurementSource};
use netcdf_writer::{NcAttrValue, NcFileBuilder, NcWriteFormat, NcWriteOptions};

use super::NetCdf;
use super::array::File;
use lacuna::text::values::AllowFailed;

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap()
}

fn layout() -> Layout {
    Layout {
        name: "strain".into(),
        unit: unit("1"),
        axes: vec![
            Axis::labels("sensor", ["B", "C"]),
            Axis::grid("time", vec![1e-5, 2e-5, 3e-5], unit("s")),
        ],
    }
}

/// Two records of `strain(time, outer, sensor)` with sensors in the order C, B and times in ms.
fn write(path: &Path, outer: &str, format: NcWriteFormat, times: &[f64]) {
    let mut file = NcFileBuilder::new();
    let time = file.add_dimension("time", 3).unwrap();
    let records = file.add_dimension(outer, 2).unwrap();
    let sensor = file.add_dimension("sensor", 2).unwrap();
    let v = file.add_variable::<f64>("time", &[time]).unwrap();
    file.write_variable(v, times).unwrap();
    file.add_variable_attribute(v, "units", NcAttrValue::Chars("ms".into())).unwrap();
    if format == NcWriteFormat::Nc4 {
        let v = file.add_string_variable("sensor", &[sensor]).unwrap();
        file.write_string_variable(v, &["C", "B"]).unwrap();
    } else {
        let letters = file.add_dimension("letters", 4).unwrap();
        let v = file.add_char_variable("sensor", &[sensor, letters]).unwrap();
        file.write_char_variable(v, b"C   B\0\0\0").unwrap();
    }
    let v = file.add_variable::<f64>("density", &[records]).unwrap();
    file.write_variable(v, &[13.5, 12.0]).unwrap();
    file.add_variable_attribute(v, "units", NcAttrValue::Chars("g/cm3".into())).unwrap();
    let v = file.add_variable::<f32>("strain", &[time, records, sensor]).unwrap();
    file.set_variable_fill_value(v, -1.0f32).unwrap();
    file.add_variable_attribute(v, "units", NcAttrValue::Chars("microstrain".into())).unwrap();
    // Values are 100 record + 10 sensor + time; the second record's first one is missing.
    let values =
        [110.0, 100.0, 210.0, -1.0, 111.0, 101.0, 211.0, 201.0, 112.0, 102.0, 212.0, 202.0];
    file.write_variable(v, &values.map(|x| x as f32)).unwrap();
    let options = NcWriteOptions { format };
    std::fs::write(path, file.to_vec(options).unwrap().1).unwrap();
}

#[test]
fn dimensions_are_found_by_name_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let reader = NetCdf {
        path: Some("a.nc".into()),
        allow_failed: AllowFailed::new(1.0).unwrap(),
        ..NetCdf::default()
    };
    let parameters = [Parameter {
        name: "density".into(),
        symbol: "rho".into(),
        unit: unit("kg/m3"),
        design: Distribution::Uniform([0.0, 1.0]),
        prior: Distribution::Uniform([0.0, 1.0]),
        reference: None,
    }];
    let layout = layout();
    for format in [NcWriteFormat::Classic, NcWriteFormat::Cdf5, NcWriteFormat::Nc4] {
        write(&folder.path().join("a.nc"), "run", format, &[0.01, 0.02, 0.03]);
        let source = EnsembleSource {
            directory: folder.path(),
            simulated: None,
            parameters: &parameters,
            scenario: None,
            layout: &layout,
        };
        let ensemble = reader.ensemble(&source).unwrap();
        assert_eq!((&ensemble.runs[..], ensemble.failed.len()), (&["1".to_owned()][..], 1));
        assert!(ensemble.failed[0].reason.contains("NaN at sensor `B`, time 0.00001 s"));
        assert!((ensemble.points.row(0)[0] - 13_500.0).abs() < 1e-9);
        for (y, expected) in ensemble.responses.row(0).iter().zip([100, 101, 102, 110, 111, 112]) {
            assert!((y - 1e-6 * f64::from(expected)).abs() < 1e-18);
        }
        write(&folder.path().join("a.nc"), "replicate", format, &[0.01, 0.02, 0.03]);
        let source =
            MeasurementSource { directory: folder.path(), scenario: None, layout: &layout };
        let measured = reader.measurements(&source).unwrap();
        assert_eq!((measured.replicates.len(), measured.count()), (2, 11));
        assert_eq!(measured.replicates[1].values[0], None);
    }
}

#[test]
fn files_of_the_simulate_stage_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let layout = layout();
    let values: Vec<f64> = (0..6).map(|i| 1e-6 / (f64::from(i) + 0.3)).collect();
    let response = Response { values: values.clone(), valid: true, facts: vec![] };
    let name = lacuna_run::write_response(folder.path(), "run-1", &layout, &response).unwrap();
    let path = folder.path().join(name);
    assert_eq!(NetCdf::default().response(&path, &layout).unwrap(), values);
    let contents = NetCdf::default().inspect(&path).unwrap();
    let strain = contents.variables.iter().find(|v| v.name == "strain").unwrap();
    assert_eq!(strain.axes, [("sensor".to_owned(), 2), ("time".to_owned(), 3)]);
    assert_eq!(strain.signals.columns.len(), 3);
    assert_eq!(strain.signals.columns[2].values, values[3..]);
    let head = std::fs::read(&path).unwrap();
    assert!(NetCdf::default().recognises(&path, &head));
}

/// Labels of a study may have blanks, begin with a bracket, or look like numbers.
#[test]
fn labels_with_blanks_come_back() {
    for labels in
        [["top left", "top right"], ["[a", "b"], ["1", "2"], ["\"a\" b", "c,d"], [" top", "side "]]
    {
        let folder = tempfile::tempdir().unwrap();
        let axes = vec![Axis::labels("sensor", labels)];
        let layout = Layout { name: "strain".into(), unit: unit("1"), axes };
        let response = Response { values: vec![1.0, 2.0], valid: true, facts: vec![] };
        let name = lacuna_run::write_response(folder.path(), "run-1", &layout, &response).unwrap();
        let read = NetCdf::default().response(&folder.path().join(name), &layout);
        assert_eq!(read.unwrap(), [1.0, 2.0], "{labels:?}");
    }
}

#[test]
fn mismatched_axes_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nc");
    let layout = layout();
    let complaint = |outer: &str, times: &[f64]| {
        write(&path, outer, NcWriteFormat::Classic, times);
        let source =
            MeasurementSource { directory: folder.path(), scenario: None, layout: &layout };
        let reader = NetCdf { path: Some("a.nc".into()), ..NetCdf::default() };
        reader.measurements(&source).unwrap_err().to_string()
    };
    let text = complaint("replicate", &[0.01, 0.02, 0.04]);
    assert!(
        text.contains("dimension `time`: time 0.00004 s is not on the response's axis"),
        "{text}"
    );
    let text = complaint("replicate", &[0.01, 0.02, 0.02]);
    assert!(text.contains("found 2 on 3; `0.00003` is missing"), "{text}");
    let text = complaint("pulse", &[0.01, 0.02, 0.03]);
    assert!(text.contains("expected dimensions `replicate`, `sensor`, `time`"), "{text}");
    std::fs::write(&path, b"CDF\x01").unwrap();
    let text = NetCdf::default().response(&path, &layout).unwrap_err().to_string();
    assert!(text.contains("is not a complete netCDF file"), "{text}");
}

#[test]
fn damaged_files_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nc");
    let layout = layout();
    for (number, format) in [NcWriteFormat::Cdf5, NcWriteFormat::Nc4].into_iter().enumerate() {
        write(&path, "run", format, &[0.01, 0.02, 0.03]);
        let bytes = std::fs::read(&path).unwrap();
        let mut random = Stream::root(7).at(number as u64).generator();
        for round in 0..300 {
            let mut damaged = bytes.clone();
            for _ in 0..=round % 3 {
                let at = below(&mut random, damaged.len());
                damaged[at] = below(&mut random, 256) as u8;
            }
            damaged.truncate(bytes.len() - round % 2 * below(&mut random, bytes.len()));
            let storage = Arc::new(BytesStorage::new(damaged));
            if let Ok(file) = File::from_storage(&path, storage) {
                let _ = file.responses("strain", &layout, Some("run"));
                let _ = super::inspect::contents(&file);
            }
        }
    }
}

/// One curve `strain(sensor, time)` with its standard deviations in microstrain, a masked value, and a covariance in
/// squared microstrain.
fn write_stated(folder: &Path, sigma: [f64; 6], covariance: &[f64]) {
    let save = |name: &str, file: NcFileBuilder| {
        let options = NcWriteOptions { format: NcWriteFormat::Cdf5 };
        std::fs::write(folder.join(name), file.to_vec(options).unwrap().1).unwrap();
    };
    let mut file = NcFileBuilder::new();
    let sensor = file.add_dimension("sensor", 2).unwrap();
    let time = file.add_dimension("time", 3).unwrap();
    let letters = file.add_dimension("letters", 1).unwrap();
    let v = file.add_variable::<f64>("time", &[time]).unwrap();
    file.write_variable(v, &[1e-5, 2e-5, 3e-5]).unwrap();
    let v = file.add_char_variable("sensor", &[sensor, letters]).unwrap();
    file.write_char_variable(v, b"BC").unwrap();
    for (name, unit, values) in [
        ("strain", Some("microstrain"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        ("sigma", Some("microstrain"), sigma),
        ("mask", None, [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
    ] {
        let v = file.add_variable::<f64>(name, &[sensor, time]).unwrap();
        file.write_variable(v, &values).unwrap();
        if let Some(unit) = unit {
            file.add_variable_attribute(v, "units", NcAttrValue::Chars(unit.into())).unwrap();
        }
    }
    save("a.nc", file);
    let mut file = NcFileBuilder::new();
    let size = covariance.len().isqrt() as u64;
    let rows = file.add_dimension("row", size).unwrap();
    let columns = file.add_dimension("column", size).unwrap();
    let v = file.add_variable::<f64>("covariance", &[rows, columns]).unwrap();
    file.write_variable(v, covariance).unwrap();
    file.add_variable_attribute(v, "units", NcAttrValue::Chars("microstrain^2".into())).unwrap();
    save("covariance.nc", file);
}

#[test]
fn one_curve_states_its_noise() {
    let folder = tempfile::tempdir().unwrap();
    let layout = layout();
    let covariance: Vec<f64> = (0..36_usize)
        .map(|k| {
            if k / 6 == k % 6 {
                4.0
            } else if (k / 6).abs_diff(k % 6) == 1 {
                1.0
            } else {
                0.0
            }
        })
        .collect();
    let read = |reader: &NetCdf| {
        let source =
            MeasurementSource { directory: folder.path(), scenario: None, layout: &layout };
        reader.measurements(&source).map_err(|error| error.to_string())
    };
    let plain = NetCdf { path: Some("a.nc".into()), ..NetCdf::default() };
    let with = NetCdf { covariance: Some("covariance.nc".into()), ..plain.clone() };
    write_stated(folder.path(), [0.5, 1.0, 1.5, 2.0, f64::NAN, 3.0], &covariance);
    let data = read(&plain).unwrap();
    assert_eq!((data.replicates.len(), data.count()), (1, 5));
    let sd = data.replicates[0].sd.as_ref().unwrap();
    for (found, expected) in sd.iter().zip([0.5, 1.0, 1.5, 2.0, 0.0, 3.0]) {
        assert!((found - 1e-6 * expected).abs() < 1e-18, "{found}");
    }
    assert!(read(&with).unwrap_err().contains("has a variable `sigma`"));
    write_stated(folder.path(), [0.5, 1.0, 0.0, 2.0, 1.0, 3.0], &covariance);
    let text = read(&plain).unwrap_err();
    assert!(text.contains("above zero, found 0 at sensor `B`, time 0.00003 s"), "{text}");
    let own = super::noise::covariance(&folder.path().join("covariance.nc"), &layout).unwrap();
    assert!((own[(0, 0)] - 4e-12).abs() < 1e-24 && (own[(2, 1)] - 1e-12).abs() < 1e-24);
    write_stated(folder.path(), [1.0; 6], &covariance[..25]);
    let text = super::noise::covariance(&folder.path().join("covariance.nc"), &layout).unwrap_err();
    assert!(text.to_string().contains("expected 6 x 6 numbers, found dimensions [5, 5]"), "{text}");
}
