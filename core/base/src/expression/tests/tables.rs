//! Functions given by tables, evaluators, and breakpoints.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::*;
use crate::data::{Function, Unit};
use crate::expression::Evaluator;

fn force(at: &[f64], values: &[f64]) -> Arc<Function> {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let (at, values) = (at.to_vec(), values.to_vec());
    let (at_unit, unit) = (unit("s"), unit("N"));
    Arc::new(Function { name: "force".into(), at, at_unit, values, unit })
}

/// The unknowns `t`, `m`, `k` and the table `force`: 0 N at 1 s, 4 N at 2 s, 2 N at 4 s.
fn loaded() -> Scope {
    let mut scope = scope(&["t", "m", "k"]);
    scope.function(force(&[1.0, 2.0, 4.0], &[0.0, 4.0, 2.0])).unwrap();
    scope
}

#[test]
fn a_table_is_a_function() {
    let mut scope = loaded();
    scope.define("a", "force(2 * t) / m + k * force(t)").unwrap();
    let program = scope.compile(&["a"]).unwrap();
    let table = |x: f64| {
        if x < 1.0 {
            0.0
        } else if x < 2.0 {
            4.0 * (x - 1.0)
        } else {
            (6.0 - x).max(2.0)
        }
    };
    let slope = |x: f64| {
        if !(1.0..4.0).contains(&x) {
            0.0
        } else if x < 2.0 {
            4.0
        } else {
            -1.0
        }
    };
    let mut evaluator = Evaluator::new(&program);
    for t in [-1.0, 0.5, 0.75, 1.0, 1.5, 2.0, 3.9, 4.0, 1e9] {
        let point = [t, 3.0, 0.5];
        let value = table(2.0 * t) / 3.0 + 0.5 * table(t);
        let gradient =
            [2.0 * slope(2.0 * t) / 3.0 + 0.5 * slope(t), -table(2.0 * t) / 9.0, table(t)];
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-14 * b.abs().max(1.0);
        let (found, reverse) = program.gradient(&point);
        assert!(close(found, value), "{t}: {found}, expected {value}");
        evaluator.at(&point);
        let mut out = [0.0];
        evaluator.values(&mut out);
        assert_eq!(out[0].to_bits(), found.to_bits());
        for j in 0..3 {
            let mut direction = [0.0; 3];
            direction[j] = 1.0;
            evaluator.slopes(&direction, &mut out);
            assert!(close(reverse[j], gradient[j]), "{t}, {j}: {} {}", reverse[j], gradient[j]);
            assert!(close(out[0], gradient[j]), "{t}, {j}: {} {}", out[0], gradient[j]);
        }
    }
    assert!(program.value(&[f64::NAN, 1.0, 1.0])[0].is_nan());
}

#[test]
fn tables_have_units() {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let units: BTreeMap<String, Unit> =
        [("t", "s"), ("m", "kg"), ("k", "ms")].map(|(n, u)| (n.to_owned(), unit(u))).into();
    let of = |text: &str| {
        let mut scope = loaded();
        scope.result("a.b", text).unwrap();
        let (found, faults) = scope.find_units(&units);
        faults.first().map_or_else(|| Ok(found["a.b"].clone()), |fault| Err(fault.to_string()))
    };
    assert_eq!(of("force(t) / m"), Ok(Some(unit("m/s2"))));
    assert_eq!(of("0 * force(t)"), Ok(None));
    let wrong = "`a.b`: the units do not agree: expected `s`, found `ms` \
                 (help: numbers are not converted: use one unit for both)";
    assert_eq!(of("force(k)"), Err(wrong.to_owned()));
    assert!(of("force(0) + force(2 {s})").is_ok());
    assert!(of("force(2)").unwrap_err().contains("a number with its unit is written `2.5 {s}`"));
}

#[test]
fn faults_of_tables() {
    let fault = |text: &str| {
        let mut scope = loaded();
        let defined = scope.define("a", text).map_err(|fault| vec![fault]);
        defined.and_then(|()| scope.compile(&["a"])).unwrap_err()[0].to_string()
    };
    for (text, message) in [
        ("forse(t)", "`a`: unknown function `forse` (help: did you mean `force`?)"),
        ("force", "`a`: unknown name `force` (help: a function is called as `force(x)`)"),
        (
            "force(t, 1)",
            "`a`: wrong number of arguments for `force`: expected `force(x)`, found 2 arguments",
        ),
    ] {
        assert_eq!(fault(text), message);
    }
    let table = |at: &[f64], values: &[f64]| {
        loaded().function(Arc::new(Function { name: "f".into(), ..(*force(at, values)).clone() }))
    };
    let message = |fault: Result<(), Fault>| fault.unwrap_err().to_string();
    assert_eq!(message(table(&[], &[])), "the function `f` has 0 places and 0 values");
    assert_eq!(
        message(table(&[1.0, 1.0], &[0.0, 0.0])),
        "the function `f` has places that do not ascend: 1 after 1"
    );
    let named =
        |name: &str| Arc::new(Function { name: name.into(), ..(*force(&[1.0], &[1.0])).clone() });
    assert_eq!(
        message(loaded().function(named("exp"))),
        "the function `exp` has the name of one that expressions know"
    );
    assert_eq!(
        message(loaded().function(named("t"))),
        "there are two of the name `t` (help: give one of them another name)"
    );
}

#[test]
fn breaks_are_where_values_kink_or_jump() {
    let mut scope = loaded();
    scope
        .define(
            "a",
            "if(t > 2 and m <= k, abs(m - 1), sign(k)) + force(t + k) + max(m, k) + exp(m)",
        )
        .unwrap();
    let program = scope.compile(&["a"]).unwrap();
    let point = [10.0, 3.0, 0.5];
    let found: Vec<(f64, Vec<f64>, bool)> = program
        .breaks()
        .into_iter()
        .map(|b| (b.quantity.value(&point)[0], b.at, b.jumps))
        .collect();
    let zero = vec![0.0];
    let expected = [
        (8.0, zero.clone(), true),
        (2.5, zero.clone(), true),
        (2.0, zero.clone(), false),
        (0.5, zero.clone(), true),
        (10.5, vec![1.0, 2.0, 4.0], false),
        (2.5, zero, false),
    ];
    assert_eq!(found, expected);
    let delayed = &program.breaks()[4].quantity;
    assert_eq!((delayed.instructions(), delayed.depends_on(1)), (1, false));
}
