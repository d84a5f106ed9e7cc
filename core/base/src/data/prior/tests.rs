use super::*;
use crate::math::dependence::Correlation;

fn parameters(prior: &Distribution, count: usize) -> Vec<Parameter> {
    (0..count).map(|j| Parameter::plain(&format!("x{j}"), prior.clone())).collect()
}

fn within(dependence: &mut Dependence, parameters: &[Parameter], seed: u64) -> Share {
    let share = JointPrior::new(parameters, dependence).share(&Stream::root(seed)).unwrap();
    dependence.share = Some(share);
    share
}

/// Independent priors have the density and the draws of their product, to the last bit.
#[test]
fn independent_parameters_have_the_product_of_their_priors() {
    let own = [Distribution::Normal([1.0, 2.0]), Distribution::LogUniform([1.0, 9.0])];
    let all: Vec<Parameter> = own.iter().map(|law| Parameter::plain("a", law.clone())).collect();
    let prior = JointPrior::from(&all);
    let draw = prior.sample(&mut Stream::root(3).generator());
    let mut rng = Stream::root(3).generator();
    let expected: Vec<f64> = own.iter().map(|law| law.sample(&mut rng)).collect();
    assert_eq!(draw, expected);
    let sum: f64 = own.iter().zip(&draw).map(|(law, &x)| law.log_density(x)).sum();
    assert_eq!(prior.log_density(&draw).to_bits(), sum.to_bits());
}

/// In order, `n` uniform numbers have the probability 1 / n!.
#[test]
fn ordered_numbers_have_the_probability_of_one_order() {
    let all = parameters(&Distribution::Uniform([0.0, 2.0]), 4);
    let ordered = |x: &[f64]| x.windows(2).all(|pair| pair[0] < pair[1]);
    let constraints = vec![Constraint::new("x0 < x1 and x1 < x2 and x2 < x3", ordered)];
    let mut dependence = Dependence { constraints, ..Dependence::default() };
    let share = within(&mut dependence, &all, 1);
    let difference = share.log() - (1.0_f64 / 24.0).ln();
    assert!(difference.abs() < 4.0 * share.log_error(), "{difference} ± {}", share.log_error());
    let prior = JointPrior::new(&all, &dependence);
    let density = prior.log_density(&[0.1, 0.5, 0.6, 1.9]);
    assert!((density - (24.0_f64 / 16.0).ln()).abs() < 4.0 * share.log_error());
    assert_eq!(prior.log_density(&[0.1, 0.6, 0.5, 1.9]), f64::NEG_INFINITY);
    let mut rng = Stream::root(2).generator();
    assert!((0..100).all(|_| ordered(&prior.sample(&mut rng))));
}

/// The probability of the positive quadrant is 1/4 + asin(rho) / (2 pi) (Sheppard 1899).
#[test]
fn a_quadrant_of_correlated_normal_numbers_has_the_closed_form() {
    for rho in [0.6, -0.8] {
        let all = parameters(&Distribution::Normal([0.0, 3.0]), 2);
        let copula = Copula::Gaussian(Correlation::of_two(rho).unwrap());
        let mut dependence = Dependence {
            groups: vec![Group { members: vec![0, 1], copula }],
            constraints: vec![Constraint::new("x0 > 0 and x1 > 0", |x| x[0] > 0.0 && x[1] > 0.0)],
            populations: Vec::new(),
            share: None,
        };
        let share = within(&mut dependence, &all, 7);
        let expected = 0.25 + f64::asin(rho) / std::f64::consts::TAU;
        let difference = share.log() - expected.ln();
        assert!(difference.abs() < 4.0 * share.log_error(), "{difference}");
    }
}

#[test]
fn gradient_is_that_of_the_joint_density() {
    let all = parameters(&Distribution::Gamma([3.0, 1.0]), 3);
    let copula = Copula::Gaussian(Correlation::of_two(0.7).unwrap());
    let groups = vec![Group { members: vec![2, 0], copula }];
    let dependence = Dependence { groups, ..Dependence::default() };
    let prior = JointPrior::new(&all, &dependence);
    let point = [2.0, 1.0, 4.0];
    let mut gradient = vec![0.0; 3];
    prior.add_joint_gradient(&point, &mut gradient);
    for j in 0..3 {
        let at = |by: f64| {
            let mut moved = point;
            moved[j] += by;
            prior.joint(&moved)
        };
        let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
        assert!((gradient[j] - difference).abs() < 1e-7, "{j}: {} {difference}", gradient[j]);
    }
    assert_eq!(gradient[1], 0.0);
}
