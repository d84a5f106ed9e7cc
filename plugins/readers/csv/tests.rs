//! The layouts that the documentation promises, and every error message.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use lacuna::data::{Axis, Layout, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Reader;
use lacuna::plugin::reader::{EnsembleSource, GridSource, MeasurementSource};

use super::Csv;
use lacuna::text::values::AllowFailed;

fn layout() -> Layout {
    Layout {
        name: "strain".into(),
        unit: Unit::parse("1").unwrap(),
        axes: vec![
            Axis::labels("sensor", ["B", "C"]),
            Axis::grid("time", vec![1e-5, 2e-5], Unit::parse("s").unwrap()),
        ],
    }
}

fn parameters() -> Vec<Parameter> {
    let uniform = || Distribution::Uniform([0.0, 1.0]);
    vec![Parameter {
        name: "density".into(),
        symbol: "rho".into(),
        unit: Unit::parse("kg/m3").unwrap(),
        design: uniform(),
        prior: uniform(),
        reference: None,
    }]
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        Self(folder)
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn ensemble(&self, csv: &Csv) -> Result<lacuna::data::Ensemble, String> {
        let (parameters, layout) = (parameters(), layout());
        let source = EnsembleSource {
            directory: self.path(),
            simulated: None,
            parameters: &parameters,
            scenario: None,
            layout: &layout,
        };
        csv.ensemble(&source).map_err(|e| e.to_string())
    }
}

fn measured(text: &str, csv: Csv) -> Result<lacuna::data::Measurements, String> {
    let folder = Folder::new(&[("strain.csv", text)]);
    let csv = Csv { path: Some("strain.csv".into()), ..csv };
    let source = MeasurementSource { directory: folder.path(), scenario: None, layout: &layout() };
    csv.measurements(&source).map_err(|e| e.to_string())
}

fn tables() -> Csv {
    Csv {
        parameters: Some("runs.csv".into()),
        responses: Some("responses.csv".into()),
        ..Csv::default()
    }
}

const RUNS: &str = "run,density [g/cm3]\na,13.5\nb,12.1\n";

#[test]
fn long_and_wide_tables_give_the_same_ensemble() {
    let long = "run,sensor,time [ms],strain [microstrain]\n\
                b,C,0.02,8\nb,C,0.01,7\nb,B,0.02,6\nb,B,0.01,5\n\
                a,B,0.01,1\na,B,0.02,2\na,C,0.01,3\na,C,0.02,4\n";
    let wide = "run;B 1e-5 [microstrain];C:0.00001 [microstrain];B 2e-5 [microstrain];C 2e-5 [1]\n\
                a;1;3;2;4e-6\nb;5;7;6;8e-6\n";
    let read =
        |text| Folder::new(&[("runs.csv", RUNS), ("responses.csv", text)]).ensemble(&tables());
    let ensemble = read(long).unwrap();
    assert_eq!(ensemble.runs, ["a", "b"]);
    for (i, x) in ensemble.responses.as_slice().iter().enumerate() {
        assert!((x - (i as f64 + 1.0) * 1e-6).abs() < 1e-20);
    }
    assert!((ensemble.points.row(1)[0] - 12_100.0).abs() < 1e-9);
    assert_eq!(read(wide).unwrap(), ensemble);
}

#[test]
fn incomplete_runs_are_named_and_left_out_only_if_allowed() {
    let responses = "run,sensor,time,strain\na,B,1e-5,1\na,B,2e-5,2\na,C,1e-5,3\na,C,2e-5,4\n\
                     b,B,1e-5,1\nb,B,2e-5,nan\nb,C,1e-5,inf\n";
    let folder = Folder::new(&[("runs.csv", RUNS), ("responses.csv", responses)]);
    let text = folder.ensemble(&tables()).unwrap_err();
    assert!(text.contains("1 of 2 runs cannot be used, and 0 may be left out"), "{text}");
    assert!(
        text.contains("`b`") && text.contains("2 of 4 values are missing, first at sensor `B`")
    );
    for allow_failed in [1.0, 0.5].map(|n| AllowFailed::new(n).unwrap()) {
        let ensemble = folder.ensemble(&Csv { allow_failed, ..tables() }).unwrap();
        assert_eq!((ensemble.runs.len(), ensemble.failed[0].run.as_str()), (1, "b"));
    }
    assert!(
        folder.ensemble(&Csv { allow_failed: AllowFailed::new(0.4).unwrap(), ..tables() }).is_err()
    );
}

#[test]
fn each_run_may_have_a_file_of_its_own() {
    let file = "sensor,time,strain\nB,1e-5,1\nB,2e-5,2\nC,1e-5,3\nC,2e-5,4\n";
    let runs = "run,file,status,reason,valid,density\na,a.csv,done,,true,1\n\
                b,,failed,no steps,true,2\nc,a.csv,done,,false,3\n";
    let folder = Folder::new(&[("runs.csv", runs), ("a.csv", file)]);
    let csv = Csv { parameters: Some("runs.csv".into()), ..Csv::default() };
    assert!(folder.ensemble(&csv).is_err());
    let csv = Csv { allow_failed: AllowFailed::new(1.0).unwrap(), ..csv };
    let ensemble = folder.ensemble(&csv).unwrap();
    assert_eq!((ensemble.runs.len(), &ensemble.valid[..]), (2, &[true, false][..]));
    assert_eq!(ensemble.failed[0].reason, "no steps");
    assert_eq!(csv.files(folder.path(), None).len(), 3);
}

#[test]
fn measurements_keep_gaps() {
    let text = "# pulses of April\nreplicate,sensor,time [us],strain,note\n\
                p1,B,10,1,x\np1,B,20,,x\np1,C,10,NaN,x\np1,C,20,4,x\np2,C,20.0,5,x\n";
    let csv = Csv { ignore: vec!["note".into()], ..Csv::default() };
    let read = measured(text, csv).unwrap();
    assert_eq!(read.replicates.len(), 2);
    assert_eq!(read.replicates[0].values, [Some(1.0), None, None, Some(4.0)]);
    assert_eq!(read.replicates[1].values, [None, None, None, Some(5.0)]);
}

/// Rows in the order of the response, column by column, backwards, and between comments are the same measurements, and a
/// second value is told with the line of the first.
#[test]
fn the_order_of_the_rows_does_not_matter() {
    let row = |r: usize, i: usize| {
        let (sensor, time) = (["B", "C"][i / 2], 10 + 10 * (i % 2));
        format!("p{r},{sensor},{time},{}\n", 10 * r + i)
    };
    let heading = "replicate,sensor,time [us],strain\n";
    let ordered: Vec<(usize, usize)> = (0..20).map(|k| (k / 4, k % 4)).collect();
    let by_column: Vec<(usize, usize)> = (0..20).map(|k| (k % 5, k / 5)).collect();
    let backwards: Vec<(usize, usize)> = (0..20).map(|k| (k / 4, [0, 3, 2, 1][k % 4])).collect();
    let text = |rows: &[(usize, usize)], between: &str| {
        let rows: Vec<String> = rows.iter().map(|&(r, i)| row(r, i) + between).collect();
        heading.to_owned() + &rows.concat()
    };
    let expected = measured(&text(&ordered, ""), Csv::default()).unwrap();
    for (rows, between) in [(&ordered, "# same\n"), (&by_column, ""), (&backwards, "")] {
        let text = text(rows, between);
        assert_eq!(measured(&text, Csv::default()).unwrap(), expected);
        for first in [0, 7, 19] {
            let (r, i) = rows[first];
            let error = measured(&(text.clone() + &row(r, i)), Csv::default()).unwrap_err();
            let line = 2 + first * if between.is_empty() { 1 } else { 2 };
            assert!(error.ends_with(&format!("the first is in line {line}")), "{error}");
        }
    }
}

#[test]
fn rows_belong_to_the_scenario_that_they_name() {
    let folder = tempfile::tempdir().unwrap();
    let text = "scenario,replicate,sensor,time,strain\nlow,1,B,1e-5,1\nlow,1,C,2e-5,2\n\
                high,1,B,1e-5,3\nhigh,1,C,2e-5,4\n";
    std::fs::write(folder.path().join("all.csv"), text).unwrap();
    std::fs::write(folder.path().join("high.csv"), text.replace("scenario,", "s,")).unwrap();
    let layout = layout();
    let read = |path: &str, scenario: Option<&str>, ignore: &[&str]| {
        let ignore = ignore.iter().map(|s| (*s).to_owned()).collect();
        let csv = Csv { path: Some(path.into()), ignore, ..Csv::default() };
        let source = MeasurementSource { directory: folder.path(), scenario, layout: &layout };
        csv.measurements(&source).map_err(|error| error.to_string())
    };
    let high = read("all.csv", Some("high"), &[]).unwrap();
    assert_eq!(high.replicates[0].values, [Some(3.0), None, None, Some(4.0)]);
    let missing = read("all.csv", Some("none"), &[]).unwrap_err();
    assert!(missing.contains("has no row of scenario `none`; it has `high`, `low`"), "{missing}");
    let unasked = read("all.csv", None, &[]).unwrap_err();
    assert!(unasked.contains("and the study has no scenarios"), "{unasked}");
    let twice = read("{scenario}.csv", Some("high"), &["s"]).unwrap_err();
    assert!(twice.contains("a second value of replicate `1`"), "{twice}");
    let absent = read("high.csv", Some("high"), &["s"]).unwrap_err();
    assert!(absent.contains("has no column `scenario`"), "{absent}");
    let csv = Csv { path: Some("all.csv".into()), ..Csv::default() };
    let unit = lacuna::data::Unit::parse("us").unwrap();
    let grid = csv.grid(&GridSource {
        directory: folder.path(),
        scenario: Some("low"),
        axis: "time",
        unit: &unit,
    });
    assert_eq!(grid.unwrap(), [1e-5, 2e-5]);
}

#[test]
fn every_complaint_names_the_place_and_what_would_be_right() {
    let head = "replicate,sensor,time,strain\n";
    let all = "1,B,1e-5,1\n1,B,2e-5,2\n1,C,1e-5,3\n";
    let complaint = |rows: &str| measured(&format!("{head}{rows}"), Csv::default()).unwrap_err();
    for (rows, expected) in [
        (
            "1,Q,1e-5,1\n",
            "line 2, column 2 (`sensor`): unknown sensor `Q`; the response has `B`, `C`",
        ),
        (
            "1,B,1.5e-5,1\n",
            "line 2, column 3 (`time`): time 0.000015 s is not on the response's axis",
        ),
        ("1,B,soon,1\n", "line 2, column 3 (`time`): expected a number, found `soon`"),
        ("1,B,1e-5,high\n", "line 2, column 4 (`strain`): expected a number, found `high`"),
        ("1,B,1e-5,inf\n", "line 2, column 4 (`strain`): expected a finite number or a blank"),
        (
            "1,B,1e-5,1\n1,B,1e-5,2\n",
            "line 3, column 4 (`strain`): a second value of replicate `1`",
        ),
        ("1,B,1e-5\n", "line 2: expected 4 fields as in the first line, found 3"),
        ("1,B,1e-5,1\n1,B,2e-5,1\n", "has no row for sensor `C`"),
        ("1,B,1e-5,1\n1,C,1e-5,1\n", "has no row for time `0.00002`"),
    ] {
        let text = complaint(rows);
        assert!(text.contains(expected), "expected `{expected}` in `{text}`");
    }
    let complaint = |head: &str| measured(&format!("{head}{all}"), Csv::default()).unwrap_err();
    for (head, expected) in [
        ("replicate,sensor,time,stress\n", "no column `strain`; it has `replicate`, `sensor`"),
        (
            "replicate,sensor,time [kg],strain\n",
            "line 1, column 3: expected a unit that converts to `s`",
        ),
        ("replicate,sensor,time [sec],strain\n", "line 1, column 3"),
        ("replicate,sensor,sensor,strain\n", "line 1, column 3: two columns are called `sensor`"),
    ] {
        let text = complaint(head);
        assert!(text.contains(expected), "expected `{expected}` in `{text}`");
    }
    let extra = measured("replicate,power,sensor,time,strain\n1,2,B,1e-5,1\n", Csv::default());
    assert!(extra.unwrap_err().contains("column 2: column `power` has no meaning here"));
}

#[test]
fn tables_of_runs_are_checked() {
    let complaint = |runs: &str, responses: &str| {
        Folder::new(&[("runs.csv", runs), ("responses.csv", responses)])
            .ensemble(&tables())
            .unwrap_err()
    };
    let long = "run,sensor,time,strain\n";
    for (runs, responses, expected) in [
        ("run,density\na,1\na,2\n", long.to_owned(), "line 3, column 1 (`run`): a run `a` appears"),
        ("run,density\na,\n", long.to_owned(), "line 2, column 2 (`density`): expected a finite"),
        ("run,rho\na,1\n", long.to_owned(), "no column `density`"),
        (RUNS, format!("{long}z,B,1e-5,1\n"), "line 2, column 1 (`run`): run `z` is not in"),
        (RUNS, format!("{long}a,B,1e-5,1\na,B,1e-5,1\n"), "the first is in line 2"),
        (RUNS, "run,B 1e-5,B 0.00001\n".into(), "`B 0.00001` means the same value as column 2"),
        (RUNS, "run,B\n".into(), "expected a heading like `B 1e-5`, found `B`"),
        (RUNS, "run,B 1e-5\na,1\na,2\n".into(), "a second row of run `a`; the first is line 2"),
    ] {
        let text = complaint(runs, &responses);
        assert!(text.contains(expected), "expected `{expected}` in `{text}`");
    }
}

#[test]
fn inspect_tells_columns_units_and_gaps() {
    let folder = Folder::new(&[("a.csv", "time [ms],sensor,strain\n1,B,5\n2,B,\n")]);
    let path = folder.path().join("a.csv");
    assert!(Csv::default().recognises(&path, b"time [ms],sensor,strain\n1,B,5\n"));
    assert!(!Csv::default().recognises(&path, b"        Time,  strain_B\n"));
    let contents = Csv::default().inspect(&path).unwrap();
    let strain = &contents.variables[1];
    assert_eq!((strain.range, strain.not_finite), (Some((5.0, 5.0)), 1));
    assert_eq!(contents.variables[0].unit, Some(Unit::parse("ms").unwrap()));
    assert_eq!(strain.signals.columns[0].values, [1.0, 2.0]);
}
