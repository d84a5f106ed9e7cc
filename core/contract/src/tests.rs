//! Each suite detects planted faults and names them.

use lacuna::data::{Layout, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna::matrix::Matrix;
use lacuna::plugin::density::BoundDensity;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Density, Design, Effect, Hyperparameter};
use lacuna::run::Stop;

use super::*;

#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    Shape,
    Edge,
    Hidden,
    Panics,
    OffCentre,
}

struct Points(Fault, std::sync::atomic::AtomicU64);

impl Component for Points {}

impl Design for Points {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        assert!(self.0 != Fault::Panics || count > 0, "a planted panic");
        let calls = self.1.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let stream = if self.0 == Fault::Hidden { stream.at(calls) } else { stream.clone() };
        let mut rng = stream.generator();
        let count = if self.0 == Fault::Shape { count + 1 } else { count };
        Ok(Matrix::from_fn(count, dimension, |_, _| match self.0 {
            Fault::Edge => uniform(&mut rng).round(),
            Fault::OffCentre => uniform(&mut rng).powi(2),
            _ => uniform(&mut rng),
        }))
    }
}

#[test]
fn faults_of_designs_are_found() {
    for (fault, expected) in [
        (Fault::Shape, "asked for 1 x 1, got 2 x 1"),
        (Fault::Edge, "a coordinate of"),
        (Fault::Hidden, "the same stream gives other points"),
        (Fault::Panics, "a design of 0 points of 3 coordinates makes it panic"),
        (Fault::OffCentre, "the mean of coordinate 1"),
    ] {
        let breaches = design("points", &Points(fault, 0.into())).unwrap_err();
        assert!(breaches.iter().any(|b| b.contains(expected)), "{expected}: {breaches:?}");
        assert!(breaches[0].starts_with("design `points`, "));
    }
    assert_eq!(design("points", &Points(Fault::None, 0.into())), Ok(()));
}

/// `y + shift`, with the selected fault.
struct Shift(Fault);

impl Component for Shift {}

impl Effect for Shift {
    fn describe(&self) -> Description {
        let text = |text: &str| text.to_owned();
        Description { title: text("shift"), formula: text("y + s"), source: text("a test") }
    }
    fn parameters(&self, _: &Layout) -> Vec<Hyperparameter> {
        vec![Hyperparameter {
            name: "shift".into(),
            symbol: "s".into(),
            unit: Unit::dimensionless(),
            prior: Distribution::Normal([0.0, 1e-4]),
            log: false,
            start: 0.0,
        }]
    }
    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![if self.0 == Fault::OffCentre { 1e-4 } else { 0.0 }]
    }
    fn apply(&self, _: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let skip = usize::from(self.0 == Fault::Shape);
        response.iter().skip(skip).map(|y| y + values[0]).collect()
    }
    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], v: &[f64]) -> Vec<f64> {
        let scale = if self.0 == Fault::Edge { 2.0 } else { 1.0 };
        v.iter().map(|v| scale * v).collect()
    }
    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        vec![vec![1e-4], vec![-1e-4]]
    }
    fn proposals(&self, _: &Situation<'_>) -> Vec<toml::Table> {
        vec![toml::Table::new()]
    }
}

#[test]
fn faults_of_effects_are_found() {
    for (fault, expected) in [
        (Fault::Shape, "10 values become 9"),
        (Fault::Edge, "the derivative along a direction of value 1"),
        (Fault::OffCentre, "it changes the response"),
    ] {
        let breaches = effect("shift", &Shift(fault)).unwrap_err();
        assert!(breaches.iter().any(|b| b.contains(expected)), "{expected}: {breaches:?}");
    }
    assert_eq!(effect("shift", &Shift(Fault::None)), Ok(()));
}

/// A half-normal distribution beside a normal one, with the selected fault.
#[derive(Clone, Copy)]
struct Law(Fault);

impl Component for Law {}

impl Density for Law {
    fn bind(&self, parameters: &[Parameter]) -> Result<Box<dyn BoundDensity>, Stop> {
        assert_eq!(parameters.len(), 2);
        Ok(Box::new(*self))
    }
}

impl BoundDensity for Law {
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let neighbours = if self.0 == Fault::Hidden { points.rows() as f64 } else { 0.0 };
        points.iter_rows().map(|point| self.gradient(point).0 + neighbours).collect()
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        assert!(self.0 != Fault::Panics || point[0] >= 0.0, "a planted panic");
        let scale = if self.0 == Fault::OffCentre { 1.01 } else { 1.0 };
        let value = -0.5 * (point[0] * point[0] + point[1] * point[1]);
        let outside = point[0] < 0.0;
        if outside || (value.is_nan() && self.0 != Fault::Edge) || value.is_infinite() {
            return (f64::NEG_INFINITY, vec![0.0; 2]);
        }
        (value, vec![-point[0], -point[1] * scale])
    }
}

#[test]
fn faults_of_targets_are_found() {
    let parameters = [
        Parameter::plain("a", Distribution::Normal([0.0, 1.0])),
        Parameter::plain("b", Distribution::Uniform([-1.0, 1.0])),
    ];
    for (fault, expected) in [
        (Fault::Edge, "it is NaN for `a` = NaN"),
        (Fault::Hidden, "a point alone has"),
        (Fault::Panics, "makes it panic"),
        (Fault::OffCentre, "the derivative by `b`"),
    ] {
        let breaches = density("law", &Law(fault), &parameters).unwrap_err();
        assert!(breaches.iter().any(|b| b.contains(expected)), "{expected}: {breaches:?}");
        assert!(breaches[0].starts_with("target `law`, "));
    }
    assert_eq!(density("law", &Law(Fault::None), &parameters), Ok(()));
}
