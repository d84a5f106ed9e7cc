//! The posterior with a gain, compared with a computation by hand.

use std::f64::consts::PI;

use lacuna::data::{Axis, Layout, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::effect::{On, Placed};
use lacuna::plugin::{Discrepancy, Effect, Forward, Likelihood, Target, registry};
use lacuna_engine::posterior::{OfData, Posterior};
use lacuna_linalg::Matrix;

/// `y(t) = a t + b t^2` at the times 1, 2 and 3.
#[derive(Default)]
struct Quadratic;

const TIMES: [f64; 3] = [1.0, 2.0, 3.0];

fn quadratic(a: f64, b: f64) -> [f64; 3] {
    TIMES.map(|t| a * t + b * t * t)
}

impl Forward for Quadratic {
    fn dimension(&self) -> usize {
        2
    }

    fn outputs(&self) -> usize {
        3
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        Matrix::from_rows(3, points.iter_rows().map(|p| quadratic(p[0], p[1])))
    }

    fn jacobian(&self, _: &[f64]) -> Matrix {
        Matrix::from_fn(3, 2, |i, j| TIMES[i].powi(j as i32 + 1))
    }
}

fn layout() -> Layout {
    let seconds = Unit::parse("s").unwrap();
    let axes = vec![Axis::grid("time", TIMES.to_vec(), seconds)];
    Layout { name: "y".into(), unit: Unit::dimensionless(), axes }
}

/// Two replicates; the second has no value at the last time.
const DATA: [[Option<f64>; 3]; 2] =
    [[Some(1.9), Some(5.2), Some(11.0)], [Some(2.1), Some(4.9), None]];

fn parameters() -> Vec<Parameter> {
    let parameter = |name: &str, prior: Distribution| Parameter {
        name: name.into(),
        symbol: name.into(),
        unit: Unit::dimensionless(),
        design: Distribution::Uniform([-10.0, 10.0]),
        prior,
        reference: None,
    };
    vec![
        parameter("a", Distribution::Uniform([-2.0, 3.0])),
        parameter("b", Distribution::Normal([1.0, 0.5])),
    ]
}

/// Runs a test on a posterior with the gain over `y = a t + b t^2`.
fn with_posterior(test: impl FnOnce(&Posterior<'_>)) {
    let effect =
        registry::from_text::<dyn Effect>("gain", "factor = { normal = [1, 0.1] }").unwrap().plugin;
    let options = "variance = { half_normal = 0.5 }";
    let discrepancy = registry::from_text::<dyn Discrepancy>("gaussian", options).unwrap().plugin;
    let replicates =
        DATA.iter().enumerate().map(|(r, values)| Replicate::new(format!("p{r}"), values.to_vec()));
    let data = Measurements::new(layout(), replicates.collect());
    let likelihood: Box<dyn Likelihood> =
        discrepancy.likelihood(&Known::without_slopes(&data, &[])).unwrap();
    let (layout, parameters, emulator) = (layout(), parameters(), Quadratic);
    let layouts = layout.into();
    let effects = vec![Placed::new("gain", &*effect, &layouts, &On::new())];
    test(&Posterior::new(&parameters, OfData::new(&emulator, effects, &*likelihood)));
}

fn log_normal_density(x: f64, mean: f64, sd: f64) -> f64 {
    -0.5 * ((x - mean) / sd).powi(2) - (sd * (2.0 * PI).sqrt()).ln()
}

/// Log density of `a`, `b`, the gain and the logarithm of the variance, written out.
fn by_hand([a, b, gain, log_variance]: [f64; 4]) -> f64 {
    let variance = log_variance.exp();
    let prior = -(5.0_f64).ln()
        + log_normal_density(b, 1.0, 0.5)
        + log_normal_density(gain, 1.0, 0.1)
        + std::f64::consts::LN_2
        + log_normal_density(variance, 0.0, 0.5);
    let response = quadratic(a, b).map(|y| gain * y);
    let likelihood: f64 = DATA
        .iter()
        .flat_map(|values| values.iter().zip(response))
        .filter_map(|(value, mean)| Some(log_normal_density((*value)?, mean, variance.sqrt())))
        .sum();
    // The density of log v is that of v times v.
    prior + likelihood + log_variance
}

const POINTS: [[f64; 4]; 4] =
    [[1.0, 1.0, 1.0, -2.0], [0.4, 1.3, 0.93, -4.0], [-1.5, 0.2, 1.2, 0.3], [2.9, 1.9, 0.7, -1.0]];

#[test]
fn the_posterior_with_an_effect_is_the_one_computed_by_hand() {
    with_posterior(|posterior| {
        let names: Vec<&str> =
            posterior.hyperparameters().iter().map(|h| h.name.as_str()).collect();
        assert_eq!(names, ["gain.factor", "variance"]);
        let found = posterior.log_density(&Matrix::from_rows(4, POINTS));
        for (point, found) in POINTS.into_iter().zip(found) {
            let expected = by_hand(point);
            assert!((found - expected).abs() < 1e-11 * expected.abs(), "{found} {expected}");
            // Without the Jacobian the mode is that of the density in natural units.
            let mode = posterior.mode().log_density(&Matrix::from_rows(4, [point]))[0];
            assert!((mode - (expected - point[3])).abs() < 1e-11 * expected.abs());
        }
        let outside = posterior.log_density(&Matrix::from_rows(4, [[3.1, 1.0, 1.0, -2.0]]));
        assert_eq!(outside, [f64::NEG_INFINITY]);
    });
}

/// Central differences of step h have an error of the order of h^2 times the third derivative.
#[test]
fn the_gradient_with_an_effect_is_that_of_differences() {
    with_posterior(|posterior| {
        for point in POINTS {
            let (value, gradient) = posterior.gradient(&point);
            assert!((value - by_hand(point)).abs() < 1e-11 * value.abs());
            for j in 0..4 {
                let moved = |by: f64| {
                    let mut point = point;
                    point[j] += by;
                    by_hand(point)
                };
                let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                let tolerance = 1e-6 * (1.0 + slope.abs());
                assert!((gradient[j] - slope).abs() < tolerance, "{j}: {} {slope}", gradient[j]);
            }
        }
    });
}

#[test]
fn without_the_effect_the_posterior_is_that_of_a_gain_of_one_less_its_prior() {
    let point = [0.4, 1.3, 1.0, -4.0];
    let expected = by_hand(point) - log_normal_density(1.0, 1.0, 0.1);
    with_posterior(|posterior| {
        let with = posterior.log_density(&Matrix::from_rows(4, [point]))[0];
        assert!((with - log_normal_density(1.0, 1.0, 0.1) - expected).abs() < 1e-10);
        assert_eq!(posterior.natural(&point), [0.4, 1.3, 1.0, (-4.0_f64).exp()]);
    });
}
