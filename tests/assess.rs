//! The verdict on studies that are sound, and on the same with one thing wrong: data and tables are spoilt, never
//! a finding constructed.

use std::fs;
use std::path::Path;

use lacuna::assess::{Assessment, Finding, Level, Severity};
use tempfile::TempDir;

use crate::quick;

const SHORT: [&str; 2] = ["sampler.walkers=24", "sampler.steps=2500"];

fn assess(folder: &Path, settings: &[&str]) -> Assessment {
    let path = folder.join("study.toml");
    let ran = quick::run(&path, &[&SHORT, settings].concat(), &folder.join("run"));
    ran.unwrap_or_else(|stop| panic!("{stop}")).findings.assessment
}

fn found<'a>(assessment: &'a Assessment, code: &str, severity: Severity) -> &'a Finding {
    let found = assessment.findings.iter().find(|f| f.code == code && f.severity == severity);
    found.unwrap_or_else(|| panic!("no {severity:?} `{code}`: {:#?}", assessment.findings))
}

/// Changes the last cell of the lines of a table that begin with some text.
fn change(folder: &Path, file: &str, begins: &str, value: impl Fn(f64, usize) -> f64) {
    let path = folder.join(file);
    let text = fs::read_to_string(&path).unwrap();
    let mut lines: Vec<String> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let (rest, last) = line.rsplit_once(',').unwrap();
        lines.push(match last.parse::<f64>() {
            Ok(number) if i > 0 && line.starts_with(begins) => {
                format!("{rest},{}", value(number, i - 1))
            }
            _ => line.to_owned(),
        });
    }
    fs::write(path, lines.join("\n") + "\n").unwrap();
}

fn stop(folder: &TempDir, settings: &[&str]) -> String {
    let ran = quick::run(&folder.path().join("study.toml"), settings, &folder.path().join("run"));
    ran.map(|_| ()).unwrap_err().to_string()
}

#[test]
fn the_study_that_is_written_for_newcomers_is_trusted_and_says_so_first() {
    let folder = quick::tables();
    let mut command = quick::command();
    command.arg("run").arg(folder.path().join("study.toml")).args(["--strict", "--out"]);
    let output = command.arg(folder.path().join("run")).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert_eq!(text.lines().find(|line| !line.is_empty()), Some("trusted"), "{text}");
    let page = fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    let (verdict, result) = (page.find("assessment trusted"), page.find("Posterior means with"));
    assert!(verdict.unwrap() < result.unwrap());
    assert_eq!(quick::summary(&folder.path().join("run"))["assessment"]["level"], "trusted");
}

#[test]
fn a_strict_run_without_trust_ends_with_its_own_exit_code() {
    let folder = quick::tables();
    change(folder.path(), "measured.csv", "", |y, _| 1e-3 * y);
    let study = folder.path().join("study.toml");
    let run = folder.path().join("run");
    let strict = |verb: &str, what: &Path, strict: bool| {
        let mut command = quick::command();
        command.arg(verb).arg(what).args(strict.then_some("--strict"));
        if verb == "run" {
            command.args(["--set", "sampler.steps=300", "--out"]).arg(&run);
        }
        quick::said(&mut command)
    };
    assert_eq!(strict("run", &study, false).0, Some(0));
    let (code, said) = strict("run", &study, true);
    assert_eq!(code, Some(3));
    assert!(said.contains("error: NOT TRUSTED"), "{said}");
    assert_eq!(strict("resume", &run, true).0, Some(3));
    assert_eq!(strict("report", &run, false).0, Some(0));
}

#[test]
fn one_wrong_number_in_the_table_of_responses_is_named() {
    let folder = quick::tables();
    change(folder.path(), "responses.csv", "r17,", |y, _| 10.0 * y);
    let assessment = assess(folder.path(), &[]);
    let finding = found(&assessment, "suspicious_run", Severity::Reservation);
    assert_eq!(finding.place, "run r17");
    assert!(finding.message.contains("times the expected one"), "{}", finding.message);
}

#[test]
fn one_wrong_number_in_the_table_of_parameters_stops_the_run_with_its_line() {
    let folder = quick::tables();
    let table = folder.path().join("runs.csv");
    quick::replace(&table, "r02,1.906489,", "r02,19.06489,");
    let text = stop(&folder, &[]);
    let expected = "1 of 80 runs lies outside the declared design; the first is run `r02` (runs.csv, line 3): \
                    `frequency` is 19.06489, and its design reaches from 1.5 to 2.5";
    assert!(text.starts_with(expected), "{text}");
    assert!(text.contains("outside_design = \"allow\""));
    let assessment = assess(folder.path(), &["simulations.outside_design=\"allow\""]);
    found(&assessment, "runs_outside_design", Severity::Reservation);
    // Inside the design the response gives it away.
    quick::replace(&table, "r02,19.06489,", "r02,2.490000,");
    let assessment = assess(folder.path(), &[]);
    assert_eq!(found(&assessment, "suspicious_run", Severity::Reservation).place, "run r02");
}

#[test]
fn a_design_that_the_runs_do_not_have_stops_the_run() {
    let folder = quick::tables();
    let path = folder.path().join("study.toml");
    quick::replace(
        &path,
        "uniform = [1.5, 2.5] }    # where the sim",
        "uniform = [1.9, 2.9] }    # where the sim",
    );
    quick::replace(
        &path,
        "uniform = [1.5, 2.5] }     # where the cal",
        "uniform = [1.9, 2.9] }     # where the cal",
    );
    assert!(
        stop(&folder, &[]).contains("lie outside the declared design"),
        "{}",
        stop(&folder, &[])
    );
}

#[test]
fn copies_of_one_curve_are_no_replicates() {
    let folder = quick::tables();
    let text = fs::read_to_string(folder.path().join("measured.csv")).unwrap();
    // Each of the six curves again, under another number.
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

#[test]
fn a_prior_that_excludes_the_truth_piles_the_posterior_on_its_bound() {
    let folder = quick::tables();
    let path = folder.path().join("study.toml");
    let prior = "prior = { uniform = [1.5, 2.5] }";
    quick::replace(&path, prior, "prior = { uniform = [1.5, 1.88] }");
    let assessment = assess(folder.path(), &[]);
    let finding = found(&assessment, "posterior_at_bound", Severity::Failure);
    assert_eq!(finding.place, "frequency");
}

/// A slow swing that the oscillator cannot make, larger than the noise and the same in all replicates.
#[test]
fn a_model_that_lacks_something_is_not_trusted() {
    let folder = quick::tables();
    change(folder.path(), "measured.csv", "", |y, i| y + 0.25 * ((i % 20) as f64 / 3.0).sin());
    let assessment = assess(folder.path(), &[]);
    assert_eq!(assessment.level, Level::NotTrusted);
    found(&assessment, "model_form", Severity::Failure);
    assert!(assessment.of_code("predictive_check").count() > 0, "{:#?}", assessment.findings);
}

/// The same beside an emulator of degree two, whose error is five times the noise: estimates allow for two and a half times as much, but
/// what data are expected to be does not, and so the swing does not pass for the emulator's error.
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

#[test]
fn an_emulator_that_is_too_coarse_is_not_trusted() {
    let folder = quick::tables();
    let assessment =
        assess(folder.path(), &["surrogate.degree=1", "discrepancy.emulator_error=false"]);
    let finding = found(&assessment, "emulator_error", Severity::Failure);
    assert!(finding.figure.unwrap() > 0.3);
}

#[test]
fn a_handful_of_runs_is_told() {
    let folder = quick::tables();
    let assessment = assess(folder.path(), &["surrogate.training=8"]);
    found(&assessment, "few_runs_near_posterior", Severity::Reservation);
    assert_ne!(assessment.level, Level::Trusted);
}

#[test]
fn chains_that_are_too_short_are_told() {
    let folder = quick::tables();
    let assessment = assess(folder.path(), &["sampler.steps=40"]);
    assert!(assessment.of_code("not_converged").count() > 0, "{:#?}", assessment.findings);
    assert!(assessment.of_code("short_chain").count() > 0);
}

/// Data that stay alike from point to point: sums of independent steps, which a Gaussian discrepancy takes as noise.
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

fn target(density: &str, sampler: &str) -> Assessment {
    let folder = tempfile::tempdir().unwrap();
    let parameter = |name: &str| {
        format!("[[parameter]]\nname = \"{name}\"\nprior = {{ normal = [0.0, 3.0] }}\n")
    };
    let text = format!(
        "[study]\ntitle = \"a density\"\nseed = 3\n{}{}[target]\nuse = \"expression\"\nlog_density = \"{density}\"\n[sampler]\n{sampler}\n",
        parameter("a"),
        parameter("b")
    );
    let path = folder.path().join("study.toml");
    fs::write(&path, text).unwrap();
    let ran = quick::run(&path, &[], &folder.path().join("run"));
    ran.unwrap_or_else(|stop| panic!("{stop}")).findings.assessment
}

const NUTS: &str = "use = \"no_u_turn\"\nwarm_up = 300\nsteps = 1500";

#[test]
fn a_sound_density_is_trusted() {
    let assessment = target("-0.5 * (a - 1)^2 - 0.5 * (b + 1)^2", NUTS);
    assert_eq!(assessment.level, Level::Trusted, "{:#?}", assessment.findings);
}

/// Chains that start at the higher of two modes never see the other, 12 standard deviations away.
#[test]
fn a_mode_without_draws_is_told_and_limits_convergence_and_evidence() {
    let two =
        "log(exp(-0.5 * ((a - 3) / 0.25)^2) + 0.8 * exp(-0.5 * ((a + 3) / 0.25)^2)) - 0.5 * b^2";
    let assessment = target(two, NUTS);
    found(&assessment, "unvisited_mode", Severity::Failure);
    assert_eq!(assessment.level, Level::NotTrusted);
}

/// Two normal peaks on the unit cube, the second, of 30 %, in a corner: six starts of four hundred draws seldom found its basin, and
/// chains from the prior catch the other.
#[test]
fn a_mode_in_a_corner_that_no_chain_caught_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    for (dimension, sd) in [(3, 0.02), (5, 0.05), (8, 0.05)] {
        let names: Vec<String> = (0..dimension).map(|j| format!("x{j}")).collect();
        let prior = |name: &String| {
            format!("[[parameter]]\nname = \"{name}\"\nprior = {{ uniform = [0, 1] }}\n")
        };
        let priors: String = names.iter().map(prior).collect();
        let square = |at: f64| -> String {
            let terms = names.iter().map(|name| format!("(({name} - {at}) / {sd})^2"));
            terms.collect::<Vec<_>>().join(" + ")
        };
        // A corner holds 2^-d of a normal law.
        let second = (0.3 * 2.0_f64.powi(dimension)).ln();
        let (a, b) = (
            format!("({} - 0.5 * ({}))", 0.7_f64.ln(), square(0.4)),
            format!("({second} - 0.5 * ({}))", square(0.0)),
        );
        let density = format!("max({a}, {b}) + log(1 + exp(-abs({a} - {b})))");
        let text = format!(
            "[study]\ntitle = \"corner\"\n{priors}[target]\nuse = \"expression\"\nlog_density = \"{density}\"\n\
             [sampler]\nuse = \"differential_evolution\"\n"
        );
        fs::write(&path, text).unwrap();
        let out = folder.path().join(format!("run{dimension}"));
        let ran = quick::run(&path, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
        found(&ran.findings.assessment, "unvisited_mode", Severity::Failure);
    }
}

#[test]
fn the_determined_combination_of_two_parameters_is_named() {
    let assessment = target("-0.5 * ((a + b - 1) / 0.05)^2", NUTS);
    let finding = found(&assessment, "correlated_parameters", Severity::Reservation);
    assert!(
        finding.message.contains("`b` + `a`") || finding.message.contains("`a` + `b`"),
        "{}",
        finding.message
    );
}

#[test]
fn a_prior_far_from_the_data_is_a_conflict() {
    let assessment = target("-0.5 * ((a - 16) / 0.5)^2 - 0.5 * b^2", NUTS);
    assert_eq!(found(&assessment, "prior_conflict", Severity::Failure).place, "a");
}

/// One value of one run: 19.3 instead of 1.93.
#[test]
fn one_wrong_value_in_one_curve_is_named_with_its_place() {
    let folder = quick::tables();
    let path = folder.path().join("responses.csv");
    let text = fs::read_to_string(&path).unwrap();
    let line = text.lines().find(|line| line.starts_with("r17,")).unwrap();
    let (place, value) = line.rsplit_once(',').unwrap();
    let wrong = 10.0 * value.parse::<f64>().unwrap();
    fs::write(&path, text.replace(line, &format!("{place},{wrong}"))).unwrap();
    let assessment = assess(folder.path(), &[]);
    let finding = found(&assessment, "suspicious_run", Severity::Reservation);
    assert!(finding.place == "run r17" && finding.message.contains("0.05"), "{finding:?}");
}
