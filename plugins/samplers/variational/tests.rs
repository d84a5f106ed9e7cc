//! The variational approximation against closed forms, and its own diagnostics.

use lacuna::math::moments::{Moments, mean, variance};

use super::*;
use crate::samplers::hamiltonian::laws::{
    Law, banana, bounded, complaints_about, conjugate, funnel, median_divergence, scale, scaled,
};

/// Runs the sampler from prior draws; returns the harvest and the number of evaluations before it.
fn reap(sampler: &Variational, target: &dyn Target, seed: u64) -> (Harvest, u64) {
    let root = Stream::root(seed);
    let points = target.prior_draws(sampler.paths, &root.named("start"));
    let mut state = sampler.start(target, points).unwrap();
    for step in 0..sampler.iterations {
        if sampler.finished(&state) {
            break;
        }
        sampler.step(target, &mut state, &root.named("step").at(step as u64)).unwrap();
    }
    let harvest = sampler.harvest(target, &state, &root.named("harvest")).unwrap().unwrap();
    (harvest, state.evaluations)
}

#[test]
fn it_keeps_the_contract_of_samplers() {
    for refine in [true, false] {
        let sampler = Variational { refine, ..Variational::default() };
        assert_eq!(lacuna_contract::sampler("variational", &sampler), Ok(()));
    }
}

#[test]
fn a_conjugate_normal_posterior_is_found() {
    let sampler = Variational::default();
    let median = median_divergence(|seed| reap(&sampler, &conjugate(), seed).0.points.column(0));
    assert!(median < 0.01, "{median}");
    // Closed form: the height of the density at its mean times the integral of a normal shape.
    let peak = conjugate().gradient(&[7.935_742_857_142_857]).0;
    let expected = peak + 0.5 * (2.0 * std::f64::consts::PI * 6.0 / 7.0).ln();
    let found = reap(&sampler, &conjugate(), 1).0.evidence.unwrap();
    assert!((found.log - expected).abs() < 1e-6, "{found:?} and {expected}");
}

#[test]
fn a_normal_law_of_any_scale_is_found_exactly() {
    let (harvest, evaluations) = reap(&Variational::default(), &scaled(), 1);
    // The weights of a normal density under itself are equal up to rounding.
    assert!(harvest.doubts.is_empty(), "{:?}", harvest.doubts);
    assert!(harvest.effective_size > 3999.0, "{}", harvest.effective_size);
    assert!(evaluations < 10_000, "{evaluations}");
    let moments = Moments::of_rows(&harvest.points);
    for j in 0..10 {
        let z = moments.mean()[j] / scale(j) - 10.0 * j as f64;
        assert!(z.abs() < 4.0 / 4000.0_f64.sqrt(), "{j}: {z}");
        let ratio = moments.sd()[j] / scale(j);
        assert!((ratio - 1.0).abs() < 4.0 / 8000.0_f64.sqrt(), "{j}: {ratio}");
    }
    // Closed form: (2 pi)^(d/2) times scales times the root of det = 0.36^9.
    let volume: f64 = (0..10).map(|j| scale(j).ln()).sum();
    let expected = 5.0 * (2.0 * std::f64::consts::PI).ln() + volume + 4.5 * 0.36_f64.ln();
    let evidence = harvest.evidence.unwrap();
    assert!((evidence.log - expected).abs() < 1e-6, "{evidence:?} and {expected}");
}

#[test]
fn unknowns_with_bounds_come_out_by_importance() {
    for seed in 3..8 {
        let doubts = reap(&Variational::default(), &bounded(), seed).0.doubts;
        assert!(doubts.is_empty(), "{seed}: {doubts:?}");
    }
    let (harvest, _) = reap(&Variational::default(), &bounded(), 2);
    let beta_variance = 1e4 * 10.0 / (49.0 * 8.0);
    for (j, centre, spread) in [(0, 1.5e-4, 7.5e-9), (1, 100.0 + 200.0 / 7.0, beta_variance)] {
        let values = harvest.points.column(j);
        let size = harvest.effective_size;
        assert!((mean(&values) - centre).abs() < 4.0 * (spread / size).sqrt(), "{j}");
        let squares: Vec<f64> = values.iter().map(|x| (x - centre).powi(2)).collect();
        let error = (variance(&squares) / size).sqrt();
        assert!((mean(&squares) - spread).abs() < 4.0 * error, "{j}: {} {spread}", mean(&squares));
    }
    // The integrals of both densities: Gamma(3) / rate^3, and 100^6 B(2, 5) = 100^6 / 30.
    let expected = (2.0 / 8e12_f64).ln() + 6.0 * 100.0_f64.ln() - 30.0_f64.ln();
    let evidence = harvest.evidence.unwrap();
    let off = (evidence.log - expected).abs();
    assert!(off < 4.0 * evidence.error && evidence.error < 0.02, "{evidence:?} and {expected}");
}

#[test]
fn a_law_that_is_not_normal_is_told() {
    // Cauchy densities in three independent coordinates, each of which integrates to pi.
    let cauchy = Law::free(vec![[0.0, 1.0]; 3], |x: &[f64]| {
        let value = -x.iter().map(|x| (x * x).ln_1p()).sum::<f64>();
        (value, x.iter().map(|x| -2.0 * x / (1.0 + x * x)).collect())
    });
    let plain = Variational { importance: false, ..Variational::default() };
    let (harvest, _) = reap(&plain, &cauchy, 3);
    assert!(harvest.doubts.iter().any(|d| d.contains("k-hat")), "{:?}", harvest.facts);
    assert!(harvest.evidence.is_none());
    // Student's t distributions have tails heavy enough for it.
    let (harvest, _) = reap(&Variational::default(), &cauchy, 3);
    assert!(harvest.facts[1].value.contains("Student"), "{:?}", harvest.facts);
    let evidence = harvest.evidence.unwrap();
    let expected = 3.0 * std::f64::consts::PI.ln();
    assert!((evidence.log - expected).abs() < 4.0 * evidence.error, "{evidence:?}");
    // The loss of accuracy on a curved ridge and in a funnel is reported.
    for harvest in [
        reap(&Variational::default(), &banana(), 3).0,
        reap(&Variational::default(), &funnel(), 3).0,
    ] {
        assert!(harvest.effective_size < 1500.0, "{:?}", harvest.facts);
    }
}

#[test]
fn separate_maxima_and_unfinished_paths_are_told() {
    // Two normal densities of weights 0.9 and 0.1, twenty standard deviations apart.
    let law = Law::free(vec![[0.0, 10.0]], |x: &[f64]| {
        let (a, b) = (x[0] + 10.0, x[0] - 10.0);
        let (p, q) = (0.9 * (-0.5 * a * a).exp(), 0.1 * (-0.5 * b * b).exp());
        (
            (p + q).max(f64::MIN_POSITIVE).ln(),
            vec![-(a * p + b * q) / (p + q).max(f64::MIN_POSITIVE)],
        )
    });
    let sampler = Variational { paths: 10, ..Variational::default() };
    let (harvest, _) = reap(&sampler, &law, 4);
    assert!(harvest.doubts.iter().any(|d| d.contains("several maxima")), "{:?}", harvest.doubts);
    // Both are in the mixture, so that the weights give each its mass.
    let share = harvest.points.column(0).iter().filter(|x| **x > 0.0).count() as f64 / 4000.0;
    assert!((share - 0.1).abs() < 0.02, "{share}");
    let short = Variational { iterations: 1, ..Variational::default() };
    let (harvest, _) = reap(&short, &banana(), 5);
    assert!(harvest.doubts.iter().any(|d| d.contains("raise `iterations`")));
}

#[test]
fn options_that_make_no_sense_are_refused() {
    for (text, expected) in [
        ("paths = 0", "too few paths"),
        ("iterations = 0", "too few iterations"),
        ("draws = 10", "at least 100"),
    ] {
        let found = complaints_about::<Variational>(text);
        assert!(found.contains(expected), "{text}: {found}");
    }
    assert_eq!(complaints_about::<Variational>("refine = false"), "");
}

/// A density that is known to few digits, and whose values with derivatives have another error than those without, as of an
/// equation that is integrated numerically.
struct Rounded<T>(T);

impl<T: Target> Target for Rounded<T> {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let off = |x: &[f64]| 1e-4 * (1e6 * x[0]).sin();
        self.0
            .log_density(points)
            .into_iter()
            .zip(points.iter_rows())
            .map(|(l, x)| l + off(x))
            .collect()
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        self.0.log_prior(points)
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let (value, slopes) = self.0.gradient(point);
        (value - 0.2, slopes)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.0.bounds()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.0.prior_draws(count, stream)
    }
}

#[test]
fn paths_end_where_only_numerical_errors_are_left() {
    let sampler = Variational::default();
    let (harvest, evaluations) = reap(&sampler, &Rounded(bounded()), 2);
    let exact = reap(&sampler, &bounded(), 2).1;
    assert!(harvest.doubts.is_empty(), "{:?}", harvest.doubts);
    assert!(evaluations < 2 * exact, "{evaluations}, and {exact} without errors");
}
