//! Served functions compared with closed forms.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::{Fact, Hyperparameter};
use lacuna_linalg::Matrix;

use super::*;
use crate::posterior::LogLikelihood;

/// `x² y` and `1e3 y³`, for `y` up to one.
struct Powers;

impl Derivatives for Powers {
    fn jacobian(&self, point: &[f64], _: Option<usize>) -> Result<Matrix, EvalError> {
        let &[x, y] = point else { panic!("two variables") };
        if y > 1.0 {
            return Err(EvalError::Rejected("`y` is above 1".to_owned()));
        }
        Ok(Matrix::from_rows(2, [[2.0 * x * y, x * x], [0.0, 3e3 * y * y]]))
    }
    fn scales(&self) -> Option<Vec<f64>> {
        Some(vec![10.0, 1.0])
    }
}

#[test]
fn differences_of_gradients_are_second_derivatives() {
    // At the edge the differences are one-sided.
    for (x, y) in [(3.0, 0.5), (3.0, 1.0), (-4.0, 1.0)] {
        for (weights, v) in [([1.0, 1.0], [1.0, 0.0]), ([2.0, -1.0], [-3.0, 5.0])] {
            let hessian = |i: usize| match i {
                0 => weights[0] * (2.0 * y * v[0] + 2.0 * x * v[1]),
                _ => weights[0] * 2.0 * x * v[0] + weights[1] * 6e3 * y * v[1],
            };
            let found = curvature(&Powers, &[x, y], None, &weights, &v).unwrap().unwrap();
            for (i, found) in found.into_iter().enumerate() {
                let expected = hessian(i);
                assert!(
                    (found - expected).abs() < 1e-8 * expected.abs().max(1.0),
                    "{found} {expected}"
                );
            }
        }
    }
    let nowhere = curvature(&Powers, &[1.0, 2.0], None, &[1.0, 1.0], &[0.0, 1.0]).unwrap();
    assert_eq!(nowhere, Err(EvalError::Rejected("`y` is above 1".to_owned())));
    let still = curvature(&Powers, &[1.0, 1.0], None, &[1.0, 1.0], &[0.0, 0.0]);
    assert_eq!(still, Some(Ok(vec![0.0; 2])));
}

/// One datum `2` from a normal distribution with mean `a` and a variance that is a hyperparameter.
struct OneDatum(Vec<Hyperparameter>);

impl LogLikelihood for OneDatum {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.0
    }
    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let each = theta.iter_rows().zip(hyper.iter_rows());
        each.map(|(a, v)| -0.5 * (2.0 - a[0]).powi(2) / v[0] - 0.5 * v[0].ln()).collect()
    }
    fn value_and_gradient(&self, theta: &[f64], hyper: &[f64]) -> (f64, Vec<f64>) {
        let (r, v) = (2.0 - theta[0], hyper[0]);
        (-0.5 * r * r / v - 0.5 * v.ln(), vec![r / v, 0.5 * r * r / (v * v) - 0.5 / v])
    }
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}

#[test]
fn the_posterior_is_that_of_natural_values() {
    let parameters = [Parameter {
        name: "a".to_owned(),
        symbol: "a".to_owned(),
        unit: Unit::parse("m").unwrap(),
        design: Distribution::Uniform([0.0, 4.0]),
        prior: Distribution::Uniform([0.0, 4.0]),
        reference: None,
    }];
    let variance = Hyperparameter {
        name: "variance".to_owned(),
        symbol: "v".to_owned(),
        unit: Unit::parse("m2").unwrap(),
        prior: Distribution::Uniform([0.0, 5.0]),
        log: true,
        start: 1.0,
    };
    let posterior = LogPosterior::of(Posterior::new(&parameters[..], OneDatum(vec![variance])));
    let names: Vec<String> = posterior.variables().into_iter().map(|v| v.name).collect();
    assert_eq!(names, ["a", "variance"]);
    // Uniform priors with densities 1/4 and 1/5.
    let (a, v): (f64, f64) = (1.5, 0.3);
    let expected = -0.5 * 0.25 / v - 0.5 * v.ln() - 20_f64.ln();
    let found = posterior.values(&[a, v], None).unwrap()[0];
    assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    let gradient = posterior.derivatives().unwrap().jacobian(&[a, v], None).unwrap();
    let expected = [0.5 / v, 0.125 / (v * v) - 0.5 / v];
    for (found, expected) in gradient.row(0).iter().zip(expected) {
        assert!((found - expected).abs() < 1e-13 * expected.abs(), "{found} {expected}");
    }
    for outside in [[-1.0, v], [a, -v], [a, 6.0], [a, 0.0]] {
        assert_eq!(posterior.values(&outside, None).unwrap(), [f64::MIN], "{outside:?}");
        assert!(posterior.derivatives().unwrap().jacobian(&outside, None).is_err());
    }
}

/// A function that returns a value everywhere, although its plugin has a fault.
struct One;

impl Function for One {
    fn name(&self) -> &'static str {
        "model"
    }
    fn variables(&self) -> Vec<Variable> {
        Vec::new()
    }
    fn outputs(&self) -> usize {
        1
    }
    fn values(&self, _: &[f64], _: Option<usize>) -> Result<Vec<f64>, EvalError> {
        Ok(vec![1.0])
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(&Powers)
    }
}

#[test]
fn a_function_answers_no_more_once_a_plugin_has_a_fault() {
    let faults = ["one", "other"].map(|who| std::sync::Arc::new(lacuna::run::Fault::new(who)));
    let watched = Watched::new(&One, &faults);
    assert_eq!(watched.values(&[], None), Ok(vec![1.0]));
    assert!(watched.derivatives().unwrap().jacobian(&[1.0, 0.5], None).is_ok());
    faults[1].report("gives no number");
    let said = Err(EvalError::Fatal("other: gives no number".to_owned()));
    assert_eq!(watched.values(&[], None), said);
    let jacobian = watched.derivatives().unwrap().jacobian(&[1.0, 0.5], None);
    assert_eq!(jacobian.map(|_| vec![]), said);
}
