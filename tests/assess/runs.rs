//! Runs, emulators and models that are not adequate for a calibration.

use std::fmt::Write as _;
use std::fs;

use lacuna_engine::assess::{Level, Severity};
use lacuna_engine::stage::contents;
use lacuna_run::arrays;

use super::{assess, change, findings, found, oscillator, stop};
use crate::quick;

#[test]
fn one_wrong_number_in_the_table_of_responses_is_named() {
    let folder = quick::tables();
    change(folder.path(), "responses.csv", "r17,", |y, _| 10.0 * y);
    let assessment = assess(folder.path(), &[]);
    let finding = found(&assessment, "suspicious_run", Severity::Reservation);
    assert_eq!(finding.place, "run r17");
    assert!(finding.message.contains("times the predicted one"), "{}", finding.message);
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
    // A check says the same before anything is run.
    let study = quick::load(&folder.path().join("study.toml"), &[]);
    assert_eq!(contents::check(&study).unwrap_err()[0].to_string(), text);
    let assessment = assess(folder.path(), &["simulations.outside_design=\"allow\""]);
    found(&assessment, "runs_outside_design", Severity::Reservation);
    // Inside the design the response reveals it.
    quick::replace(&table, "r02,19.06489,", "r02,2.490000,");
    let assessment = assess(folder.path(), &[]);
    assert_eq!(found(&assessment, "suspicious_run", Severity::Reservation).place, "run r02");
}

/// Of more than 5000 runs not all error curves are kept; a wrong run is found among all.
#[test]
fn one_wrong_run_among_thousands_is_named() {
    let folder = quick::tables();
    let (mut runs, mut responses) = (
        "run,frequency [Hz],damping [1/s]\n".to_owned(),
        "run,time [s],displacement [mm]\n".to_owned(),
    );
    for i in 0..5200 {
        // Points of an additive recurrence (Roberts 2018), and the oscillator in closed form.
        let along = |ratio: f64| (0.5 + ratio * f64::from(i)).fract();
        let (frequency, damping) = (1.5 + along(0.754_877_67), 0.5 + 2.5 * along(0.569_840_29));
        writeln!(runs, "r{i:04},{frequency},{damping}").unwrap();
        for k in 1..=20 {
            let t = 0.05 * f64::from(k);
            let y = (-damping * t).exp() * (std::f64::consts::TAU * frequency * t).cos();
            writeln!(responses, "r{i:04},{t:.2},{y}").unwrap();
        }
    }
    fs::write(folder.path().join("runs.csv"), runs).unwrap();
    fs::write(folder.path().join("responses.csv"), responses).unwrap();
    change(folder.path(), "responses.csv", "r3001,", |y, _| 1.5 * y);
    let findings = findings(folder.path(), &["surrogate.validation=100"]);
    let finding = found(&findings.assessment, "suspicious_run", Severity::Reservation);
    assert_eq!(finding.place, "run r3001");
    let kept = arrays::read(&folder.path().join("run/4-surrogate/errors.nc"), "samples").unwrap();
    assert_eq!(kept.dimensions[0].1, 5000 + 100);
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

/// A coarse emulator, and a truth at the edge of the prior, beyond which there are no runs.
#[test]
fn runs_that_end_with_the_prior_are_told_where_the_posterior_lies_there() {
    let folder = oscillator();
    let prior = ("uniform = [1.5, 2.5]", "uniform = [1.87, 2.9]");
    quick::replace(&folder.path().join("study.toml"), prior.0, prior.1);
    let assessment = assess(folder.path(), &["surrogate.degree=3"]);
    assert_eq!(found(&assessment, "no_margin", Severity::Note).place, "frequency");
    let settings = ["surrogate.degree=3", "design.margin=0.1"];
    assert_eq!(assess(folder.path(), &settings).of_code("no_margin").count(), 0);
}

/// Mercury so soft that the applied pressure changes its volume by more than a tenth.
#[test]
fn runs_outside_the_models_validity_are_told() {
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    let invalid = |settings: &[&str]| {
        let ran = quick::run(&path, settings, &folder.path().join("run"));
        let assessment = ran.unwrap_or_else(|stop| panic!("{stop}")).findings.assessment;
        assessment.of_code("runs_invalid").map(|f| f.severity).next()
    };
    assert_eq!(invalid(&[]), None);
    quick::replace(&path, "uniform = [1200.0, 2200.0]", "uniform = [50.0, 2200.0]");
    let settings = ["model.pulse={ load = fixed_pressure }", "surrogate.invalid_runs=train"];
    assert_eq!(invalid(&settings), Some(Severity::Reservation));
}

/// One round with a few runs of an expansion that is too simple for the oscillator.
#[test]
fn a_refinement_that_was_cut_short_is_told() {
    let folder = oscillator();
    let settings = ["surrogate.degree=2", "surrogate.refine={runs=3, rounds=1, until=1e-4}"];
    found(&assess(folder.path(), &settings), "refinement_unfinished", Severity::Reservation);
    let settings = ["surrogate.refine={runs=3, rounds=1, until=0.5}"];
    assert_eq!(assess(folder.path(), &settings).of_code("refinement_unfinished").count(), 0);
}

#[test]
fn a_model_that_has_no_answer_in_a_part_of_the_prior_is_told() {
    let folder = oscillator();
    let path = folder.path().join("study.toml");
    let without =
        "cos(2 * pi * frequency * time) * 1 {mm} + 0 {mm} * log((frequency - 1.8 {Hz}) / 1 {Hz})";
    quick::replace(&path, "cos(2 * pi * frequency * time) * 1 {mm}", without);
    let settings = ["surrogate=false", "design=false"];
    let assessment = assess(folder.path(), &settings);
    let finding = found(&assessment, "model_without_answer", Severity::Reservation);
    // 30 % of the prior lie below 1.8 Hz; the standard deviation for 64 draws is 6 %.
    assert!((finding.figure.unwrap() - 0.3).abs() < 0.24, "{finding:?}");
}

/// The best fit of the emulator is not a good fit of the model.
#[test]
fn a_reference_that_fits_better_than_the_calibration_is_told() {
    let folder = oscillator();
    let settings = ["surrogate.degree=1", "discrepancy.emulator_error=false"];
    found(&assess(folder.path(), &settings), "no_better_than_reference", Severity::Failure);
    assert_eq!(assess(folder.path(), &[]).of_code("no_better_than_reference").count(), 0);
}

/// A mesh of a few cells, whose discretisation error is many times the noise.
#[test]
fn a_coarse_mesh_is_told() {
    let folder = quick::simulated();
    let settings = ["numerical_error={runs=6, model={numerics={mesh=[8, 72]}}}"];
    let path = folder.path().join("study.toml");
    let ran = quick::run(&path, &settings, &folder.path().join("run"));
    let assessment = ran.unwrap_or_else(|stop| panic!("{stop}")).findings.assessment;
    found(&assessment, "numerical_error", Severity::Reservation);
}

/// A poor emulator with a discrepancy that samples its error: with all directions above the noise nothing is omitted,
/// with few of them the omission shifts the estimates.
#[test]
fn errors_that_are_sampled_in_too_few_directions_are_told() {
    let folder = quick::tables();
    let path = folder.path().join("study.toml");
    let text = fs::read_to_string(&path).unwrap();
    let end = text.find("[discrepancy]").unwrap();
    let rest = "[discrepancy]\nuse = \"student_t\"\nscale = { half_normal = 0.1 }\n\n[sampler]\nuse = \"no_u_turn\"\n\
                warm_up = 500\nsteps = 1500\n";
    fs::write(&path, format!("{}{rest}", &text[..end])).unwrap();
    let left_out = |settings: &[&str]| {
        let settings = [&["surrogate.degree=2"], settings].concat();
        let ran = quick::run(&path, &settings, &folder.path().join("run"));
        let findings = ran.unwrap_or_else(|stop| panic!("{stop}")).findings;
        let emulator = findings.validation.unwrap().spread;
        let emulator = emulator.into_iter().find(|(origin, _)| origin == "emulator").unwrap().1;
        (findings.assessment.of_code("sampled_errors").map(|f| f.severity).next(), emulator)
    };
    let (none, of_all) = left_out(&[]);
    let (few, of_few) = left_out(&["discrepancy.common={ share = 0, most = 0 }"]);
    assert_eq!((none, few), (None, Some(Severity::Reservation)));
    // New data contain the whole error, however much of it was sampled.
    assert_eq!(of_all, of_few);
    let gaussian = findings(quick::tables().path(), &["surrogate.degree=2"]);
    let spread = gaussian.validation.unwrap().spread;
    let emulator = spread.iter().find(|(origin, _)| origin == "emulator").unwrap().1;
    assert!((emulator / of_all - 1.0).abs() < 1e-9, "{emulator} {of_all}");
}
