//! Files written by npTDMS.

use std::path::Path;

use lacuna::data::{Axis, Layout, Unit};
use lacuna::plugin::Reader;
use lacuna::plugin::reader::MeasurementSource;

use super::super::Tdms;
use super::super::file::File;
use super::sample;
use crate::readers::records::store::Store as _;

#[test]
fn every_type_is_read_as_nptdms_reads_it() {
    let file = File::open(&sample("types.tdms")).unwrap();
    let text = std::fs::read_to_string(sample("types.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((rows[0].len(), rows.len()), (15, 17));
    for (j, name) in rows[0].iter().enumerate() {
        let right: Vec<f64> = rows[1..].iter().map(|row| row[j].parse().unwrap()).collect();
        let found = file.array(name).unwrap();
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
        assert_eq!(found.shape, [16], "{name}");
        assert!(found.values.iter().zip(&right).all(same), "{name}: {:?} {right:?}", found.values);
    }
    assert_eq!(file.array("types/time").unwrap().unit.as_deref(), Some("s"));
    for (name, right) in [
        ("types/text", "channel `types/text`: holds text, which is not numbers"),
        ("types/complex", "channel `types/complex`: holds complex numbers"),
        ("types/gauge", "channel `types/gauge`: has the scale `Strain`"),
    ] {
        let error = file.array(name).unwrap_err().to_string();
        assert!(error.contains(right) && error.contains("types.tdms"), "{error}");
    }
    let contents = Tdms::default().inspect(&sample("types.tdms")).unwrap();
    assert_eq!((contents.format.as_str(), contents.variables.len()), ("TDMS", 15));
    assert_eq!(contents.facts.len(), 3);
}

fn layout(times: Vec<f64>) -> Layout {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let axes = vec![Axis::labels("sensor", ["B", "C"]), Axis::grid("time", times, unit("s"))];
    Layout { name: "strain".into(), unit: unit("1"), axes }
}

fn measured(options: &str, layout: &Layout) -> Result<Vec<Option<f64>>, String> {
    let reader: Tdms = toml::from_str(&format!("path = \"records.tdms\"\n{options}")).unwrap();
    let directory = sample("");
    let source = MeasurementSource { directory: &directory, scenario: None, layout };
    let found = reader.measurements(&source).map_err(|e| e.to_string())?;
    Ok(found.replicates[0].values.to_vec())
}

/// Times are those of the waveform, from 10 us on every 10 us; `step` and `first` take their place.
#[test]
fn a_waveform_states_the_times_of_its_samples() {
    let times: Vec<f64> = (1..=100).map(|i| 1e-5 * f64::from(i)).collect();
    let (all, late) = (layout(times.clone()), layout(times[50..].to_vec()));
    let dataset = "dataset = \"strain/{sensor}\"";
    let values = measured(dataset, &all).unwrap();
    let text = std::fs::read_to_string(sample("base.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    for (s, sensor) in ["B", "C"].iter().enumerate() {
        let j = rows[0].iter().position(|heading| heading == sensor).unwrap();
        for i in 0..100 {
            let right = 1e-6 * rows[i + 1][j].parse::<f64>().unwrap();
            assert!((values[100 * s + i].unwrap() - right).abs() <= 1e-15 + 1e-12 * right.abs());
        }
    }
    let resampled = measured(&format!("{dataset}\nresample = \"linear\""), &late).unwrap();
    for (i, y) in resampled.iter().enumerate() {
        let right = values[i / 50 * 100 + 50 + i % 50].unwrap();
        assert!((y.unwrap() - right).abs() < 1e-9);
    }
    let shifted =
        format!("{dataset}\nstep = 10\nfirst = 510\ntime_unit = \"us\"\nresample = \"linear\"");
    let shifted = measured(&shifted, &late).unwrap();
    assert!((shifted[0].unwrap() - values[0].unwrap()).abs() < 1e-12);
    let inspected = Tdms::default().inspect(&sample("records.tdms")).unwrap();
    let fact = ("times of strain/B".to_owned(), "from 0.00001 s, every 0.00001 s".to_owned());
    assert_eq!(inspected.facts[0], fact);
    assert_eq!(inspected.variables[1].name, "strain/C");
    assert_eq!(inspected.variables[1].unit, Some(Unit::parse("microstrain").unwrap()));
}

#[test]
fn errors_name_file_channel_and_what_is_missing() {
    let layout = layout(vec![1e-5, 2e-5]);
    let error = measured("dataset = \"strain/{sensor}\"", &layout).unwrap_err();
    assert!(error.contains("channel") || error.contains("dataset `strain/B`"), "{error}");
    let error = measured("dataset = \"stress/{sensor}\"", &layout).unwrap_err();
    assert!(error.contains("has no dataset `stress/B`; it has `strain/B`, `strain/C`"), "{error}");
    let error = measured("dataset = \"strain/{sensor}\"\nunit = \"m\"", &layout).unwrap_err();
    assert!(error.contains("is in `m`, which does not convert to `1`"), "{error}");
    // A channel without a waveform.
    let reader: Tdms =
        toml::from_str("path = \"types.tdms\"\ndataset = \"types/int8\"\nresample = \"linear\"")
            .unwrap();
    let mut one = layout.clone();
    one.axes.remove(0);
    let directory = sample("");
    let source = MeasurementSource { directory: &directory, scenario: None, layout: &one };
    let error = reader.measurements(&source).unwrap_err().to_string();
    assert!(error.contains("has no times in the file, and the options state neither"), "{error}");
}

#[test]
fn an_index_file_is_told_from_its_file() {
    let mut bytes = std::fs::read(sample("records.tdms")).unwrap();
    assert!(Tdms::default().recognises(Path::new("x"), &bytes));
    bytes[..4].copy_from_slice(b"TDSh");
    let (_folder, path) = super::written(&bytes);
    assert!(Tdms::default().recognises(Path::new("x"), &bytes));
    let error = Tdms::default().inspect(&path).unwrap_err().to_string();
    assert!(error.contains("is the index of a TDMS file"), "{error}");
}
