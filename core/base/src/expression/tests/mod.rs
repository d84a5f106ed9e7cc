//! Tests of expressions.
#![allow(clippy::unwrap_used)]

mod densities;
mod derivatives;
mod faults;
mod fields;
mod language;
mod parts;
mod tables;
mod units;

use super::{Data, Fault, Program, Scope};

/// A scope with these unknowns.
fn scope(unknowns: &[&str]) -> Scope {
    let mut scope = Scope::new();
    for name in unknowns {
        scope.unknown(name).unwrap();
    }
    scope
}

/// A program of one expression.
fn program(mut scope: Scope, text: &str) -> Program {
    scope.define("result", text).unwrap_or_else(|fault| panic!("{}", fault.render(text)));
    scope.compile(&["result"]).unwrap_or_else(|faults| panic!("{}", faults[0].render(text)))
}

/// The value of an expression in `x` = 2, `y` = 3 and the vector `v` = [1, -2, 4].
fn values(text: &str) -> Vec<f64> {
    let mut scope = scope(&["x", "y"]);
    scope.data("v", Data::Vector(vec![1.0, -2.0, 4.0])).unwrap();
    program(scope, text).value(&[2.0, 3.0])
}

fn near(found: f64, expected: f64, tolerance: f64) -> bool {
    let size = expected.abs().max(1.0);
    (found - expected).abs() <= tolerance * size
}
