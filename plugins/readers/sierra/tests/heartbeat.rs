//! Heartbeat text: samples of the real library and of Sierra, and all further options in text in the library's
//! printed layout (`Iohb_Layout.C`).

use std::path::Path;

use super::super::heartbeat::{Heartbeat, recognised};
use super::{base, largest_difference, reference, sample};

fn parse(text: &str) -> Heartbeat {
    Heartbeat::parse(Path::new("run.txt"), text.as_bytes()).unwrap()
}

fn complaint(text: &str) -> String {
    Heartbeat::parse(Path::new("run.txt"), text.as_bytes()).unwrap_err().to_string()
}

#[test]
fn the_formats_of_the_library_agree_with_the_signals() {
    let (names, times, values) = base();
    let mut files: Vec<_> =
        ["hb_default.txt", "hb_csv_labels.csv", "hb_spyhis.txt"].map(sample).to_vec();
    let others = ["hb_csv.csv", "hb_sm_labelsoff_legendon_p8.txt"];
    files.extend(others.iter().filter_map(|name| reference(&format!("seacas_written/{name}"))));
    for path in files {
        let table = Heartbeat::read(&path).unwrap();
        assert!(table.notes.is_empty(), "{:?}", table.notes);
        for (name, expected) in names.iter().zip(&values) {
            let (t, y) = table.series(&format!("strain_{name}")).unwrap();
            assert!(largest_difference(&t, &times) < 1e-12);
            // Five digits after the first: half a unit of the last is 5e-6 of the value.
            assert!(largest_difference(&y, expected) < 5e-6 * 1e-3, "{}", path.display());
        }
    }
    let table = Heartbeat::read(&sample("hb_csv_labels.csv")).unwrap();
    assert_eq!(table.series("log_strain_B_zx").unwrap().1, [3e-9; 100]);
    assert_eq!(table.series("step").unwrap().1[99], 100.0);
}

#[test]
fn a_spyhis_file_of_sierra_is_read_whole() {
    let Some(path) = reference("real/sibl_sierra_spyhis_history.csv") else { return };
    let table = Heartbeat::read(&path).unwrap();
    assert_eq!((table.names.len(), table.columns[0].len()), (73, 201));
    // The last number of the last line.
    assert_eq!(*table.columns[72].last().unwrap(), -4.99491e-04);
    assert_eq!(table.layout, "SPYHIS, `,` separator");
}

#[test]
fn labels_name_the_components_that_follow() {
    let table = parse("time=1.0e-05, v=1, 2, 3, s=1, 2, 3, 4, 5, 6, q=8, 9, step=1\n");
    let expected = [
        "time", "v_x", "v_y", "v_z", "s_xx", "s_yy", "s_zz", "s_xy", "s_yz", "s_zx", "q_1", "q_2",
        "step",
    ];
    assert_eq!(table.names, expected);
    assert_eq!(table.series("s_zx").unwrap().1, [6.0]);
}

#[test]
fn time_stamps_of_any_format_are_removed() {
    let stamps = ["[06:08:23]", "2022-04-15 06:08:23", "{Fri Apr 15, 2022}", "15 Apr", ""];
    for stamp in stamps {
        for separator in [", ", "\t", " | ", ";", " "] {
            let join = |fields: [&str; 3]| {
                let text = fields.map(|f| format!("{f:>12}")).join(separator);
                format!("+{stamp} {text}\n")
            };
            let legend = join(["Time", "strain_B", "strain_C"]);
            let rows =
                join(["1.00000e-05", "2.0e-06", "-3.0e-06"]) + &join(["2.00000e-05", "nan", "inf"]);
            let table = parse(&(legend.clone() + &rows));
            let context = format!("stamp `{stamp}`, separator `{separator}`");
            assert_eq!(table.names, ["Time", "strain_B", "strain_C"], "{context}");
            assert_eq!(table.columns[0], [1e-5, 2e-5], "{context}");
            assert_eq!(table.columns[2], [-3e-6, f64::INFINITY], "{context}");
            assert!(table.columns[1][1].is_nan());
            let restarted = parse(&(legend.clone() + &rows + &legend + &rows));
            assert_eq!(restarted.columns[0], [1e-5, 2e-5], "{context}");
        }
    }
    let labelled = "+[06:08:23] time=1.0e-05 | strain_B=8.8e-06\n\
                    +[06:08:24] time=2.0e-05 | strain_B=9.9e-06\n";
    assert_eq!(
        parse(labelled).series("STRAIN_B").unwrap(),
        (vec![1e-5, 2e-5], vec![8.8e-6, 9.9e-6])
    );
}

#[test]
fn a_restart_repeats_the_header_and_its_steps_hold() {
    let header = "% Sierra SPYHIS Output Mon Sep 16 13:34:22 2019\n    TIME,   a\n    TIME,   a\n";
    let first = " 1.0e-05,  1.0\n 2.0e-05,  2.0\n 3.0e-05,  3.0\n";
    let second = " 2.0e-05,  2.5\n 3.0e-05,  3.5\n 4.0e-05,  4.5\n";
    let table = parse(&format!("{header}{first}{header}{second}"));
    assert_eq!(table.columns[0], [1e-5, 2e-5, 3e-5, 4e-5]);
    assert_eq!(table.columns[1], [1.0, 2.5, 3.5, 4.5]);
    assert!(table.notes.contains(&"2 repeated steps: the last values are used".to_owned()));
    // The killed run left half a row, alone in its line or followed by the restart's header.
    for cut in [" 4.0e-05,  3\n", " 4.0e-05, ", " 4.0e-0", " 4.0e-05,\n"] {
        let table = parse(&format!("{header}{first}{cut}{header}{second}"));
        assert_eq!(table.columns[1], [1.0, 2.5, 3.5, 4.5], "cut `{cut}`");
    }
    let table = parse("Time,  a\n 1.0,  1.0\n 2.0,  2.Time,  a\n 2.0,  2.5\n");
    assert_eq!(table.columns[1], [1.0, 2.5]);
    let table = parse("time=1.0, a=1.0\ntime=2.0, a=2.time=2.0, a=2.5\ntime=3.0, a=3.5\n");
    assert_eq!(table.columns[1], [1.0, 2.5, 3.5]);
}

#[test]
fn a_last_line_without_end_counts_only_if_it_is_whole() {
    let start = "Time,  a\n 1.00e-05,  1.25e+00\n";
    assert_eq!(parse(&format!("{start} 2.00e-05, -2.25e+00")).columns[0].len(), 2);
    for cut in [" 2.00e-05,  2.25e+0", " 2.00e-05,  2.2", " 2.00e-05", " 2.00e-0", " "] {
        let table = parse(&format!("{start}{cut}"));
        assert_eq!(table.columns[0], [1e-5], "cut `{cut}`");
        assert_eq!(table.notes.len(), usize::from(!cut.trim().is_empty()), "cut `{cut}`");
    }
    assert!(complaint("Time, a\n 1.0, 1.").contains("no complete row"));
}

/// The layout of `Iohb_Layout::add_legend` and `add`, which the settings of a heartbeat block choose: names and numbers right-aligned
/// in fields of one width, between separators, after the time and a stamp if these are wanted.
fn printed(settings: &Settings, names: &[&str], rows: &[[f64; 4]]) -> String {
    let Settings { separator, width, time, stamp, labels } = *settings;
    let stamp = if stamp.is_empty() { String::new() } else { format!("+{stamp} ") };
    let skipped = usize::from(!time);
    let legend: Vec<String> =
        ["Time"].iter().chain(names).skip(skipped).map(|name| format!("{name:>width$}")).collect();
    let mut text = format!("{stamp}{}\n", legend.join(separator));
    for row in rows {
        let field = |(name, x): (&&str, &f64)| {
            let number = format!("{x:.5e}");
            let (mantissa, exponent) = number.split_once('e').unwrap();
            let number = format!("{mantissa}e{:+03}", exponent.parse::<i32>().unwrap());
            if labels { format!("{name}={number}") } else { format!("{number:>width$}") }
        };
        let fields = ["TIME"].iter().chain(names).zip(row).skip(skipped);
        text.push_str(&format!(
            "{stamp}{}\n",
            fields.map(field).collect::<Vec<_>>().join(separator)
        ));
    }
    text
}

struct Settings {
    separator: &'static str,
    width: usize,
    time: bool,
    stamp: &'static str,
    labels: bool,
}

#[test]
fn a_legend_names_the_columns_under_all_settings() {
    let rows = [[1e-5, 2e-6, -3e-6, 4e-10], [2e-5, 2.5e-6, -3.5e-6, 4.5e-10]];
    for names in [
        ["strain_B", "STRAIN_C", "s(1)"],
        ["12", "2B", "-x"],
        ["_a", "nan", "%y"],
        ["p/rho", "50%", "a^2*b"],
    ] {
        for separator in [", ", "\t", " | ", ";"] {
            for (width, stamp, labels) in [
                (12, "", false),
                (0, "", false),
                (17, "[06:08:23]", false),
                (12, "", true),
                (12, "{Fri Apr 15, 2022}", true),
            ] {
                let settings = Settings { separator, width, time: true, stamp, labels };
                let text = printed(&settings, &names, &rows);
                let table = parse(&text);
                assert_eq!(table.names, [&["Time"], &names[..]].concat(), "{text}");
                assert_eq!(table.columns[3], [4e-10, 4.5e-10], "{text}");
                assert!(width == 0 || recognised(text.as_bytes()), "{text}");
            }
        }
    }
}

/// A legend without the time, as of a block with `legend = on` and no time field.
#[test]
fn a_legend_without_the_time_is_recognised() {
    let names = ["timestep", "strain_B", "c"];
    let rows = [[0.0, 2e-6, -3e-6, 4e-10], [0.0, 2.5e-6, -3.5e-6, 4.5e-10]];
    for separator in [", ", "\t", ";"] {
        let settings = Settings { separator, width: 12, time: false, stamp: "", labels: false };
        let text = printed(&settings, &names, &rows);
        assert!(recognised(text.as_bytes()), "{text}");
        let error = parse(&text).series("strain_B").unwrap_err().to_string();
        assert!(error.contains("no time column; it has `timestep`, `strain_B`, `c`"), "{error}");
    }
    for table in ["a,b\n1.0e-01,2.0e-01\n", " a, b\n 1, 2\n", "  run,  x\n r001, 2.0e+00\n"] {
        assert!(!recognised(table.as_bytes()), "{table}");
    }
}

#[test]
fn rounded_times_and_messages_do_no_harm() {
    let text = "Time,  a\n- output paused, 3 steps skipped\n 1.00000e-02,  1\n 1.00000e-02,  2\n\
                 1.00001e-02,  3\n-restarted\n 1.00002e-02,  4\n";
    let table = parse(text);
    assert_eq!(table.columns[0], [1.00000e-2, 1.00001e-2, 1.00002e-2]);
    assert_eq!(table.columns[1], [2.0, 3.0, 4.0]);
    // A second header line with units, as CTH's hscth files have it.
    let table = parse("time, pressure\n(s), (dyn/cm2)\n 0.0, 1.0D+6\n 1.0, -2.0D+6\n");
    assert_eq!((table.names[1].as_str(), &table.columns[1][..]), ("pressure", &[1e6, -2e6][..]));
    // Negative numbers at the start of a line are not messages.
    assert_eq!(parse("a, time\n-1.0, 0.1\n-2.0, 0.2\n").columns[0], [-1.0, -2.0]);
}

#[test]
fn what_cannot_be_read_is_named() {
    let text = complaint("Time, a\n 1.0, 2.0\n 2.0, x1.0\n 3.0, 4.0\n");
    assert_eq!(text, "run.txt, line 3: expected a row of 2 numbers, found `2.0, x1.0`");
    let text = complaint("Time, a\n 1.0, 2.0\nTime, b\n 3.0, 4.0\n");
    assert!(text.contains("line 3: the header changes to `Time`, `b`"), "{text}");
    // Labels below rows without them, which would give the earlier rows too few columns.
    let text = complaint("1.0, 2.0\n2.0, 3.0\ntime=3.0, a=4.0, b=5.0\ntime=4.0, a=5.0, b=6.0\n");
    assert!(text.contains("line 3: expected a row of 2 numbers, found `time=3.0"), "{text}");
    assert!(complaint("").contains("is empty"));
    assert!(complaint("a\0b").contains("zero bytes"));
    let table = parse("strain_B=1.0, strain_C=2.0\n");
    let text = table.series("strain_B").unwrap_err().to_string();
    assert!(text.contains("no time column") && text.contains("global time"), "{text}");
    let text = parse("time=1.0, a=2.0\n").series("b").unwrap_err().to_string();
    assert!(text.contains("no column `b`; it has `time`, `a`"), "{text}");
}
