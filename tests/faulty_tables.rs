//! Faulty tables: `check` reports each fault with file and line, and `run` stops with the same message.
//!
//! Each case changes one file of the study that `lacuna new study` writes, as users do.

use std::fs;
use std::path::Path;

use lacuna_engine::stage::contents;

use crate::quick::{self, replace};

/// The report of `check` on the files of a study, without its folder; the run must stop with the same text.
fn said(folder: &Path, settings: &[&str]) -> String {
    let file = folder.join("study.toml");
    let study = quick::load(&file, settings);
    let wrong = contents::check(&study).err().unwrap_or_default();
    let text: Vec<String> = wrong.iter().map(ToString::to_string).collect();
    let text = text.join("\n");
    let mut quickly = vec!["sampler.steps=4"];
    quickly.extend(settings);
    let ran = quick::run(&file, &quickly, &folder.join("run"));
    let stopped = ran.err().map_or(String::new(), |stop| stop.to_string());
    assert_eq!(stopped, text, "what the run says, and what was said before");
    text.replace(&format!("{}/", folder.display()), "")
}

/// Edits one line of a file, counted from one.
fn edit(path: &Path, line: usize, change: impl Fn(&str) -> String) {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().enumerate();
    let new: Vec<String> =
        lines.map(|(i, old)| if i + 1 == line { change(old) } else { old.to_owned() }).collect();
    fs::write(path, new.join("\n") + "\n").unwrap();
}

/// Replaces a field of a line.
fn field(number: usize, new: &str) -> impl Fn(&str) -> String + '_ {
    move |line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[number] = new;
        cells.join(",")
    }
}

#[test]
fn faults_of_measurements_are_told_with_file_and_line() {
    let also = |n: usize, new: &'static str| Box::new(field(n, new)) as Box<dyn Fn(&str) -> String>;
    let whole = |text: &'static str| {
        Box::new(move |_: &str| text.to_owned()) as Box<dyn Fn(&str) -> String>
    };
    let place = |line: usize, column: usize, name: &str| {
        format!("measured.csv, line {line}, column {column} (`{name}`): ")
    };
    let point =
        "\nhelp: write decimals after a point, not a comma, and put a text with a comma in quotes";
    for (line, change, expected) in [
        (1, whole("replicate,time [s],displ [mm]"),
            "measured.csv: has no column `displacement`; it has `replicate`, `time`, `displ`".to_owned()),
        (1, whole("replicate,time [s],displacement [s]"),
            "measured.csv, line 1, column 3: expected a unit that converts to `mm`, found `displacement` in `s`".to_owned()),
        (1, whole("replicate,when [s],displ [mm]"),
            "measured.csv: has no column `time`; it has `replicate`, `when`, `displ`\n\
             measured.csv: has no column `displacement`; it has `replicate`, `when`, `displ`".to_owned()),
        (1, whole("replicate,time [s],time [s]"),
            "measured.csv, line 1, column 3: two columns are called `time`\n\
             measured.csv: has no column `displacement`; it has `replicate`, `time`, `time`".to_owned()),
        (4, also(1, "0.16"), place(4, 2, "time") +
            "time 0.16 s is not on the response's axis of 20 values from 0.05 to 1 s"),
        (4, also(1, "150 ms"), place(4, 2, "time") + "expected a number, found `150 ms`"),
        (4, also(1, "0.1"), place(4, 3, "displacement") +
            "a second value of replicate `1` for time 0.1 s; the first is in line 3"),
        (4, also(2, "lost"), place(4, 3, "displacement") + "expected a number, found `lost`"),
        (4, also(2, "inf"), place(4, 3, "displacement") +
            "expected a finite number or a blank, found `inf`"),
        (4, also(2, "-0,16660"),
            format!("measured.csv, line 4: expected 3 fields as in the first line, found 4{point}")),
        (4, whole("1,0.15"),
            "measured.csv, line 4: expected 3 fields as in the first line, found 2".to_owned()),
        (4, also(0, ""), place(4, 1, "replicate") +
            "expected the name of a replicate, found a blank"),
    ] {
        let folder = quick::tables();
        edit(&folder.path().join("measured.csv"), line, change);
        assert_eq!(said(folder.path(), &[]), expected);
    }
}

#[test]
fn faults_of_whole_files_are_told() {
    let text = fs::read_to_string(quick::root().join("cli/src/new/measured.csv")).unwrap();
    let whole = text.trim_end();
    let cut = |bytes: usize| whole[..whole.len() - bytes].to_owned();
    let last = whole.lines().count();
    let seems = format!(
        "measured.csv, line {last}, column 3 (`displacement`): the file seems to be cut off: its last line has no line end, and"
    );
    let help = "\nhelp: write the file again; if it is whole, end its last line with a line break";
    let value = whole.rsplit(',').next().unwrap().to_owned();
    let shorter = |bytes: usize| &value[..value.len() - bytes];
    for (text, expected) in [
        (String::new(), "measured.csv: is empty: expected a line of column names".to_owned()),
        ("\n\n".to_owned(), "measured.csv: is empty: expected a line of column names".to_owned()),
        (cut(1), format!("{seems} its last field `{}` has 4 decimals, and each above it has at least 5{help}", shorter(1))),
        (cut(5), format!("{seems} its last field `{}` has 0 decimals, and each above it has at least 5{help}", shorter(5))),
        (cut(value.len()), format!("{seems} its last field is blank, and no other of its column is{help}")),
        (
            text.lines().filter(|line| !line.contains(",0.55,")).fold(String::new(), |all, line| all + line + "\n"),
            "measured.csv: has no row for time `0.55`\n\
             help: a value that was not measured is a row with a blank cell, or a shorter axis".to_owned(),
        ),
        (
            text.replacen("replicate,", "replicate,beam [kW],", 1).replace("\n1,", "\n1,5,").replace("\n2,", "\n2,5,")
                .replace("\n3,", "\n3,5,").replace("\n4,", "\n4,5,").replace("\n5,", "\n5,5,").replace("\n6,", "\n6,5,"),
            "measured.csv, line 1, column 2: column `beam` has no meaning here\n\
             help: list it under `ignore` if it means nothing, or make it a scenario if it is a condition".to_owned(),
        ),
    ] {
        let folder = quick::tables();
        fs::write(folder.path().join("measured.csv"), text).unwrap();
        assert_eq!(said(folder.path(), &[]), expected);
    }
    let folder = quick::tables();
    fs::write(folder.path().join("measured.csv"), b"replicate,time,displacement\n1,0.05,\xb50.1\n")
        .unwrap();
    assert_eq!(said(folder.path(), &[]), "measured.csv, line 2: is not UTF-8 text");
}

#[test]
fn faults_of_runs_and_responses_are_told() {
    let help =
        "\nhelp: `allow_failed` says how many runs may be left out, as a count or a fraction";
    let change = |file: &str, line: usize, change: &dyn Fn(&str) -> String| {
        let folder = quick::tables();
        edit(&folder.path().join(file), line, change);
        said(folder.path(), &[])
    };
    assert_eq!(
        change("runs.csv", 3, &field(0, "r01")),
        "runs.csv, line 3, column 1 (`run`): a run `r01` appears twice"
    );
    assert_eq!(
        change("runs.csv", 3, &field(1, "two")),
        "runs.csv, line 3, column 2 (`frequency`): expected a number, found `two`"
    );
    assert_eq!(
        change("runs.csv", 3, &field(1, "")),
        "runs.csv, line 3, column 2 (`frequency`): expected a finite number, found ``"
    );
    assert_eq!(
        change("runs.csv", 1, &|_| "run,freq [Hz],damping [kg]".to_owned()),
        "runs.csv: has no column `frequency`; it has `run`, `freq`, `damping`\n\
         runs.csv, line 1, column 3: expected a unit that converts to `1/s`, found `damping` in `kg`"
    );
    assert_eq!(
        change("responses.csv", 3, &field(0, "r99")),
        "responses.csv, line 3, column 1 (`run`): run `r99` is not in the table of parameters"
    );
    assert_eq!(
        change("responses.csv", 3, &field(1, "0.05")),
        "responses.csv, line 3, column 3 (`displacement`): a second value of run `r01` for time 0.05 s; the first is in \
         line 2"
    );
    assert_eq!(
        change("responses.csv", 3, &field(2, "")),
        format!(
            "runs.csv: 1 of 80 runs cannot be used, and 0 may be left out:\n  \
             `r01`: DIR/responses.csv: 1 of 20 values are missing, first at time 0.1 s{help}"
        )
        .replace("DIR/", "")
    );
    let folder = quick::tables();
    let path = folder.path().join("responses.csv");
    let text = fs::read_to_string(&path).unwrap();
    let without: String = text
        .lines()
        .filter(|line| !line.starts_with("r07,"))
        .map(|line| format!("{line}\n"))
        .collect();
    fs::write(&path, without).unwrap();
    assert_eq!(
        said(folder.path(), &[]),
        format!(
            "runs.csv: 1 of 80 runs cannot be used, and 0 may be left out:\n  `r07`: responses.csv: has no row for this run{help}"
        )
    );
}

#[test]
fn a_misnamed_sensor_is_told_before_any_run_is_made() {
    let folder = quick::simulated();
    let data = folder.path().join("strain.csv");
    let text = fs::read_to_string(&data).unwrap();
    fs::write(&data, text.replace(",U,", ",u,")).unwrap();
    let count = text.lines().filter(|line| line.contains(",U,")).count() - 1;
    let line = text.lines().position(|line| line.contains(",U,")).unwrap() + 1;
    let expected = format!(
        "strain.csv, line {line}, column 2 (`sensor`): unknown sensor `u`; the response has `B`, `C`, `U` \
         (and in {count} more lines)"
    );
    assert_eq!(said(folder.path(), &[]), expected);
    assert!(!folder.path().join("run/2-simulate").exists());
}

#[test]
fn all_faults_are_told_at_once() {
    let folder = quick::tables();
    let data = folder.path().join("measured.csv");
    edit(&data, 3, field(2, "lost"));
    edit(&data, 5, field(1, "0.21"));
    edit(&data, 7, |line| format!("{line},"));
    edit(&folder.path().join("runs.csv"), 9, field(2, "x"));
    let study = quick::load(&folder.path().join("study.toml"), &[]);
    let wrong: Vec<String> =
        contents::check(&study).unwrap_err().iter().map(ToString::to_string).collect();
    let places: Vec<&str> = wrong
        .iter()
        .map(|text| text.split(':').next().unwrap().rsplit('/').next().unwrap())
        .collect();
    let expected = [
        "measured.csv, line 3, column 3 (`displacement`)",
        "measured.csv, line 5, column 2 (`time`)",
        "measured.csv, line 7",
        "runs.csv, line 9, column 3 (`damping`)",
    ];
    assert_eq!(places, expected);
}

#[test]
fn faults_of_stated_noise_are_told() {
    let with = |sigma: &str| {
        let folder = quick::tables();
        let data = folder.path().join("measured.csv");
        let text = fs::read_to_string(&data).unwrap();
        let mut lines: Vec<String> = text.lines().map(|line| format!("{line},0.01")).collect();
        lines[0] = lines[0].replace(",0.01", ",sigma");
        lines[3] = lines[3].replace(",0.01", &format!(",{sigma}"));
        fs::write(&data, lines.join("\n") + "\n").unwrap();
        folder
    };
    for sigma in ["0", "-1", "", "inf"] {
        let expected = format!(
            "measured.csv, line 4, column 4 (`sigma`): expected a standard deviation above zero, found `{sigma}`\n\
             help: a value that is not to be used has a blank cell, or 1 in a column `mask`"
        );
        assert_eq!(said(with(sigma).path(), &[]), expected);
    }
    let other = [
        "discrepancy={ use = autoregressive, variance = { half_normal = 0.01 }, correlation_time = { uniform = [0.01, 1] } }",
    ];
    let text = said(with("0.02").path(), &other);
    assert!(text.starts_with("the measurements state their own noise (`sigma` or `covariance`), which the discrepancy `autoregressive` cannot use"), "{text}");
    let added = said(with("0.02").path(), &["measurements.added_curves=[mean]"]);
    assert!(added.contains("the noise of `added_curves` is not stated"), "{added}");
    let square = |entry: &dyn Fn(usize, usize) -> f64, size: usize| {
        let row = |i| (0..size).map(|j| entry(i, j).to_string()).collect::<Vec<_>>().join(",");
        (0..size).map(row).collect::<Vec<_>>().join("\n") + "\n"
    };
    for (text, expected) in [
        (
            square(&|i, j| f64::from(u8::from(i == j)), 19),
            "covariance.csv: expected 20 rows, one a value of the response, found 19",
        ),
        (
            square(
                &|i, j| match i.cmp(&j) {
                    std::cmp::Ordering::Equal => 1.0,
                    std::cmp::Ordering::Greater => 0.2,
                    std::cmp::Ordering::Less => 0.1,
                },
                20,
            ),
            "covariance.csv: the covariance of time 0.1 s with time 0.05 s is 2e-1 in row 2, and 1e-1 in row 1: the matrix must be symmetric",
        ),
        (
            square(&|_, _| 1.0, 20),
            "covariance.csv: the covariance is not positive definite: in row 2, time 0.1 s, the variance 1e0 minus \
             the part that the rows above determine is 0e0",
        ),
        ("1,x\n".to_owned(), "covariance.csv, line 1: expected a number, found `x`"),
        (String::new(), "covariance.csv: is empty: expected a square of numbers"),
    ] {
        let folder = quick::tables();
        fs::write(folder.path().join("covariance.csv"), text).unwrap();
        let found = said(folder.path(), &["measurements.covariance=covariance.csv"]);
        assert!(found.starts_with(expected), "{found}");
    }
    let folder = quick::tables();
    fs::write(folder.path().join("mask.csv"), "time,mask\n0.05,1\n0.1,2\n0.12,0\n").unwrap();
    let expected = "mask.csv, line 3, column 2 (`mask`): expected 1 for a value that is left out, or 0, found `2`\n\
        mask.csv, line 4, column 1 (`time`): time 0.12 s is not on the response's axis of 20 values from 0.05 to 1 s";
    assert_eq!(said(folder.path(), &["measurements.mask=mask.csv"]), expected);
}

/// Variants that are not faults: other line endings, a byte order mark, no final line ending, missing values, other
/// separators.
#[test]
fn sound_tables_of_any_form_are_read_alike() {
    let text = fs::read_to_string(quick::root().join("cli/src/new/measured.csv")).unwrap();
    let read = |bytes: &[u8]| {
        let folder = quick::tables();
        fs::write(folder.path().join("measured.csv"), bytes).unwrap();
        let study = quick::load(&folder.path().join("study.toml"), &[]);
        let wrong = contents::check(&study).err().unwrap_or_default();
        assert_eq!(wrong, Vec::<lacuna::run::Stop>::new());
        let section = study.measurements.as_ref().unwrap();
        let (layout, _) = study.layouts.of_scenario("").unwrap();
        let source = lacuna::plugin::reader::MeasurementSource {
            directory: folder.path(),
            scenario: None,
            layout: &layout,
        };
        section.built.plugin.measurements(&source).unwrap()
    };
    let whole = read(text.as_bytes());
    assert_eq!(read(text.replace('\n', "\r\n").as_bytes()), whole);
    assert_eq!(read(text.trim_end().as_bytes()), whole);
    assert_eq!(read(text.replace('\n', "\r\n").trim_end().as_bytes()), whole);
    assert_eq!(read(format!("\u{feff}{text}").as_bytes()), whole);
    assert_eq!(read(text.replace(',', ";").as_bytes()), whole);
    assert_eq!(read(text.replace(',', "\t").as_bytes()), whole);
    assert_eq!(read(format!("# by hand\n{text}").as_bytes()), whole);
    assert_eq!(read(text.replace("\n1,", "\n 1 , ").as_bytes()), whole);
    // A replicate with missing values: a blank, a NaN, an absent row, a mask.
    let first = "\n1,0.15,-0.16660";
    let gap = read(text.replace(first, "\n1,0.15,").as_bytes());
    assert_eq!(gap.count(), whole.count() - 1);
    assert_eq!(read(text.replace(first, "\n1,0.15,NaN").as_bytes()), gap);
    assert_eq!(read(text.replace(first, "").as_bytes()), gap);
    let masked: Vec<String> = text
        .lines()
        .map(|line| match line {
            line if line.starts_with("replicate") => format!("{line},mask"),
            line if line.starts_with("1,0.15,") => format!("{line},1"),
            line => format!("{line},0"),
        })
        .collect();
    assert_eq!(read((masked.join("\n") + "\n").as_bytes()), gap);
}

#[test]
fn a_table_without_replicates_is_one_curve() {
    let folder = quick::tables();
    let data = folder.path().join("measured.csv");
    let text = fs::read_to_string(&data).unwrap();
    let one: String = text
        .lines()
        .filter(|line| line.starts_with("replicate") || line.starts_with("1,"))
        .map(|line| line.split_once(',').unwrap().1.to_owned() + "\n")
        .collect();
    fs::write(&data, &one).unwrap();
    let out = folder.path().join("run");
    let study = folder.path().join("study.toml");
    quick::run(&study, &["sampler.steps=20"], &out).unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!(quick::summary(&out)["data"]["count"], 20);
    // Repeated measurements need a name.
    let again = one.lines().nth(2).unwrap();
    fs::write(&data, format!("{one}{again}\n")).unwrap();
    let expected = "measured.csv, line 22, column 2 (`displacement`): a second value for time 0.1 s; the first is in line 3\n\
                    help: a column `replicate` tells repeated measurements apart";
    assert_eq!(said(folder.path(), &[]), expected);
    // A misspelt column is not taken for a curve without replicates.
    replace(&data, "time [s]", "pulse,time [s]");
    assert!(said(folder.path(), &[]).contains("expected 3 fields as in the first line, found 2"));
}
