//! Random fields called as functions.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::*;
use crate::data::{Field, Unit};
use crate::matrix::Matrix;

/// A field of two terms, whose modes are the polynomials `x` and `x²` up to cubic splines, which have them exactly.
fn field(log_normal: bool) -> Arc<Field> {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let at = [0.0, 1.0, 2.0, 4.0];
    Arc::new(Field {
        name: "k".into(),
        unit: unit("W/(m K)"),
        axis: "x".into(),
        at: at.to_vec(),
        at_unit: unit("m"),
        level: vec![0.5; 4],
        modes: Matrix::from_rows(4, [at, at.map(|x| x * x)]),
        sd: 1.0,
        log_normal,
        kept: 0.9,
    })
}

fn known(log_normal: bool) -> Scope {
    let mut scope = Scope::new();
    scope.field(field(log_normal)).unwrap();
    // Coefficients may be declared among others, in any order.
    for name in ["k.term[2]", "x", "k.term[1]"] {
        scope.unknown(name).unwrap();
    }
    scope
}

#[test]
fn a_field_is_its_level_and_its_modes_times_their_coefficients() {
    let (b, x, a) = (-0.3, 1.6, 0.7);
    let normal = program(known(false), "2 * k(x)");
    let (value, gradient) = normal.gradient(&[b, x, a]);
    let exact = 0.5 + a * x + b * x * x;
    assert!(near(value, 2.0 * exact, 1e-12));
    for (found, slope) in gradient.iter().zip([x * x, a + 2.0 * b * x, x]) {
        assert!(near(*found, 2.0 * slope, 1e-12), "{gradient:?}");
    }
    let (value, gradient) = program(known(true), "k(x)").gradient(&[b, x, a]);
    assert!(near(value, exact.exp(), 1e-12));
    assert!(near(gradient[2], x * exact.exp(), 1e-12));
    // Constant beyond the places.
    assert!(near(
        program(known(false), "k(9)").value(&[b, x, a])[0],
        0.5 + 4.0 * a + 16.0 * b,
        1e-12
    ));
    assert_eq!(field(false).values(&[a, b])[2], 0.5 + 2.0 * a + 4.0 * b);
}

#[test]
fn fields_are_checked_like_tables() {
    let mut scope = known(false);
    scope.define("flux", "k(x) * 3 {K/m}").unwrap();
    let unit = |text: &str| Unit::parse(text).unwrap();
    let units = BTreeMap::from([("x".to_owned(), unit("m"))]);
    assert_eq!(scope.check_units(&units).unwrap()["flux"], unit("W/m2"));
    scope.define("wrong", "k(2 {s})").unwrap();
    assert_eq!(scope.check_units(&units).unwrap_err()[0].found.as_deref(), Some("`s`"));
    assert_eq!(scope.define("k", "1").unwrap_err().message, "there are two of the name `k`");
    let mut without = Scope::new();
    without.field(field(false)).unwrap();
    without.define("y", "k(1)").unwrap();
    let fault = without.compile(&["y"]).unwrap_err().remove(0);
    assert_eq!(fault.message, "the coefficients of the field `k` are not known");
    assert_eq!(crate::expression::called("k(1) + k(x)", &["k"]).unwrap(), ["k", "k"]);
}
