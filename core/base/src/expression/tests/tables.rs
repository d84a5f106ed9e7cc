//! Functions given by tables, evaluators, and breakpoints.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::*;
use crate::data::{Function, Interpolation, Unit};
use crate::expression::Evaluator;

fn force(at: &[f64], values: &[f64]) -> Arc<Function> {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let (at, values) = (at.to_vec(), values.to_vec());
    let (at_unit, unit) = (unit("s"), unit("N"));
    Arc::new(Function {
        name: "force".into(),
        at,
        at_unit,
        values,
        unit,
        interpolation: Interpolation::Linear,
    })
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

/// Source of the spline: `scipy.interpolate.CubicSpline(x, y, bc_type="not-a-knot")` of `SciPy` 1.17.1, values and first
/// derivatives printed to 12 decimals.
#[test]
fn a_table_may_be_held_or_smooth() {
    let nodes = [0.0, 1.0, 2.5, 3.0, 4.5, 6.0];
    let values = [1.0, -1.0, 2.0, 2.5, 0.0, 0.5];
    let program = |interpolation: Interpolation, count: usize| {
        let function = (*force(&nodes[..count], &values[..count])).clone();
        let mut scope = scope(&["t"]);
        scope.function(Arc::new(Function { interpolation, ..function })).unwrap();
        scope.define("f", "force(t)").unwrap();
        scope.compile(&["f"]).unwrap()
    };
    let held = program(Interpolation::Hold, 6);
    for (t, expected) in
        [(-1.0, 1.0), (0.0, 1.0), (0.999, 1.0), (1.0, -1.0), (2.6, 2.0), (9.0, 0.5)]
    {
        assert_eq!(held.gradient(&[t]), (expected, vec![0.0]), "{t}");
    }
    let breaks = held.breaks();
    assert!(breaks[0].jumps && breaks[0].at == nodes[1..]);
    let splines: [(usize, &[[f64; 3]]); 4] = [
        (
            2,
            &[
                [0.2, 0.6, -2.0],
                [0.375, 0.25, -2.0],
                [0.55, -0.1, -2.0],
                [0.725, -0.45, -2.0],
                [0.9, -0.8, -2.0],
            ],
        ),
        (
            3,
            &[
                [0.2, 0.344, -2.96],
                [0.75, -0.8, -1.2],
                [1.3, -0.976, 0.56],
                [1.85, -0.184, 2.32],
                [2.4, 1.576, 4.08],
            ],
        ),
        (
            4,
            &[
                [0.2, 0.0864, -3.814],
                [0.875, -1.049_414_062_5, 0.129_687_5],
                [1.55, -0.169_087_5, 2.159_75],
                [2.225, 1.435_682_812_5, 2.276_187_5],
                [2.9, 2.4732, 0.479],
            ],
        ),
        (
            6,
            &[
                [0.2, 0.084_56, -3.8201],
                [1.15, -0.859_823_125, 1.195_662_5],
                [2.1, 1.147_42, 2.393_85],
                [3.05, 2.499_708_032_407, -0.107_643_055_556],
                [4.0, 1.114_259_259_259, -2.254_722_222_222],
                [4.95, -0.730_963_125, -1.075_587_5],
                [5.9, 0.123_944_074_074, 3.429_761_111_111],
            ],
        ),
    ];
    for (count, table) in splines {
        let smooth = program(Interpolation::Spline, count);
        assert_eq!(smooth.breaks()[0].at, [nodes[0], nodes[count - 1]]);
        for &[t, value, slope] in table {
            let (found, gradient) = smooth.gradient(&[t]);
            assert!((found - value).abs() < 1e-12 && (gradient[0] - slope).abs() < 1e-12, "{t}");
        }
    }
}
