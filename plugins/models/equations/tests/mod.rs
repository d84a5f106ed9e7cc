//! Tests of `equations`.
#![allow(clippy::unwrap_used)]

mod breaks;
mod closed_forms;
mod limits;
mod stiff;

use std::sync::Arc;

use lacuna::data::{Axis, Function, Interpolation, Layout, Scenario, Unit};
use lacuna::plugin::Model;
use lacuna::plugin::model::{Call, EvalError};
use lacuna::plugin::registry::from_text;
use lacuna_linalg::Matrix;

/// A model with the layout and the conditions of its runs.
struct Case {
    model: Box<dyn Model>,
    names: Vec<String>,
    layout: Layout,
    scenario: Scenario,
}

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap()
}

/// Equations in these inputs, observed at these times `t` and at the labels, if any.
fn case(options: &str, inputs: &[&str], labels: &[&str], times: &[f64]) -> Case {
    let built = from_text::<dyn Model>("equations", options).unwrap_or_else(|e| panic!("{e}"));
    let mut axes = vec![Axis::grid("t", times.to_vec(), unit("s"))];
    if !labels.is_empty() {
        axes.insert(0, Axis::labels("observed", labels.iter().copied()));
    }
    Case {
        model: built.plugin,
        names: inputs.iter().map(|name| (*name).to_owned()).collect(),
        layout: Layout { name: "y".into(), unit: Unit::dimensionless(), axes },
        scenario: Scenario::default(),
    }
}

impl Case {
    /// Returns the case with a table over time.
    fn with_table(self, name: &str, at: Vec<f64>, values: Vec<f64>) -> Self {
        self.with_curve(name, at, values, Interpolation::Linear)
    }

    /// Returns the case with a table over time and this interpolation between its points.
    fn with_curve(
        mut self,
        name: &str,
        at: Vec<f64>,
        values: Vec<f64>,
        interpolation: Interpolation,
    ) -> Self {
        let (at_unit, unit) = (unit("s"), unit("N"));
        let function = Function { name: name.into(), at, at_unit, values, unit, interpolation };
        self.scenario.functions.push(Arc::new(function));
        self
    }

    fn call<'a>(&'a self, inputs: &'a [f64]) -> Call<'a> {
        Call::new(inputs, &self.names, &self.layout, &self.scenario)
    }

    fn values(&self, inputs: &[f64]) -> Vec<f64> {
        self.model.predict(&self.call(inputs)).unwrap_or_else(|error| panic!("{error}")).values
    }

    fn rejected(&self, inputs: &[f64]) -> String {
        match self.model.predict(&self.call(inputs)) {
            Err(EvalError::Rejected(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }

    fn jacobian(&self, inputs: &[f64]) -> Matrix {
        let gradient = self.model.gradient().unwrap();
        gradient.jacobian(&self.call(inputs)).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Asserts values and derivatives against a closed form, `form(inputs)`, that gives all of them; errors are
    /// relative to the largest value or slope of a column.
    fn is(&self, inputs: &[f64], form: impl Fn(&[f64]) -> Vec<f64>, values: f64, slopes: f64) {
        close(&self.values(inputs), &form(inputs), values, "the values");
        let jacobian = self.jacobian(inputs);
        for (j, name) in self.names.iter().enumerate() {
            let exact = derivative(&form, inputs, j);
            close(&jacobian.column(j), &exact, slopes, &format!("the derivative by `{name}`"));
        }
    }
}

fn close(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len());
    let size = expected.iter().fold(0.0, |size: f64, y| size.max(y.abs()));
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        let error = (found - expected).abs();
        let limit = tolerance * size.max(f64::MIN_POSITIVE);
        assert!(error <= limit, "{what} at {i}: {found}, expected {expected}");
    }
}

/// Central differences of order 6.
fn derivative(form: &impl Fn(&[f64]) -> Vec<f64>, inputs: &[f64], j: usize) -> Vec<f64> {
    let step = 1e-3 * inputs[j].abs().max(0.1);
    let at = |k: f64| {
        let mut moved = inputs.to_vec();
        moved[j] += k * step;
        form(&moved)
    };
    let weighted = [(1.0, 0.75), (2.0, -0.15), (3.0, 1.0 / 60.0)];
    let mut sum = vec![0.0; at(0.0).len()];
    for (k, weight) in weighted {
        let (up, down) = (at(k), at(-k));
        for (sum, (up, down)) in sum.iter_mut().zip(up.iter().zip(&down)) {
            *sum += weight * (up - down) / step;
        }
    }
    sum
}

/// Equally spaced times from `last / count` to `last`.
fn times(last: f64, count: usize) -> Vec<f64> {
    (1..=count).map(|i| last * i as f64 / count as f64).collect()
}
