//! The plugin: runs, gauges, failed runs, `inspect`.

use std::path::Path;

use lacuna::data::{Axis, Ensemble, Layout, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Reader;
use lacuna::plugin::reader::EnsembleSource;
use lacuna::plugin::registry::{self, NoKeys};
use lacuna::text::read::read;
use lacuna::text::{Problems, Sources};

use super::super::Sierra;
use super::super::probe::Probe;
use super::super::signal::Signal;
use super::super::write::{History, Origin, write_history};
use super::{base, largest_difference, reference, sample};
use lacuna::text::values::AllowFailed;

const GAUGES: [&str; 10] = ["B", "C", "G", "M", "R", "T", "U", "V", "Y", "Z"];

fn layout(times: Vec<f64>, unit: &str) -> Layout {
    Layout {
        name: "strain".into(),
        unit: Unit::parse(unit).unwrap(),
        axes: vec![
            Axis::labels("sensor", GAUGES),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ],
    }
}

fn reader() -> Sierra {
    Sierra {
        runs: Some("runs.csv".into()),
        variable: Some("strain_{sensor}".into()),
        unit: Some(Unit::parse("1").unwrap()),
        ..Sierra::default()
    }
}

fn parameters() -> [Parameter; 1] {
    [Parameter {
        name: "density".into(),
        symbol: "rho".into(),
        unit: Unit::parse("kg/m3").unwrap(),
        design: Distribution::Uniform([0.0, 1.0]),
        prior: Distribution::Uniform([0.0, 1.0]),
        reference: None,
    }]
}

fn ensemble(folder: &Path, reader: &Sierra, layout: &Layout) -> Result<Ensemble, String> {
    let parameters = parameters();
    let source = EnsembleSource {
        directory: folder,
        simulated: None,
        parameters: &parameters,
        scenario: None,
        layout,
    };
    reader.ensemble(&source).map_err(|e| e.to_string())
}

#[test]
fn every_kind_of_file_gives_the_study_s_response() {
    let (_, times, values) = base();
    let expected: Vec<f64> = values.concat().iter().map(|y| y * 1e6).collect();
    let layout = layout(times, "microstrain");
    for file in ["hist_cdf2.h", "hist_cdf5.h", "hist_nc4.h", "hb_default.txt", "hb_spyhis.txt"] {
        let response = reader().response(&sample(file), &layout).unwrap();
        // Heartbeat text has six digits of values up to 250 microstrain.
        assert!(largest_difference(&response, &expected) < 2e-3, "{file}");
    }
    // Between the steps the signal is linear.
    let (_, times, values) = base();
    let half = layout_at(&times, 0.5);
    let response = reader().response(&sample("hist_cdf2.h"), &half).unwrap();
    let mean = 0.5e6 * (values[0][0] + values[0][1]);
    assert!((response[0] - mean).abs() < 1e-9);
}

fn layout_at(times: &[f64], fraction: f64) -> Layout {
    let between = times.windows(2).map(|w| w[0] + fraction * (w[1] - w[0])).collect();
    layout(between, "microstrain")
}

#[test]
fn a_gauge_may_have_its_own_probe() {
    let (_, times, values) = base();
    let layout = layout(times, "1");
    let mut reader = reader();
    let tensor = Probe { direction: Some([0.0, 1.0, 0.0]), ..Probe::named("log_strain_B") };
    reader.sensors.insert("B".into(), tensor);
    let response = reader.response(&sample("hist_nc4.h"), &layout).unwrap();
    assert!((response[5] - 0.2 * values[0][5]).abs() < 1e-15);
    assert!((response[100] - values[1][0]).abs() < 1e-15);
    reader.variable = None;
    let text = reader.response(&sample("hist_nc4.h"), &layout).unwrap_err().message;
    assert!(text.contains("neither `variable` nor `sensors` states where `C` is read"), "{text}");
}

#[test]
fn unfinished_and_damaged_runs_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (_, times, _) = base();
    let layout = layout(times, "1");
    let whole = std::fs::read(sample("hist_cdf2.h")).unwrap();
    let text = std::fs::read_to_string(sample("hb_default.txt")).unwrap();
    let half: Vec<&str> = text.lines().take(50).collect();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("good.h", &whole);
    write("cut.h", &whole[..whole.len() / 2]);
    write("half.h", (half.join("\n") + "\n").as_bytes());
    write("nan.h", text.replace("strain_T=1.33600e-06", "strain_T=-nan").as_bytes());
    write("runs.csv", b"run,density\ngood,1\ncut,2\nhalf,3\nnan,4\ngone,5\n");
    let reader = Sierra { file: Some("{run}.h".into()), ..reader() };
    let complaint = ensemble(folder.path(), &reader, &layout).unwrap_err();
    for expected in [
        "4 of 5 runs cannot be used, and 0 may be left out",
        "`cut`: ",
        "declares 100 records",
        "do not cover the response's 1e-5 to 1e-3: an unfinished run?",
        "`nan`: ",
        "sensor `T`, variable `strain_T`: the value at time 1e-5 is NaN",
        "gone.h: cannot be opened",
    ] {
        assert!(complaint.contains(expected), "expected `{expected}` in `{complaint}`");
    }
    let allowed = Sierra { allow_failed: AllowFailed::new(0.8).unwrap(), ..reader.clone() };
    let ensemble = ensemble(folder.path(), &allowed, &layout).unwrap();
    assert_eq!((&ensemble.runs[..], ensemble.failed.len()), (&["good".to_owned()][..], 4));
    assert_eq!(reader.files(folder.path(), None).len(), 6);
}

#[test]
fn what_the_simulate_stage_wrote_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (_, times, values) = base();
    let names = GAUGES.map(|gauge| format!("strain_{gauge}")).to_vec();
    let history = History { times: times.clone(), names, values: values.clone() };
    write_history(&folder.path().join("run-1.h"), &Origin::default(), &history).unwrap();
    let table = "run,file,status,valid,reason,density\nrun-1,run-1.h,done,false,,13500\n\
                 run-2,,failed,,no steps,12000\n";
    std::fs::write(folder.path().join("runs.csv"), table).unwrap();
    let allow_failed = AllowFailed::new(1.0).unwrap();
    let reader = Sierra { runs: None, allow_failed, ..reader() };
    let layout = layout(times, "1");
    let source = EnsembleSource {
        directory: Path::new("elsewhere"),
        simulated: Some(folder.path()),
        parameters: &parameters(),
        scenario: None,
        layout: &layout,
    };
    let ensemble = reader.ensemble(&source).unwrap();
    assert_eq!((ensemble.responses.row(0), ensemble.valid[0]), (&values.concat()[..], false));
    assert_eq!((ensemble.points.row(0), ensemble.failed.len()), (&[13_500.0][..], 1));
    assert!(!reader.names_files());
}

#[test]
fn times_printed_with_few_digits_still_cover_the_axis() {
    let signal = Signal { times: vec![1.0001, 2.0, 2.9999], values: vec![1.0, 2.0, 3.0] };
    assert_eq!(signal.resampled(&[1.0, 2.0, 3.0], 0.01).unwrap(), [1.0, 2.0, 3.0]);
    let text = signal.resampled(&[1.0, 2.0, 3.0], 1e-6).unwrap_err();
    assert!(text.starts_with("times go from 1.0001e0 to 2.9999e0 and do not cover"), "{text}");
    // A value that is not finite affects only what is read from it.
    let signal = Signal { times: vec![1.0, 2.0, 3.0], values: vec![1.0, 2.0, f64::NAN] };
    assert_eq!(signal.resampled(&[1.5, 2.0], 0.0).unwrap(), [1.5, 2.0]);
    assert!(signal.resampled(&[2.5], 0.0).is_err());
}

#[test]
fn inspect_shows_variables_and_their_signals() {
    let (_, times, values) = base();
    for (file, format) in [
        ("hist_nc4.h", "Exodus II history, netCDF-4"),
        ("hist_cdf5.h", "Exodus II history, netCDF 64-bit data (CDF-5)"),
        ("hb_spyhis.txt", "Sierra heartbeat: SPYHIS, `,` separator"),
    ] {
        let path = sample(file);
        let head = std::fs::read(&path).unwrap();
        assert!(reader().recognises(&path, &head[..4096]), "{file}");
        let contents = reader().inspect(&path).unwrap();
        assert_eq!(contents.format, format);
        let strain = contents.variables.iter().find(|v| v.name == "strain_T").unwrap();
        assert_eq!(strain.axes, [("time".to_owned(), 100)]);
        let columns = &strain.signals.columns;
        assert!(largest_difference(&columns[0].values, &times) < 1e-12);
        assert!(largest_difference(&columns[1].values, &values[5]) < 2e-9);
        let highest = values[5].iter().copied().fold(f64::MIN, f64::max);
        assert!((strain.range.unwrap().1 - highest).abs() < 2e-9);
    }
    let Some(path) = reference("real/seacas_block_crush_1.ex2") else { return };
    let contents = reader().inspect(&path).unwrap();
    // 41 globals, 16 nodal, and 8 + 8 + 1 on the three blocks.
    assert_eq!(contents.variables.len(), 41 + 16 + 17);
    let stress = contents.variables.iter().find(|v| v.on == "element block `block_2`").unwrap();
    let column = stress.signals.column("stress_xx element 81").unwrap();
    assert_eq!(column.values[1], -30_413.428_418_187_406);
}

#[test]
fn options_decode_from_a_study() {
    let text = r#"
        use = "sierra"
        runs = "runs.csv"
        file = "run_{run}/strain.h"
        variable = "strain_{sensor}"
        unit = "microstrain"
        allow_failed = 3
        [sensors.B]
        variable = "log_strain"
        kind = "element"
        block = "nose"
        nearest = [0.055, 0, 0.0]
        direction = [1.0, 1.0, 0.0]
        [sensors.C]
        variable = "surface_strain"
        kind = "side_set"
        block = 12
        id = 117
        side = 3
    "#;
    let decode = |text: &str| {
        let (mut sources, mut problems) = (Sources::default(), Problems::default());
        let source = sources.add_argument("test", text.to_owned());
        let node = read(source, &sources, &mut problems).unwrap();
        let section = registry::section::<dyn Reader, NoKeys>(&node, None, &mut problems);
        section.map(|section| section.built.options).ok_or_else(|| format!("{problems:?}"))
    };
    let options = decode(text).unwrap();
    assert_eq!(options["sensors"]["B"]["block"], "nose".into());
    assert_eq!(options["sensors"]["C"]["block"], 12.into());
    assert_eq!((&options["tolerance"], &options["allow_failed"]), (&0.01.into(), &3.0.into()));
    for (wrong, expected) in [
        ("allow_failed = 1.5", "a fraction from 0 to 1 or a whole number of runs"),
        ("tolerance = 2", "a fraction between 0 and 1"),
        ("unit = 'furlongs'", "a unit such as"),
        ("sensors.B.at = 3", "at"),
        ("sensors.B = {}", "variable"),
    ] {
        let text = decode(&format!("use = 'sierra'\n{wrong}")).unwrap_err();
        assert!(text.contains(expected), "expected `{expected}` in `{text}`");
    }
}

/// Options without `variable` and `sensors`: columns and global variables are found by their names.
#[test]
fn columns_named_like_the_sensors_need_no_options() {
    let layout = layout(base().1, "1");
    let own = Sierra::default();
    for name in ["hb_default.txt", "hb_csv_labels.csv", "hb_spyhis.txt", "hist_cdf2.h"] {
        let right = reader().response(&sample(name), &layout).unwrap();
        assert_eq!(own.response(&sample(name), &layout).unwrap(), right, "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.txt");
    let mut two = layout.clone();
    two.axes = vec![
        Axis::labels("sensor", ["B", "12"]),
        Axis::grid("time", vec![1.0, 2.0], Unit::dimensionless()),
    ];
    let read = |legend: &str| {
        std::fs::write(&path, format!("{legend}\n 1.0, 2.0, 3.0, 4.0\n 2.0, 5.0, 6.0, 7.0\n"))
            .unwrap();
        own.response(&path, &two).map_err(|e| e.to_string())
    };
    for (legend, right) in [
        ("    Time, b, timestep, 12", [2.0, 5.0, 4.0, 7.0]),
        ("    TIME, 12_STRAIN, B_STRAIN, timestep", [3.0, 6.0, 2.0, 5.0]),
        ("    time, B, strain_B, strain_12", [3.0, 6.0, 4.0, 7.0]),
    ] {
        assert_eq!(read(legend).unwrap(), right, "{legend}");
    }
    let error = read("    Time, B, C, D").unwrap_err();
    let right =
        "run.txt: has no column `strain_12`, `12_strain`, `12`; it has `Time`, `B`, `C`, `D`";
    assert!(error.contains(right) && error.contains("variable = "), "{error}");
    two.axes[0] = Axis::labels("sensor", ["12"]);
    let error = own.response(&sample("hist_cdf2.h"), &two).unwrap_err().to_string();
    assert!(error.contains("has no global variable `strain_12`"), "{error}");
}
