//! Every check is triggered by data with a known fault, and silent on correct data.

use lacuna::math::random::{Stream, normal, uniform};
use lacuna_linalg::Matrix;

use super::*;

mod data;
mod draws;
mod suspects;

fn has(finding: Option<&Finding>, code: &str, severity: Severity) {
    let finding = finding.unwrap_or_else(|| panic!("no finding `{code}`"));
    assert_eq!((finding.code.as_str(), finding.severity), (code, severity), "{finding:?}");
    assert!(!finding.message.is_empty() && !finding.action.is_empty());
}

#[test]
fn the_worst_finding_decides_and_stands_first() {
    assert_eq!(Assessment::of(Vec::new()).level, Level::Trusted);
    let note = runs::failed(1, 100).unwrap();
    assert_eq!(Assessment::of(vec![note.clone()]).level, Level::Trusted);
    let reservation = runs::failed(20, 100).unwrap();
    let failure = runs::failed(60, 100).unwrap();
    let reserved = Assessment::of(vec![note.clone(), reservation.clone()]);
    assert_eq!(reserved.level, Level::TrustedWithReservations);
    assert_eq!(reserved.line(), "trusted with reservations: 1 reservation");
    let refused = Assessment::of(vec![note, reservation, failure.clone()]);
    assert_eq!((refused.level, &refused.findings[0]), (Level::NotTrusted, &failure));
    assert_eq!(refused.line(), "NOT TRUSTED: 1 reason, 1 reservation");
}

#[test]
fn a_finding_reads_back_with_a_figure_that_is_not_finite() {
    let finding = Finding::new(("a", "b"), (f64::NAN, 1.0), Severity::Note, "c".into(), "d");
    let text = serde_json::to_string(&finding).unwrap();
    assert!(text.contains(r#""where":"b""#) && text.contains(r#""figure":null"#), "{text}");
    assert_eq!(serde_json::from_str::<Finding>(&text).unwrap(), finding);
}

#[test]
fn every_rule_is_written_out_and_has_its_own_code() {
    let rules = rules();
    let mut codes: Vec<&str> = rules.iter().map(|rule| rule.code).collect();
    codes.sort_unstable();
    let all = codes.len();
    codes.dedup();
    assert_eq!(codes.len(), all);
    for rule in &rules {
        let parts = [&*rule.looks_at, &*rule.threshold, rule.why, rule.action];
        assert!(parts.iter().all(|part| part.len() > 3), "{}", rule.code);
    }
}

/// A design of 603 runs of which two are inside the prior, as for the founding study.
#[test]
fn few_runs_inside_the_prior() {
    has(runs::few_in_prior(2, 480, 3, None).as_ref(), "few_runs_near_posterior", Severity::Failure);
    let some = runs::few_in_prior(20, 480, 3, Some(0.8));
    has(some.as_ref(), "few_runs_near_posterior", Severity::Reservation);
    // An emulator without error needs no further runs.
    assert_eq!(runs::few_in_prior(2, 480, 3, Some(0.01)), None);
    assert_eq!(runs::few_in_prior(30, 30, 3, None), None);
}

#[test]
fn draws_beyond_all_runs() {
    let beyond = runs::extrapolated("x", 0.7, (1.5, 2.5));
    has(beyond.as_ref(), "few_runs_near_posterior", Severity::Failure);
    assert_eq!(runs::extrapolated("x", 0.01, (1.5, 2.5)), None);
    has(runs::sparse(4.0, None).as_ref(), "few_runs_near_posterior", Severity::Reservation);
    assert_eq!((runs::sparse(2.0, None), runs::sparse(4.0, Some(0.01))), (None, None));
}

#[test]
fn invalid_failed_and_allowed_runs() {
    let sns = runs::Invalid { all: (161, 603), in_prior: (0, 2), trained: true };
    has(runs::invalid(&sns).as_ref(), "runs_invalid", Severity::Reservation);
    let dropped = runs::Invalid { trained: false, ..sns };
    has(runs::invalid(&dropped).as_ref(), "runs_invalid", Severity::Note);
    assert_eq!(runs::invalid(&runs::Invalid { all: (0, 603), ..sns }), None);
    has(runs::no_margin("x", 0.7, 2.5, Some(0.6)).as_ref(), "no_margin", Severity::Note);
    assert_eq!(runs::no_margin("x", 0.7, 2.5, Some(0.1)), None, "the emulator is good there");
    assert_eq!(runs::no_margin("x", 0.2, 2.5, Some(0.6)), None, "the posterior is elsewhere");
    assert_eq!(runs::no_margin("x", 0.7, 2.5, None), None, "nothing is known of the error");
    assert_eq!((runs::failed(0, 10), runs::outside_design(0, 10, &[])), (None, None));
    let outside = runs::outside_design(3, 10, &["x".to_owned()]);
    has(outside.as_ref(), "runs_outside_design", Severity::Reservation);
}

/// An error along the direction of a parameter shifts it by its size in standard deviations.
#[test]
fn errors_that_move_estimates() {
    let effect = |shift: f64, allowed| emulator::Effect {
        shifts: vec![("x".to_owned(), shift), ("y".to_owned(), 0.1 * shift)],
        against_noise: Some(2.0),
        allowed,
    };
    assert_eq!(emulator::emulator(&effect(0.3, false)), None);
    has(emulator::emulator(&effect(0.7, false)).as_ref(), "emulator_error", Severity::Reservation);
    has(emulator::emulator(&effect(3.0, false)).as_ref(), "emulator_error", Severity::Failure);
    assert_eq!(emulator::emulator(&effect(0.5, true)), None);
    has(emulator::emulator(&effect(0.9, true)).as_ref(), "emulator_error", Severity::Reservation);
    has(emulator::numerical(&effect(0.9, true)).as_ref(), "numerical_error", Severity::Reservation);
    assert_eq!(emulator::numerical(&effect(0.2, true)), None);
    let sampled = |shift| emulator::sampled(&[("x".to_owned(), shift)], 9);
    has(sampled(0.7).as_ref(), "sampled_errors", Severity::Reservation);
    has(sampled(12.0).as_ref(), "sampled_errors", Severity::Failure);
    assert_eq!(sampled(0.3), None);
    has(emulator::left_out(0.43, 24).as_ref(), "emulator_error", Severity::Failure);
    assert_eq!(emulator::left_out(0.01, 24), None);
    has(emulator::at_posterior(6.0, 20, true).as_ref(), "emulator_error", Severity::Failure);
    assert_eq!(emulator::at_posterior(6.0, 20, false), None);
    assert_eq!(emulator::at_posterior(1.2, 20, true), None);
    let unfinished = emulator::unfinished(5, (0.4, "the discrepancy"), 0.1, false);
    has(Some(&unfinished), "refinement_unfinished", Severity::Reservation);
    has(Some(&runs::idle("x")), "idle_parameter", Severity::Reservation);
}
