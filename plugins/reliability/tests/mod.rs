//! Methods against published and closed-form probabilities.

#![allow(clippy::unwrap_used)]

mod problems;

use lacuna::math::special::normal_cdf;

use self::problems::*;

/// Relative error of an estimate.
fn error(found: f64, problem: &Problem) -> f64 {
    found / problem.probability - 1.0
}

#[test]
#[ignore = "prints a table; run by hand"]
fn table() {
    for (method, options) in [
        ("form", ""),
        ("sorm", ""),
        ("importance_sampling", ""),
        ("subset_simulation", ""),
        ("active_kriging", ""),
    ] {
        for problem in ALL {
            if problem.dimension > 20 && matches!(method, "active_kriging") {
                continue;
            }
            let began = std::time::Instant::now();
            let plugin_runs = if method == "active_kriging" { 3 } else { 1 };
            for seed in 0..plugin_runs {
                let found = estimate(method, options, problem, seed);
                println!(
                    "{method:22} {:22} {:8} calls {:10.3e} error {:7.3} cov {:?} {:?} points {} {:?} {:.1}s",
                    problem.name,
                    found.calls,
                    found.probability,
                    error(found.probability, problem),
                    found.variation.map(|v| (v * 1000.0).round() / 1000.0),
                    found.interval,
                    found.design_points.len(),
                    found.warnings,
                    began.elapsed().as_secs_f64()
                );
            }
        }
    }
}

#[test]
fn a_plane_has_its_probability_at_first_and_second_order() {
    for method in ["form", "sorm"] {
        let found = estimate(method, "", &PLANE, 1);
        assert!(error(found.probability, &PLANE).abs() < 1e-5, "{found:?}");
        assert!(found.converged && found.design_points.len() == 1, "{found:?}");
        let importance = found.design_points[0].importance();
        assert!(importance.iter().all(|a| (a - 0.5).abs() < 1e-6), "{importance:?}");
    }
    let _ = normal_cdf(0.0);
}
