//! Units of expressions.

use std::collections::BTreeMap;

use super::*;
use crate::data::Unit;

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap()
}

/// The unit of an expression in lengths `x`, `y` (m) and `z` (mm), a time `t`, a pressure `p`, a temperature
/// `celsius` and plain numbers `n` and `v` (a vector).
fn found(text: &str) -> Result<Unit, Fault> {
    let declared =
        [("x", "m"), ("y", "m"), ("z", "mm"), ("t", "s"), ("p", "MPa"), ("celsius", "degC")];
    let mut scope = scope(&["x", "y", "z", "t", "p", "celsius", "n"]);
    scope.data("v", Data::Vector(vec![1.0, 2.0])).unwrap();
    let units: BTreeMap<String, Unit> =
        declared.into_iter().map(|(name, text)| (name.to_owned(), unit(text))).collect();
    scope.define("result", text)?;
    scope.compile(&["result"]).map_err(|mut faults| faults.remove(0))?;
    scope
        .check_units(&units)
        .map(|mut all| all.remove("result").unwrap())
        .map_err(|mut f| f.remove(0))
}

#[test]
fn units_follow_the_expression() {
    for (text, expected) in [
        ("x + y", "m"),
        ("x / t", "m/s"),
        ("p * x^2 / t", "MPa m2/s"),
        ("sqrt(x * y)", "m"),
        ("x^(1/2) * x^0.5", "m"),
        ("x^-2", "m^-2"),
        ("(x / t)^(2/3)", "m^(2/3) s^(-2/3)"),
        ("exp(-x / y) * p", "MPa"),
        ("max(x, 0) + abs(y)", "m"),
        ("if(x > 0 and t >= 0, x, y)", "m"),
        ("x - 2 {m}", "m"),
        ("9.81 {m/s2} * t^2 / 2", "m"),
        ("hypot(x, y) * atan2(x, y) * sign(x)", "m"),
        ("sum(x * v) + mean(v * y)", "m"),
        ("[x, y][1] * dot(v, v)", "m"),
        ("recurrence(1 {K}, 0.5, [1 {K}, 2 {K}])", "K"),
        ("interpolate(t, [0 {s}, 1 {s}], [1 {K}, 3 {K}])", "K"),
        ("normal_log_density(x, y, 2 {m})", "1"),
        ("gamma_log_density(x, n, y)", "1"),
        ("n^n", "1"),
        ("celsius + celsius", "degC"),
        ("celsius - 20 {degC}", "K"),
        ("celsius - 3 {K}", "degC"),
        ("3 {K} + celsius", "degC"),
        ("(celsius - 20 {degC}) / t", "K/s"),
        ("0", "1"),
    ] {
        assert_eq!(found(text), Ok(unit(expected)), "{text}");
    }
}

#[test]
fn units_that_do_not_agree_are_found() {
    for (text, place, line) in [
        ("x + t", "t", "the units do not agree: expected `m`, found `s`"),
        (
            "x + z",
            "z",
            "the units do not agree: expected `m`, found `mm` (help: numbers are not converted: use one unit for both)",
        ),
        (
            "x + 1",
            "1",
            "the units do not agree: expected `m`, found `1` (help: a number with its unit is written `2.5 {m}`)",
        ),
        ("if(x > t, 1, 2)", "t", "the units do not agree: expected `m`, found `s`"),
        ("max(x, y, p)", "p", "the units do not agree: expected `m`, found `MPa`"),
        ("exp(x)", "x", "the argument of `exp` has a unit: expected a plain number, found `m`"),
        ("2^t", "t", "an exponent has a unit: expected a plain number, found `s`"),
        (
            "x^n",
            "n",
            "the power of a quantity in `m` has a unit that is not known: expected a number as exponent",
        ),
        ("x^0.3", "x^0.3", "`m` to the power 0.3 is not a unit"),
        ("x + 2 {metre}", "metre", "`metre` is not a unit known here (help: did you mean `m`?)"),
        (
            "celsius * x",
            "celsius * x",
            "a temperature with its own zero cannot be multiplied (help: use `K`)",
        ),
        ("normal_log_density(x, t, 1)", "t", "the units do not agree: expected `m`, found `s`"),
        (
            "gamma_log_density(x, y, y)",
            "y",
            "`shape` has a unit: expected a plain number, found `m`",
        ),
    ] {
        let fault = found(text).expect_err(text);
        assert_eq!(&text[fault.span.clone()], place, "{text}");
        assert_eq!(fault.to_string(), format!("`result`: {line}"), "{text}");
    }
}

#[test]
fn products_and_powers_of_units_can_be_read_again() {
    for unit_text in ["kg/m3", "m", "1/s", "%", "", "microstrain", "J/(kg K)", "Hz^0.5"] {
        let first = unit(unit_text);
        for other in ["m/s", "1", "s^-1", "N"] {
            let product = first.times(&unit(other)).unwrap();
            assert_eq!(unit(product.as_str()), product, "{unit_text} times {other}: {product}");
        }
        for exponent in [2.0, -1.0, 0.5, 1.0 / 3.0, -1.5, 1.0] {
            let Some(power) = first.power(exponent) else { continue };
            assert_eq!(unit(power.as_str()), power, "{unit_text}^{exponent}: {power}");
        }
    }
}
