//! Rules against exact integrals.
#![allow(clippy::unwrap_used)]

use super::*;

fn axes(level: usize, d: usize) -> Vec<Recurrence> {
    let all = [Recurrence::legendre(level + 1), Recurrence::hermite(level + 1)];
    (0..d).map(|i| all[i % 2].clone()).collect()
}

/// Returns `E z^n` of the uniform distribution on (-1, 1) and of the standard normal distribution.
fn moment(axis: usize, n: u32) -> f64 {
    match (n % 2, axis % 2) {
        (1, _) => 0.0,
        (_, 0) => 1.0 / f64::from(n + 1),
        _ => (1..n).step_by(2).map(f64::from).product(),
    }
}

#[test]
fn rules_are_exact_to_twice_their_level_and_one() {
    for rule in [Rule::Tensor, Rule::Smolyak] {
        for (d, level) in [(1, 4), (2, 3), (3, 3), (4, 2)] {
            let nodes = rule.nodes(&axes(level, d), level, 10_000).unwrap();
            let all =
                crate::surrogates::polynomial_chaos::Truncation { q_norm: 1.0, max_interaction: d };
            let powers =
                crate::surrogates::polynomial_chaos::Nested::new(d, 2 * level + 1, all, 100_000);
            for t in 0..powers.terms.len() {
                let exponents = powers.terms.term(t);
                let value = |z: &[f64]| -> f64 {
                    z.iter().zip(exponents).map(|(z, &n)| z.powi(i32::from(n))).product()
                };
                let sum: f64 =
                    nodes.points.iter_rows().zip(&nodes.weights).map(|(z, w)| w * value(z)).sum();
                let expected: f64 =
                    exponents.iter().enumerate().map(|(i, &n)| moment(i, u32::from(n))).product();
                assert!(
                    (sum - expected).abs() < 1e-10 * expected.max(1.0),
                    "{rule:?} {exponents:?}"
                );
            }
        }
    }
}

#[test]
fn smolyak_needs_fewer_nodes_than_the_tensor_rule() {
    let count =
        |rule: Rule, d, level| rule.nodes(&axes(level, d), level, 100_000).unwrap().weights.len();
    assert_eq!(count(Rule::Tensor, 3, 3), 64);
    assert_eq!(count(Rule::Smolyak, 1, 5), 6);
    assert!(count(Rule::Smolyak, 6, 3) < count(Rule::Tensor, 6, 3) / 5);
    assert!(Rule::Tensor.nodes(&axes(3, 3), 3, 63).is_none());
    assert!(Rule::Smolyak.nodes(&axes(20, 10), 20, 5000).is_none());
}

#[test]
fn the_largest_rule_that_fits_comes_first_and_random_points_after_it() {
    let points = Quadrature::default().points(30, 3, &Stream::root(1)).unwrap();
    let middle: Vec<&[f64]> = points.iter_rows().filter(|p| *p == [0.5; 3]).collect();
    assert_eq!((points.rows(), middle.len()), (30, 1));
    let longer = Quadrature::default().points(33, 3, &Stream::root(1)).unwrap();
    assert!((0..30).all(|i| points.row(i) == longer.row(i)));
    let fixed = Quadrature { level: Some(3), ..Quadrature::default() };
    let stop = fixed.points(50, 3, &Stream::root(1)).unwrap_err();
    assert_eq!(stop.message, "the tensor rule of level 3 has 64 nodes, but the design has 50 runs");
}
