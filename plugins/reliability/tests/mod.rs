//! Methods against published and closed-form probabilities.

#![allow(clippy::unwrap_used)]

mod problems;

use lacuna::plugin::reliability::LimitState;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use self::problems::*;

/// Relative error of an estimate.
fn error(found: f64, problem: &Problem) -> f64 {
    found / problem.probability - 1.0
}

/// Every method on every problem, with the lines from which `bench/reliability.py` makes its table. A test run has the two
/// cheap methods on the problems of few variables; `LACUNA_RELIABILITY=1` has all.
#[test]
fn table() {
    let whole = std::env::var_os("LACUNA_RELIABILITY").is_some();
    let methods = ["form", "sorm", "importance_sampling", "subset_simulation", "active_kriging"];
    for &method in &methods[..if whole { 5 } else { 2 }] {
        for problem in ALL {
            let most = if whole && method != "active_kriging" { usize::MAX } else { 20 };
            if problem.dimension > most {
                continue;
            }
            let seeds = if method == "active_kriging" { 5 } else { 2 };
            for seed in 0..seeds {
                let began = std::time::Instant::now();
                let found = estimate(method, "", problem, seed);
                assert!((0.0..=1.0).contains(&found.probability) && found.calls > 0, "{found:?}");
                println!(
                    "{method:20} {:20} {seed} {:6} calls {:9.3e} error {:7.3} cov {:?} {:?} points {} {} {:.1}s",
                    problem.name,
                    found.calls,
                    found.probability,
                    error(found.probability, problem),
                    found.variation.map(|v| (v * 1000.0).round() / 1000.0),
                    found.interval,
                    found.design_points.len(),
                    found.warnings.join("; "),
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
        assert!(error(found.probability, &PLANE).abs() < 1e-4, "{found:?}");
        assert!(found.converged && found.design_points.len() == 1, "{found:?}");
        let importance = found.design_points[0].importance();
        assert!(importance.iter().all(|a| (a - 0.5).abs() < 1e-6), "{importance:?}");
    }
}

/// The points of the first two branches are at 3, those of the others at 3.5 (k = 7).
#[test]
fn all_design_points_of_a_series_system_are_found() {
    let found = estimate("form", "", &FOUR_BRANCH, 1);
    let distances: Vec<f64> = found.design_points.iter().map(|p| p.distance).collect();
    assert_eq!(distances.len(), 4, "{distances:?}");
    for (found, expected) in distances.iter().zip([3.0, 3.0, 3.5, 3.5]) {
        assert!((found - expected).abs() < 5e-3, "{distances:?}");
    }
}

/// The formula of Hohenbichler and Rackwitz is asymptotic: at a distance of 4 its error is some percent; without the
/// curvature the probability is twice as large.
#[test]
fn second_order_knows_the_curvature() {
    for (formula, tolerance) in
        [("hohenbichler_rackwitz", 0.02), ("breitung", 0.12), ("tvedt", 0.02)]
    {
        let options = format!("formula = \"{formula}\"");
        let found = estimate("sorm", &options, &PARABOLOID, 1);
        assert!(error(found.probability, &PARABOLOID).abs() < tolerance, "{formula} {found:?}");
    }
}

/// Unbiased over seeds: the mean of 20 estimates is within four of its standard errors; and the intervals of 95 % hold.
#[test]
fn sampling_methods_agree_with_the_references() {
    const SEEDS: u64 = 20;
    for (method, options, problem) in [
        ("monte_carlo", "samples = 20000", &RP75),
        ("importance_sampling", "", &FOUR_BRANCH),
        ("importance_sampling", "", &RP107),
        ("importance_sampling", "", &PLANE_100),
        ("subset_simulation", "", &FOUR_BRANCH_6),
        ("subset_simulation", "", &RP63),
        ("subset_simulation", "", &PLANE_100),
    ] {
        let all: Vec<_> = (0..SEEDS).map(|seed| estimate(method, options, problem, seed)).collect();
        let errors: Vec<f64> = all.iter().map(|e| error(e.probability, problem)).collect();
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let sd = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let inside = all.iter().filter(|e| {
            let [low, high] = e.interval.unwrap();
            (low..=high).contains(&problem.probability)
        });
        let inside = inside.count();
        let claimed = all.iter().map(|e| e.variation.unwrap()).sum::<f64>() / n;
        println!(
            "{method} {}: mean {mean:.3} sd {sd:.3} claimed {claimed:.3} inside {inside}",
            problem.name
        );
        assert!(mean.abs() < 4.0 * sd / n.sqrt(), "{method} {}: {mean} {sd}", problem.name);
        // With a coverage of 95 % fewer than 16 of 20 have a probability of 0.3 %.
        assert!(inside >= 16, "{method} {}: {inside} of {SEEDS}", problem.name);
    }
}

#[test]
fn active_kriging_needs_few_calls() {
    for (problem, most, tolerance) in
        [(&FOUR_BRANCH, 100, 0.1), (&RP31, 200, 0.1), (&PLANE, 30, 0.1)]
    {
        let found = estimate("active_kriging", "", problem, 0);
        assert!(found.converged && found.calls <= most, "{} {found:?}", problem.name);
        let error = error(found.probability, problem);
        assert!(error.abs() < tolerance, "{} {error} {found:?}", problem.name);
    }
}

/// A weight turns standard normal variables into a posterior: with `w = exp(b u - b^2 / 2)` its mean is `b`.
struct Shifted {
    draws: Matrix,
}

const SHIFT: f64 = 0.7;

impl LimitState for Shifted {
    fn dimension(&self) -> usize {
        2
    }

    fn values(&self, points: &Matrix) -> Result<Vec<f64>, Stop> {
        Ok(points.iter_rows().map(|u| 3.7 - u[0]).collect())
    }

    fn is_standard_normal(&self) -> bool {
        false
    }

    fn log_weights(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|u| SHIFT * u[0]).collect()
    }

    fn draws(&self) -> Option<&Matrix> {
        Some(&self.draws)
    }
}

/// `P(u > 3.7)` with mean 0.7 is `Phi(-3)`.
#[test]
fn methods_work_from_a_posterior_or_refuse_it() {
    use lacuna::math::random::{Stream, normal};
    let mut rng = Stream::root(5).generator();
    let draws =
        Matrix::from_fn(20_000, 2, |_, j| normal(&mut rng) + if j == 0 { SHIFT } else { 0.0 });
    let state = Shifted { draws };
    let expected = 1.349_898_031_630_095e-3;
    for (method, seeds) in [("subset_simulation", 10), ("active_kriging", 1), ("monte_carlo", 1)] {
        let found: Vec<f64> =
            (0..seeds).map(|seed| estimate(method, "", &state, seed).probability).collect();
        let spread = estimate(method, "", &state, 0).variation.unwrap() / (seeds as f64).sqrt();
        let mean = found.iter().sum::<f64>() / seeds as f64;
        assert!((mean / expected - 1.0).abs() < 4.0 * spread, "{method} {mean} {spread}");
    }
    for method in ["form", "sorm", "importance_sampling"] {
        let plugin =
            lacuna::plugin::registry::from_text::<dyn lacuna::plugin::Reliability>(method, "");
        let progress = lacuna::run::Progress::new(&lacuna::run::Silent);
        let refused = plugin.unwrap().plugin.estimate(&state, &Stream::root(1), &progress);
        assert!(refused.unwrap_err().help.unwrap().contains("subset_simulation"));
    }
}
