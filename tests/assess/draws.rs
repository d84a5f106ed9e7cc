//! Draws that are not those of the posterior, and posteriors in the wrong place.

use std::fs;

use lacuna_engine::assess::{Assessment, Level, Severity};

use super::{assess, found};
use crate::quick;

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

#[test]
fn chains_that_are_too_short_are_told() {
    let folder = quick::tables();
    let assessment = assess(folder.path(), &["sampler.steps=40"]);
    assert!(assessment.of_code("not_converged").count() > 0, "{:#?}", assessment.findings);
    assert!(assessment.of_code("short_chain").count() > 0);
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

/// Chains that start at the higher of two modes never reach the other, 12 standard deviations away.
#[test]
fn a_mode_without_draws_is_told_and_limits_convergence_and_evidence() {
    let two =
        "log(exp(-0.5 * ((a - 3) / 0.25)^2) + 0.8 * exp(-0.5 * ((a + 3) / 0.25)^2)) - 0.5 * b^2";
    let assessment = target(two, NUTS);
    found(&assessment, "unvisited_mode", Severity::Failure);
    assert_eq!(assessment.level, Level::NotTrusted);
}

/// Two normal peaks in the unit cube, the second, of 30 %, in a corner: six searches of four hundred draws rarely find
/// its basin, and chains from the prior reach the other.
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
        // A corner contains a fraction 2^-d of a normal distribution.
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

/// A peak lower than the other by a factor of 1e12, from whose neighbourhood no walker escapes.
#[test]
fn walkers_that_never_reach_the_bulk_are_told() {
    let two =
        "log(exp(-50 * (a - 3)^2 - 50 * (b - 3)^2) + exp(-25 - 50 * (a + 5)^2 - 50 * (b + 5)^2))";
    let ensemble = "use = \"affine_invariant_ensemble\"\nwalkers = 40\nsteps = 2000\nstart = ";
    let assessment = target(two, &format!("{ensemble}\"prior\""));
    found(&assessment, "stranded_walkers", Severity::Failure);
    let assessment = target(two, &format!("{ensemble}\"map\""));
    assert_eq!(assessment.of_code("stranded_walkers").count(), 0);
}

/// Ripples in six directions on a hill: the optimisation ends on the nearest ripple, and the chains climb further.
#[test]
fn a_maximum_that_the_search_did_not_find_is_told() {
    let unreached = |ripple: f64| {
        let names: Vec<String> = (0..6).map(|j| format!("x{j}")).collect();
        let term = |name: &String| format!("-0.5 * {name}^2 + {ripple} * cos(12 * {name})");
        let terms: Vec<String> = names.iter().map(term).collect();
        let parameter = |name: &String| {
            format!("[[parameter]]\nname = \"{name}\"\nprior = {{ normal = [0.0, 3.0] }}\n")
        };
        let parameters: String = names.iter().map(parameter).collect();
        let text = format!(
            "[study]\ntitle = \"ripples\"\nseed = 3\n{parameters}[target]\nuse = \"expression\"\n\
             log_density = \"{}\"\n[sampler]\nuse = \"differential_evolution\"\n",
            terms.join(" + ")
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.toml");
        fs::write(&path, text).unwrap();
        let ran = quick::run(&path, &[], &folder.path().join("run"));
        let assessment = ran.unwrap_or_else(|stop| panic!("{stop}")).findings.assessment;
        assessment.of_code("map_not_found").map(|f| f.severity).next()
    };
    assert_eq!(unreached(2.0), Some(Severity::Reservation));
    assert_eq!(unreached(0.0), None);
}
