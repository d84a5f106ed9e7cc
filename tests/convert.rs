//! `lacuna convert`: the table of the draws against `summary.json`.

use std::fs;
use std::path::Path;
use std::process::Command;

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
    same_in_parquet(&out, &table);
}

/// Compares a Parquet file with a table in CSV: names, units, types, texts, and the bits of every number.
const COMPARE: &str = r#"
import csv, struct, sys
import pyarrow.parquet as pq
table = pq.read_table(sys.argv[1])
head, *rows = csv.reader(open(sys.argv[2], newline=""))
units = {k.decode(): v.decode() for k, v in table.schema.metadata.items()}
assert units.pop("lacuna") == sys.argv[3]
split = lambda h: h[:-1].split(" [", 1) if h.endswith("]") else [h]
assert table.schema.names == [split(h)[0] for h in head], table.schema.names
assert units == {"unit:" + split(h)[0]: split(h)[1] for h in head if len(split(h)) == 2}, units
assert table.num_rows == len(rows) > 0
bits = lambda x: struct.pack("<d", x)
for j, column in enumerate(table.columns):
    kind, cells = str(column.type), [row[j] for row in rows]
    if kind == "int64":
        assert column.to_pylist() == [int(c) for c in cells], head[j]
    elif kind == "double":
        for found, cell in zip(column.to_pylist(), cells):
            assert (found is None) if cell == "" else bits(found) == bits(float(cell)), (head[j], found, cell)
    else:
        assert kind == "string" and column.to_pylist() == cells, (head[j], kind)
print([str(t) for t in table.schema.types])
"#;

/// Converts to Parquet and compares with the table in CSV; returns the types of the columns, as Arrow calls them.
fn same_in_parquet(source: &Path, csv: &Path) -> Option<String> {
    let out = csv.with_extension("parquet");
    let done = quick::command().arg("convert").args([source, &out]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let python = crate::python::interpreter("pyarrow")?;
    let mut command = Command::new(python);
    command.args(["-c", COMPARE]).args([&out, csv]).arg(env!("CARGO_PKG_VERSION"));
    let done = command.output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    Some(String::from_utf8(done.stdout).unwrap())
}

#[test]
fn a_table_of_measurements_in_parquet_has_texts_and_missing_values() {
    let folder = quick::tables();
    let study = folder.path().join("study.toml");
    let measured = folder.path().join("measured.csv");
    let text = fs::read_to_string(&measured).unwrap();
    let first = text.lines().nth(1).unwrap();
    let blank = format!("{},", first.rsplit_once(',').unwrap().0);
    quick::replace(&measured, first, &blank);
    let table = folder.path().join("long.csv");
    let done = quick::command().arg("convert").args([&study, &table]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(fs::read_to_string(&table).unwrap().lines().any(|line| line.ends_with(',')));
    if let Some(types) = same_in_parquet(&study, &table) {
        assert_eq!(types.trim(), "['string', 'double', 'double']");
    }
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

#[cfg(unix)]
#[test]
fn tables_go_through_links_and_into_what_is_no_file() {
    let folder = quick::tables();
    let at = |name: &str| folder.path().join(name);
    let succeed = |command: &mut Command| {
        let done = command.output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    };
    let convert =
        |out: &str| succeed(quick::command().arg("convert").args([at("study.toml"), at(out)]));
    let inspect = |out: &str| {
        let sample = quick::root().join("tests/samples/base.csv");
        let mut command = quick::command();
        command.arg("inspect").arg(sample).args(["--variable", "B", "--csv"]).arg(at(out));
        succeed(&mut command);
    };
    convert("long.csv");
    inspect("signal.csv");
    fs::write(at("target.csv"), "old").unwrap();
    std::os::unix::fs::symlink("target.csv", at("link.csv")).unwrap();
    succeed(Command::new("mkfifo").arg(at("fifo.csv")));
    for is_table in [true, false] {
        let (plain, way): (&str, &dyn Fn(&str)) =
            if is_table { ("long.csv", &convert) } else { ("signal.csv", &inspect) };
        let right = fs::read(at(plain)).unwrap();
        way("link.csv");
        assert_eq!(fs::read(at("target.csv")).unwrap(), right);
        assert!(fs::symlink_metadata(at("link.csv")).unwrap().is_symlink());
        let fifo = at("fifo.csv");
        let reading = std::thread::spawn(move || fs::read(fifo).unwrap());
        way("fifo.csv");
        assert_eq!(reading.join().unwrap(), right);
        assert!(!fs::metadata(at("fifo.csv")).unwrap().is_file());
    }
}

#[test]
fn what_has_no_draws_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (run, out, code, right) in [
        (".", "draws.txt", 2, "`draws.txt` ends in none of `.csv` and `.parquet`"),
        (".", "draws.parquet", 1, ". has no draws"),
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
