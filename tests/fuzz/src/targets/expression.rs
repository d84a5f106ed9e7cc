//! Formulas as studies write them.

use std::collections::BTreeMap;
use std::sync::Arc;

use lacuna::data::{Function, Interpolation};
use lacuna::expression::{Data, Fault, Scope, check, names};

use super::shared::unit;

/// Longest text, in bytes.
const LONGEST: usize = 4096;

/// Each line is a definition `name = expression`, or an expression. Values are the same however derivatives are asked for,
/// and faults point into the text.
pub fn expression(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if text.len() > LONGEST {
        return;
    }
    let mut scope = scope();
    let mut outputs = Vec::new();
    for (i, line) in text.lines().take(8).enumerate() {
        let (name, formula) = match line.split_once(":=") {
            Some((name, formula)) => (name.trim().to_owned(), formula),
            None => (format!("line_{i}"), line),
        };
        if let Err(fault) = check(formula) {
            points_into(&fault, formula);
        }
        let _ = names(formula, &["force"]);
        match scope.define(&name, formula) {
            Ok(()) => outputs.push(name),
            Err(fault) => assert!(!fault.message.trim().is_empty()),
        }
    }
    let outputs: Vec<&str> = outputs.iter().map(String::as_str).collect();
    let units = ["a", "b", "theta"].map(|name| (name.to_owned(), unit("m")));
    let _ = scope.check_units(&BTreeMap::from(units));
    match scope.compile(&outputs) {
        Ok(program) => evaluated(&program),
        Err(faults) => {
            assert!(!faults.is_empty(), "refused without a fault");
            assert!(faults.iter().all(|fault| !fault.message.trim().is_empty()));
        }
    }
}

fn scope() -> Scope {
    let mut scope = Scope::new();
    for name in ["a", "b", "theta[1]", "theta[2]", "theta[3]"] {
        scope.unknown(name).expect("a name");
    }
    scope.data("x", Data::Vector(vec![0.5, -1.0, 2.0])).expect("data");
    scope.data("group", Data::Vector(vec![1.0, 3.0, 2.0])).expect("data");
    let force = Function {
        name: "force".to_owned(),
        at: vec![0.0, 1.0, 3.0],
        at_unit: unit("s"),
        values: vec![0.0, 4.0, 2.0],
        unit: unit("N"),
        interpolation: Interpolation::Linear,
    };
    scope.function(Arc::new(force)).expect("a function");
    scope
}

fn points_into(fault: &Fault, text: &str) {
    let shown = fault.render(text);
    assert!(!shown.trim().is_empty(), "nothing is said of `{text}`");
    assert!(text.get(fault.span.clone()).is_some(), "{:?} is no part of `{text}`", fault.span);
}

fn evaluated(program: &lacuna::expression::Program) {
    let count = program.outputs();
    for point in
        [[0.3, 1.7, -0.2, 4.0, 1e-3], [0.0; 5], [f64::NAN, -1.0, 1e300, f64::INFINITY, 2.0]]
    {
        let values = program.value(&point);
        assert_eq!(values.len(), count);
        let (backward, gradient) = program.pull_back(&point, &vec![1.0; count]);
        let (forward, slopes) = program.push_forward(&point, &[1.0, 0.0, 0.5, 0.0, 0.0]);
        assert_eq!((gradient.len(), slopes.len()), (point.len(), count));
        for (i, value) in values.iter().enumerate() {
            let same = |other: f64| {
                value.to_bits() == other.to_bits() || (value.is_nan() && other.is_nan())
            };
            assert!(
                same(backward[i]) && same(forward[i]),
                "{value} {} {}",
                backward[i],
                forward[i]
            );
        }
    }
}
