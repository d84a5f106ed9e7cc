//! Data that are not what they are taken for, and a model that cannot have produced them.

use std::fmt::Write as _;
use std::fs;

use generator::noise::Source;
use lacuna_engine::assess::{Level, Severity};
use tempfile::TempDir;

use super::{assess, change, found};
use crate::quick;

#[test]
fn copies_of_one_curve_are_no_replicates() {
    let folder = quick::tables();
    let text = fs::read_to_string(folder.path().join("measured.csv")).unwrap();
    // A copy of each of the six curves under another number.
    let copies: String = text
        .lines()
        .skip(1)
        .map(|line| {
            let (number, rest) = line.split_once(',').unwrap();
            format!("{},{rest}\n", number.parse::<usize>().unwrap() + 6)
        })
        .collect();
    fs::write(folder.path().join("measured.csv"), text + &copies).unwrap();
    let assessment = assess(folder.path(), &[]);
    found(&assessment, "duplicate_replicates", Severity::Failure);
    assert_eq!(assessment.level, Level::NotTrusted);
}

#[test]
fn data_in_another_unit_are_called_that() {
    let folder = quick::tables();
    change(folder.path(), "measured.csv", "", |y, _| 1e-3 * y);
    let assessment = assess(folder.path(), &[]);
    let finding = found(&assessment, "data_outside_runs", Severity::Failure);
    assert!(finding.message.contains("1000 times too small"), "{}", finding.message);
}

const KNOWN: &str = r#"
study = { title = "a known response", seed = 5 }
parameter = [{ name = "rate", prior = { normal = [0.5, 5e-4] } }]
response = { name = "y", axes = { t = { measured = true, unit = "1" } } }
model = { use = "equations", observe = "RESPONSE" }
measurements = { use = "csv", path = "y.csv" }
discrepancy = { use = "gaussian", variance = { half_normal = 1.0 } }
sampler = { use = "affine_invariant_ensemble" }
"#;

/// Single records of responses that are known to one part in a thousand: all runs are within a hundredth of the noise of each
/// other, and nearly every value lies outside of their range. A record is told from a shifted one only by its scatter, also where
/// the response oscillates as fast as it is sampled.
#[test]
fn noise_about_a_model_that_is_known_is_not_outside_of_the_runs() {
    type Response = fn(f64) -> f64;
    let responses: [(&str, Response); 2] = [
        ("exp(-rate * t)", |t| (-0.5 * t).exp()),
        ("2 * rate * cos(30 * t)", |t| (30.0 * t).cos()),
    ];
    for (formula, response) in responses {
        let assessed = |shift: f64, stated: &[&str]| {
            let folder = tempfile::tempdir().unwrap();
            let mut random = Source::new(12);
            let mut table = "t [1],y\n".to_owned();
            for i in 0..60 {
                let t = f64::from(i) / 10.0;
                writeln!(table, "{t},{}", response(t) + shift + 0.1 * random.normal()).unwrap();
            }
            fs::write(folder.path().join("y.csv"), table).unwrap();
            let study = KNOWN.replace("RESPONSE", formula);
            fs::write(folder.path().join("study.toml"), study).unwrap();
            assess(folder.path(), stated)
        };
        for stated in [&[][..], &["measurements.noise.sd=0.1"]] {
            let plain = assessed(0.0, stated);
            assert_eq!(plain.of_code("data_outside_runs").count(), 0, "{:#?}", plain.findings);
            found(&assessed(0.5, stated), "data_outside_runs", Severity::Failure);
        }
    }
}

/// Four numbers of different size, once each, are no curve whose scatter could hide the wrong unit.
#[test]
fn single_numbers_in_another_unit_are_called_that() {
    let folder = tempfile::tempdir().unwrap();
    let labels = r#"part = { labels = ["a", "b", "c", "d"] }"#;
    let formulas = r#"{ a = "2 * rate", b = "20 * rate", c = "200 * rate", d = "2000 * rate" }"#;
    let study = KNOWN
        .replace(r#"t = { measured = true, unit = "1" }"#, labels)
        .replace(r#""RESPONSE""#, formulas);
    fs::write(folder.path().join("study.toml"), study).unwrap();
    fs::write(folder.path().join("y.csv"), "part,y\na,1e3\nb,1e4\nc,1e5\nd,1e6\n").unwrap();
    let assessment = assess(folder.path(), &[]);
    let finding = found(&assessment, "data_outside_runs", Severity::Failure);
    assert!(finding.message.contains("1000 times too large"), "{}", finding.message);
}

/// A slow oscillation that the model cannot produce, larger than the noise and the same in all replicates.
#[test]
fn a_model_that_lacks_something_is_not_trusted() {
    let folder = quick::tables();
    change(folder.path(), "measured.csv", "", |y, i| y + 0.25 * ((i % 20) as f64 / 3.0).sin());
    let assessment = assess(folder.path(), &[]);
    assert_eq!(assessment.level, Level::NotTrusted);
    found(&assessment, "model_form", Severity::Failure);
    assert!(assessment.of_code("predictive_check").count() > 0, "{:#?}", assessment.findings);
}

/// The same oscillation in a single record: no replicates show the noise, but the data sheet of the instrument does. The noise of
/// the measurements has a standard deviation of 0.019 mm.
#[test]
fn a_model_that_lacks_something_is_told_by_the_noise_that_is_stated() {
    let folder = quick::tables();
    let path = folder.path().join("measured.csv");
    let text = fs::read_to_string(&path).unwrap();
    let first = |(i, line): &(usize, &str)| *i == 0 || line.starts_with("1,");
    let one: Vec<&str> = text.lines().enumerate().filter(first).map(|(_, line)| line).collect();
    fs::write(&path, one.join("\n") + "\n").unwrap();
    let stated = ["measurements.noise.sd=0.019"];
    let assessment = assess(folder.path(), &stated);
    assert_eq!(assessment.of_code("model_form").count(), 0, "{:#?}", assessment.findings);
    change(folder.path(), "measured.csv", "", |y, i| y + 0.25 * ((i % 20) as f64 / 3.0).sin());
    found(&assess(folder.path(), &stated), "model_form", Severity::Failure);
}

/// The missing oscillation together with an emulator of degree two, whose error is five times the noise: the estimates
/// allow for two and a half times as much, but the expected scatter of data does not, so the oscillation is not
/// attributed to the emulator's error.
#[test]
fn a_bad_emulator_does_not_hide_what_the_model_lacks() {
    let settings = ["surrogate.training=24", "surrogate.degree=2"];
    let misfit = |folder: &TempDir| {
        let assessment = assess(folder.path(), &settings);
        let found = assessment.of_code("predictive_check").find(|f| f.place == "misfit");
        found.map(|f| f.severity)
    };
    let folder = quick::tables();
    assert_eq!(misfit(&folder), None);
    change(folder.path(), "measured.csv", "", |y, i| y + 0.25 * ((i % 20) as f64 / 3.0).sin());
    assert_eq!(misfit(&folder), Some(Severity::Failure));
}

/// Data correlated from point to point: sums of independent steps, which a Gaussian discrepancy takes as noise.
#[test]
fn noise_that_is_correlated_in_time_is_told() {
    let folder = quick::tables();
    let text = fs::read_to_string(folder.path().join("measured.csv")).unwrap();
    let count = text.lines().count() - 1;
    let mut state = 12_345_u64;
    let mut uniform = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    let mut walk = 0.0;
    let drift: Vec<f64> = (0..count)
        .map(|i| {
            walk = if i % 20 == 0 { 0.1 * uniform() } else { 0.97 * walk + 0.05 * uniform() };
            walk
        })
        .collect();
    change(folder.path(), "measured.csv", "", |y, i| y + drift[i]);
    let assessment = assess(folder.path(), &["discrepancy.replicate_error=false"]);
    assert!(assessment.of_code("correlated_residuals").count() > 0, "{:#?}", assessment.findings);
}

/// A table of a mean and the ends of its 95 % interval, declared as three replicates.
#[test]
fn a_mean_and_the_ends_of_its_interval_are_no_replicates() {
    let folder = quick::tables();
    let path = folder.path().join("measured.csv");
    let text = fs::read_to_string(&path).unwrap();
    let mut values: Vec<(String, Vec<f64>)> = Vec::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let value: f64 = cells[2].parse().unwrap();
        match values.iter_mut().find(|(time, _)| time == cells[1]) {
            Some((_, of_time)) => of_time.push(value),
            None => values.push((cells[1].to_owned(), vec![value])),
        }
    }
    let mut table = format!("{}\n", text.lines().next().unwrap());
    for (curve, quantile) in [(1, 0.0), (2, -1.96), (3, 1.96)] {
        for (time, of_time) in &values {
            let n = of_time.len() as f64;
            let mean = of_time.iter().sum::<f64>() / n;
            let square = of_time.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / (n - 1.0);
            table += &format!("{curve},{time},{}\n", mean + quantile * (square / n).sqrt());
        }
    }
    fs::write(&path, table).unwrap();
    let assessment = assess(folder.path(), &[]);
    found(&assessment, "symmetric_replicates", Severity::Failure);
    assert_eq!(assessment.level, Level::NotTrusted);
}

/// One of six curves of a gauge that came loose.
#[test]
fn a_curve_that_the_screen_leaves_out_is_told() {
    let folder = quick::tables();
    change(folder.path(), "measured.csv", "5,", |y, _| 5.0 * y);
    let settings = ["measurements.screen={ threshold = 5.0, leave_out = true }"];
    let assessment = assess(folder.path(), &settings);
    let finding = found(&assessment, "left_out_curves", Severity::Reservation);
    assert_eq!(finding.figure, Some(1.0 / 6.0));
    let sound = assess(quick::tables().path(), &settings);
    assert_eq!(sound.of_code("left_out_curves").count(), 0);
}

/// Curves derived from the replicates, as in the paper of the founding study.
#[test]
fn curves_that_are_made_of_the_replicates_are_told() {
    let folder = quick::tables();
    let assessment = assess(folder.path(), &["measurements.added_curves=[\"mean\"]"]);
    found(&assessment, "added_curves", Severity::Reservation);
}

/// A line for which all values but one are measured near its beginning: that one determines the slope.
#[test]
fn a_value_without_which_the_posterior_were_another_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    let influential = |last: f64| {
        let times: Vec<f64> = (0..8).map(|k| if k == 7 { last } else { f64::from(k) }).collect();
        let parameter = |name: &str| {
            format!("[[parameter]]\nname = \"{name}\"\nprior = {{ normal = [0.0, 100.0] }}\n")
        };
        let text = format!(
            "[study]\ntitle = \"a lever\"\nseed = 1\n{}{}[response]\nname = \"height\"\n\
             axes = {{ t = {{ values = {times:?}, unit = \"1\" }} }}\n\
             [model]\nuse = \"equations\"\nobserve = \"level + rise * t\"\n\
             [measurements]\nuse = \"csv\"\npath = \"measured.csv\"\n\
             [discrepancy]\nuse = \"gaussian\"\nvariance = {{ known = 0.01 }}\nreplicate_error = false\n\
             [sampler]\nuse = \"affine_invariant_ensemble\"\n",
            parameter("level"),
            parameter("rise")
        );
        fs::write(&path, text).unwrap();
        let noise = [0.12, -0.07, 0.03, -0.15, 0.08, 0.02, -0.04, 0.06];
        let row = |(t, e): (&f64, &f64)| format!("1,{t},{}\n", 0.5 * t + e);
        let rows: String = times.iter().zip(&noise).map(row).collect();
        let table = format!("replicate,t [1],height\n{rows}");
        fs::write(folder.path().join("measured.csv"), table).unwrap();
        let assessment = assess(folder.path(), &[]);
        assessment.of_code("influential_data").map(|f| f.severity).next()
    };
    assert_eq!(influential(1000.0), Some(Severity::Reservation));
    assert_eq!(influential(7.0), None);
}
