//! Written history files, read back here and by the C library through Python's netCDF4.

use std::process::Command;

use super::super::exodus::{Exodus, Kind};
use super::super::parts::Results;
use super::super::probe::Probe;
use super::super::write::{History, Origin, write_history};
use super::base;

fn history() -> (Origin, History) {
    let (names, times, values) = base();
    let qa = ["lacuna", "0.1", "2022/04/15", "12:00:00"].map(str::to_owned);
    let info = vec!["short".to_owned(), "x".repeat(200)];
    // Deliberately not in alphabetical order, which the file must have.
    let names = names.into_iter().rev().map(|n| format!("strain_{n}")).collect();
    let values = values.into_iter().rev().collect();
    (Origin { title: "ten gauges".into(), qa, info }, History { times, names, values })
}

#[test]
fn a_written_history_reads_back_exactly_and_always_has_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h");
    let (origin, history) = history();
    write_history(&path, &origin, &history).unwrap();
    let first = std::fs::read(&path).unwrap();
    write_history(&path, &origin, &history).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), first);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);

    let file = Exodus::open(&path).unwrap();
    assert_eq!(file.container.format(), "netCDF 64-bit offset (CDF-2)");
    assert!(file.names(Kind::Global).is_sorted());
    let lines = file.container.texts("info_records").unwrap();
    assert_eq!(lines.len(), 4);
    let joined: String = lines[1..].iter().map(|line| line.trim_end_matches('\\')).collect();
    assert_eq!(joined, "x".repeat(200));
    assert_eq!(file.coordinates().unwrap(), [[1.1, 2.2, 3.3]]);
    let results = Results::single(file);
    for (name, values) in history.names.iter().zip(&history.values) {
        let (times, read) = results.series(name, &Probe::named(name)).unwrap();
        assert_eq!((&times, &read), (&history.times, values));
    }
}

#[test]
fn impossible_histories_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h");
    let write = |names: &[&str], values: Vec<Vec<f64>>| {
        let names = names.iter().map(ToString::to_string).collect();
        let history = History { times: vec![0.0, 1.0], names, values };
        write_history(&path, &Origin::default(), &history).unwrap_err().message
    };
    assert!(write(&["a", "a"], vec![vec![0.0; 2]; 2]).contains("two signals are called `a`"));
    assert!(write(&["a"], vec![vec![0.0; 3]]).contains("3 values for 2 times"));
    assert!(write(&[], vec![]).contains("at least one signal"));
    let long = "n".repeat(300);
    assert!(write(&[&long], vec![vec![0.0; 2]]).contains("1 to 256"));
}

/// Reads names, times and values through the C library, and checks what the Exodus tools need.
const CHECK: &str = r#"
import sys, netCDF4
d = netCDF4.Dataset(sys.argv[1]); d.set_auto_mask(False)
assert d.data_model == "NETCDF3_64BIT_OFFSET" and d.dimensions["time_step"].isunlimited()
assert d.floating_point_word_size == 8 and d.file_size == 1 and abs(d.api_version - 9.06) < 1e-6
assert d["connect1"].elem_type == "sphere" and d["eb_prop1"].getncattr("name") == "ID"
d.set_auto_chartostring(False)
text = lambda v: [b"".join(r).split(b"\0")[0].decode() for r in d[v][:].reshape(-1, d[v].shape[-1])]
print("\t".join(text("name_glo_var"))); print("\t".join(text("qa_records")))
for t, row in zip(d["time_whole"][:], d["vals_glo_var"][:]):
    print("\t".join(repr(float(x)) for x in [t, *row]))
"#;

#[test]
fn the_c_library_reads_a_written_history() {
    let Ok(python) = std::env::var("LACUNA_PYTHON") else {
        println!("skipped: LACUNA_PYTHON names no interpreter that has netCDF4");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h");
    let (origin, history) = history();
    write_history(&path, &origin, &history).unwrap();
    let output = Command::new(python).args(["-c", CHECK]).arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split('\t').collect();
    assert_eq!(lines.next().unwrap(), "lacuna\t0.1\t2022/04/15\t12:00:00");
    for (step, line) in lines.enumerate() {
        let numbers: Vec<f64> = line.split('\t').map(|x| x.parse().unwrap()).collect();
        assert_eq!(numbers[0], history.times[step]);
        for (name, value) in names.iter().zip(&numbers[1..]) {
            let signal = history.names.iter().position(|n| n == name).unwrap();
            assert_eq!(history.values[signal][step], *value);
        }
    }
}
