//! Checks of bounds, modes, chains, priors, correlations.

use super::*;
use crate::assess::bounds::AtBound;
use crate::assess::chains::Chains;

/// Fraction of draws within half a standard deviation of zero, for a distribution of positive numbers.
fn share(seed: u64, law: impl Fn(f64, f64) -> f64) -> f64 {
    let mut rng = Stream::root(seed).named("draws").generator();
    let values: Vec<f64> = (0..4000).map(|_| law(normal(&mut rng), uniform(&mut rng))).collect();
    let mean = values.iter().sum::<f64>() / 4000.0;
    let sd = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4000.0).sqrt();
    values.iter().filter(|&&x| x < bounds::NEAR * sd).count() as f64 / 4000.0
}

fn at(name: &str, bound: f64, share: f64) -> AtBound {
    AtBound { name: name.to_owned(), bound, whose: "prior".to_owned(), share, natural: false }
}

/// The fractions are given in the documentation: 14 % for a flat density, 24 % for half a normal distribution, 39 % for
/// an exponential one.
#[test]
fn a_pile_at_a_bound_is_more_than_a_flat_density_has_there() {
    let flat = share(1, |_, u| u);
    let half = share(2, |z, _| z.abs());
    let pile = share(3, |_, u| -u.ln());
    // Three standard deviations of a fraction of 4000 draws are 0.023.
    for (found, exact) in [(flat, 0.144), (half, 0.237), (pile, 0.393)] {
        assert!((found - exact).abs() < 0.023, "{found} {exact}");
    }
    assert_eq!(bounds::at_bound(&[at("x", 2.0, flat)], 3), []);
    let found = bounds::at_bound(&[at("x", 2.0, pile)], 3);
    has(found.first(), "posterior_at_bound", Severity::Failure);
    // A bound that may be physical gives a reservation.
    let found = bounds::at_bound(&[at("x", 0.0, pile)], 3);
    has(found.first(), "posterior_at_bound", Severity::Reservation);
    let found = bounds::at_bound(&[at("x", 2.0, half)], 3);
    has(found.first(), "posterior_at_bound", Severity::Reservation);
    // Negative values of a scale are impossible.
    let scale = AtBound { natural: true, ..at("scale", 0.0, pile) };
    has(bounds::at_bound(&[scale], 3).first(), "posterior_at_bound", Severity::Note);
}

#[test]
fn eight_of_ten_parameters_at_bounds_are_a_failure_at_any_bound() {
    let all: Vec<AtBound> = (0..8).map(|i| at(&format!("x{i}"), 0.0, 0.3)).collect();
    let found = bounds::at_bound(&all, 10);
    assert_eq!(found.len(), 8);
    assert!(found.iter().all(|finding| finding.severity == Severity::Failure));
}

#[test]
fn modes_without_draws() {
    assert_eq!(modes::unvisited(&[], 2), None);
    let best = modes::unvisited(&[0.0], 2);
    has(best.as_ref(), "unvisited_mode", Severity::Failure);
    assert!(best.unwrap().message.contains("the global maximum is one of them"));
    has(modes::unvisited(&[0.7], 2).as_ref(), "unvisited_mode", Severity::Failure);
    has(modes::unvisited(&[4.0, 5.0], 3).as_ref(), "unvisited_mode", Severity::Reservation);
    assert_eq!(modes::unreached(0.1), None);
    has(modes::unreached(3.0).as_ref(), "map_not_found", Severity::Reservation);
}

#[test]
fn chains_that_cannot_be_trusted() {
    let chains = |r_hat, size, ensemble, converged| Chains {
        ensemble,
        converged,
        coordinates: vec![("x".to_owned(), r_hat, size)],
        allowed: if ensemble { (1.1, 400.0) } else { (1.01, 400.0) },
        advice: String::new(),
    };
    assert_eq!(chains::not_converged(&chains(1.005, 900.0, false, true)), None);
    has(
        chains::not_converged(&chains(1.015, 900.0, false, false)).as_ref(),
        "not_converged",
        Severity::Reservation,
    );
    let apart = chains::not_converged(&chains(1.8, 900.0, true, false)).unwrap();
    has(Some(&apart), "not_converged", Severity::Failure);
    assert!(apart.message.contains("walkers of one ensemble"), "{}", apart.message);
    has(
        chains::not_converged(&chains(1.0, 300.0, false, false)).as_ref(),
        "not_converged",
        Severity::Reservation,
    );
    has(
        chains::not_converged(&chains(1.0, 900.0, false, false)).as_ref(),
        "not_converged",
        Severity::Failure,
    );
    assert_eq!(chains::short("x", 2000, 10.0, 0.05), None);
    has(chains::short("x", 300, 10.0, 0.02).as_ref(), "short_chain", Severity::Note);
    has(chains::short("x", 300, 10.0, 0.1).as_ref(), "short_chain", Severity::Reservation);
    assert_eq!(chains::stranded(&[], 120), None);
    has(chains::stranded(&[18, 78], 120).as_ref(), "stranded_walkers", Severity::Reservation);
    let many: Vec<usize> = (0..40).collect();
    has(chains::stranded(&many, 120).as_ref(), "stranded_walkers", Severity::Failure);
}

/// A normal prior N(0, 1) and one datum with noise 0.5: the prior predictive sd is 1.118, the weight of the datum 0.8.
#[test]
fn a_prior_that_the_data_contradict() {
    let posterior = |y: f64| (0.8 * y, 0.2_f64.sqrt());
    assert_eq!(prior::conflict("x", (0.0, 1.0), posterior(2.0)), None);
    // Five standard deviations of 1.118: z is exactly that.
    let found = prior::conflict("x", (0.0, 1.0), posterior(5.6)).unwrap();
    assert!((found.figure.unwrap() - 5.6 / 1.25_f64.sqrt()).abs() < 1e-9);
    has(Some(&found), "prior_conflict", Severity::Failure);
    // Uninformative data cannot contradict the prior.
    assert_eq!(prior::conflict("x", (0.0, 1.0), (0.1, 0.999)), None);
}

/// Only the sum of two parameters is measured: the sum is determined, the difference keeps its prior.
#[test]
fn the_combination_that_is_determined_is_named() {
    let names = ["a", "b", "c"].map(str::to_owned);
    let known = 1e-4;
    let (same, cross) = (0.5 * (1.0 + known), 0.5 * (known - 1.0));
    let values = vec![same, cross, 0.0, cross, same, 0.0, 0.0, 0.0, 0.1];
    let found = correlation::correlated(&names, &Matrix::from_vec(3, 3, values)).unwrap();
    has(Some(&found), "correlated_parameters", Severity::Reservation);
    assert!(found.message.contains("`a` + `b` is 0.010"), "{}", found.message);
    assert!(found.message.contains("`a` - `b` is 1.00"), "{}", found.message);
    let apart = Matrix::from_vec(2, 2, vec![0.1, 0.05, 0.05, 0.1]);
    assert_eq!(correlation::correlated(&names[..2], &apart), None);
}
