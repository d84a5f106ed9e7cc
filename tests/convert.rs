//! `lacuna convert`: the table of the draws against `summary.json`.

use std::fs;

use lacuna::plugin::reader::MeasurementSource;

use crate::quick;

#[test]
fn the_table_of_draws_has_the_means_of_the_summary() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let ran = quick::run(&folder.path().join("study.toml"), &[], &out);
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let table = folder.path().join("draws.csv");
    let done = quick::command().arg("convert").args([&out, &table]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let text = fs::read_to_string(&table).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    // 24 walkers of 30 draws, as `arviz_reads_the_posterior` finds them.
    assert_eq!(rows.len(), 24 * 30);
    assert_eq!((&head[..2], rows[31][0], rows[31][1]), (&["chain", "draw"][..], 1.0, rows[1][1]));
    assert_eq!(head.last(), Some(&"lp"));
    for (name, parameter) in quick::summary(&out)["parameters"].as_object().unwrap() {
        let heading = format!("{name} [{}]", parameter["unit"].as_str().unwrap());
        let column = head.iter().position(|h| *h == heading).unwrap_or_else(|| panic!("{heading}"));
        let mean = rows.iter().map(|row| row[column]).sum::<f64>() / rows.len() as f64;
        let right = parameter["mean"].as_f64().unwrap();
        assert!((mean - right).abs() <= 1e-9 * right.abs(), "{name}: {mean} {right}");
    }
    let printed = quick::command().args(["convert"]).arg(&out).arg("-").output().unwrap();
    assert_eq!(String::from_utf8(printed.stdout).unwrap().trim_end(), text.trim_end());
}

#[test]
fn the_table_of_measurements_is_read_back_to_the_same_bits() {
    let folder = quick::tables();
    let study = folder.path().join("study.toml");
    let table = folder.path().join("long.csv");
    let done = quick::command().arg("convert").args([&study, &table]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let read = |settings: &[&str]| {
        let study = quick::load(&study, settings);
        let source = MeasurementSource {
            directory: &study.directory,
            scenario: None,
            layout: &study.layouts.blocks[0],
        };
        study.measurements.as_ref().unwrap().built.plugin.measurements(&source).unwrap()
    };
    let again = read(&["measurements.path=long.csv"]);
    assert!(again.count() > 0);
    assert_eq!(again, read(&[]));
}

#[test]
fn what_has_no_draws_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (run, out, code, right) in [
        (".", "draws.txt", 2, "`draws.txt` ends neither in `.csv`"),
        ("nowhere", "draws.csv", 2, "`nowhere` is neither a run directory nor a study"),
        (".", "draws.csv", 1, ". has no draws"),
    ] {
        let done = quick::command()
            .args(["convert", run, out])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let text = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(code), "{text}");
        assert!(text.contains(right), "{text}");
    }
}
