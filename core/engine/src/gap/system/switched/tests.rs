//! `y = (1 + g) (a t + e t^2 + f t^3)`: a parameter, two inputs and an effect on the response, in any order.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layouts, Measurements, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Forward;
use lacuna::plugin::effect::On;
use lacuna_linalg::Matrix;
use toml::Table;

use super::*;
use crate::gap::experiment::Experiment;
use crate::gap::experiment::wider::ExtendedMap;

const TIMES: usize = 4;

/// `a t`, or with inputs `a t + e t^2 + f t^3`.
struct Powers(usize);

impl Forward for Powers {
    fn dimension(&self) -> usize {
        self.0
    }
    fn outputs(&self) -> usize {
        TIMES
    }
    fn mean(&self, points: &Matrix) -> Matrix {
        let slopes = self.jacobian(&[]);
        Matrix::from_fn(points.rows(), TIMES, |i, k| {
            (0..self.0).map(|j| points[(i, j)] * slopes[(k, j)]).sum()
        })
    }
    fn jacobian(&self, _: &[f64]) -> Matrix {
        Matrix::from_fn(TIMES, self.0, |k, j| (k as f64).powi(j as i32 + 1))
    }
}

/// `(1 + g) y`.
struct Gain;

impl Component for Gain {}

impl Effect for Gain {
    fn describe(&self) -> Description {
        Description { title: "gain".into(), formula: String::new(), source: String::new() }
    }
    fn parameters(&self, _: &Layout) -> Vec<Hyperparameter> {
        vec![Hyperparameter {
            name: "g".into(),
            symbol: "g".into(),
            unit: Unit::dimensionless(),
            prior: Distribution::Normal([0.0, 1.0]),
            log: false,
            start: 0.0,
        }]
    }
    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }
    fn apply(&self, _: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        response.iter().map(|y| (1.0 + values[0]) * y).collect()
    }
    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        vec![vec![0.1]]
    }
    fn proposals(&self, _: &Situation<'_>) -> Vec<Table> {
        Vec::new()
    }
}

fn switched(places: &[usize], inputs: &[FreeInput]) -> InputEffect {
    let description = Gain.describe();
    let inputs = places.iter().map(|&i| inputs[i].clone()).collect();
    InputEffect { places: places.to_vec(), inputs, description }
}

fn inputs() -> Vec<FreeInput> {
    let freed =
        |name| FreeInput::new(name, Unit::dimensionless(), 0.0, Distribution::HalfNormal(1.0));
    vec![freed("e"), freed("f")]
}

fn layouts() -> Layouts {
    let axes = vec![Axis::grid("t", (0..TIMES).map(|t| t as f64).collect(), Unit::default())];
    Layout { name: "y".into(), unit: Unit::dimensionless(), axes }.into()
}

#[test]
fn unknowns_stand_in_the_order_of_the_effects() {
    let layouts = layouts();
    let parameters = [Parameter::plain("a", Distribution::Normal([0.0, 1.0]))];
    let measured = Measurements::new(layouts.blocks[0].clone(), Vec::new());
    let measured = measured.into();
    let base = Powers(1);
    let wide = ExtendedMap { forward: Box::new(Powers(3)), inputs: inputs(), common: Vec::new() };
    let mut experiment = Experiment::new(&layouts, &parameters, &base, &measured);
    experiment.wide = Some(&wide);
    let (first, second) = (switched(&[1], &wide.inputs), switched(&[0], &wide.inputs));
    let placed = |name: &str, effect| Placed::new(name, effect, &layouts, &On::new());
    let effects = vec![placed("cubic", &first), placed("gain", &Gain), placed("square", &second)];
    let system = System::new(&experiment, effects);
    let [a, f, g, e] = [2.0, 0.5, 0.25, -0.125];
    let at = system.linearised(&[a, f, g, e]);
    let names: Vec<String> =
        system.effects.iter().flat_map(Placed::hyperparameters).map(|h| h.name).collect();
    assert_eq!(names, ["f", "gain.g", "e"]);
    for k in 0..TIMES {
        let t = k as f64;
        let plain = a * t + e * t * t + f * t * t * t;
        assert_eq!(at.response[k], (1.0 + g) * plain);
        let gradient = [t, t * t * t, plain, t * t];
        for (j, exact) in gradient.into_iter().enumerate() {
            let exact = if j == 2 { exact } else { (1.0 + g) * exact };
            // The gain's own derivative is a difference.
            assert!((at.tangents[(j, k)] - exact).abs() < 1e-7, "{j} {k}");
        }
    }
    assert_eq!(
        system.response(&[a, 0.0, 0.0, 0.0]),
        base.mean(&Matrix::from_rows(1, [[a]])).row(0)
    );
}

#[test]
fn effects_of_the_study_stand_before_the_inputs() {
    let layouts = layouts();
    let wide = ExtendedMap { forward: Box::new(Powers(3)), inputs: inputs(), common: Vec::new() };
    let gain = Placed::new("gain", &Gain, &layouts, &On::new());
    let both = wide.with_effects(vec![gain]);
    let [a, g, e, f] = [2.0, 0.25, -0.125, 0.5];
    let (mean, jacobian) = both.forward.mean_and_jacobian(&[a, g, e, f]);
    assert_eq!(both.forward.mean(&Matrix::from_rows(4, [[a, g, e, f]])).row(0), mean);
    for k in 0..TIMES {
        let t = k as f64;
        let plain = a * t + e * t * t + f * t * t * t;
        assert_eq!(mean[k], (1.0 + g) * plain);
        let exact = [(1.0 + g) * t, plain, (1.0 + g) * t * t, (1.0 + g) * t * t * t];
        for (j, exact) in exact.into_iter().enumerate() {
            assert!((jacobian[(k, j)] - exact).abs() < 1e-7, "{j} {k}");
        }
    }
}

#[test]
fn starts_lie_on_the_sides_that_the_prior_has() {
    let freed = |prior| FreeInput::new("e", Unit::dimensionless(), 0.0, prior).starts;
    let one = freed(Distribution::HalfNormal(2.0));
    assert!(one.len() == 3 && one.iter().all(|x| *x > 0.0), "{one:?}");
    let both = freed(Distribution::Normal([0.0, 2.0]));
    assert_eq!(both.iter().filter(|x| **x < 0.0).count(), 3, "{both:?}");
}
