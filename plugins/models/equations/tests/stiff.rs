//! Stiff systems against the values of the test set of Hairer and Wanner (F. Mazzia and C. Magherini, Test Set for
//! Initial Value Problem Solvers, release 2.4, 2008: problems ROBER and VDPOL).

use super::*;

const ROBERTSON: &str = r#"
state = { a = 1.0, b = 0.0, c = 0.0 }
rate = { a = "-k1 * a + k3 * b * c", b = "k1 * a - k3 * b * c - k2 * b^2", c = "k2 * b^2" }
observe = { a = "a", b = "b", c = "c" }
"#;

const LABELS: [&str; 3] = ["a", "b", "c"];

#[test]
fn robertson() {
    let rates = [0.04, 1e4, 3e7];
    for method in ["auto", "bdf", "esdirk"] {
        let solver = format!("{{ method = \"{method}\", absolute_tolerance = 1e-20 }}");
        let options = format!("{ROBERTSON}solver = {solver}");
        let case = case(&options, &["k1", "k3", "k2"], &LABELS, &[40.0, 1e11]);
        let values = case.values(&rates);
        // At 40 by Radau IIA of order 5 with a tolerance of 1e-12.
        let expected = [
            0.715_827_068_719_4,
            2.083_340_149_701_255e-8,
            9.185_534_764_557e-6,
            8.333_360_770_334_713e-14,
            0.284_163_745_745_8,
            0.999_999_979_166_505,
        ];
        for (found, expected) in values.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 2e-5, "{method}: {found}, {expected}");
        }
    }
}

/// With `r = k1 t` the solution is unchanged if all constants and the inverse time are scaled: `Σ k ∂y/∂k = t y'`.
#[test]
fn robertson_scales() {
    let case = case(ROBERTSON, &["k1", "k3", "k2"], &LABELS, &[0.4, 40.0, 4e3]);
    let rates: [f64; 3] = [0.04, 1e4, 3e7];
    let (values, jacobian) = (case.values(&rates), case.jacobian(&rates));
    for (i, t) in [0.4, 40.0, 4e3].into_iter().enumerate() {
        let (a, b, c) = (values[i], values[3 + i], values[6 + i]);
        let slow = -rates[0] * a + rates[1] * b * c;
        let formed = rates[2] * b * b;
        // The rate of `b` is a difference of two nearly equal numbers, and not a suitable reference.
        for (k, expected) in [(0, t * slow), (2, t * formed)] {
            let row = jacobian.row(3 * k + i);
            let found: f64 = row.iter().zip(rates).map(|(slope, rate)| slope * rate).sum();
            assert!((found / expected - 1.0).abs() < 1e-5, "{k} at {t}: {found}, {expected}");
        }
    }
}

#[test]
fn van_der_pol() {
    let options = r#"
        state = { y = 2.0, z = 0.0 }
        rate = { y = "z", z = "((1 - y^2) * z - y) / epsilon" }
        observe = { y = "y", z = "z" }
    "#;
    let case = case(options, &["epsilon"], &["y", "z"], &[1.0, 2.0]);
    let expected = [
        -1.863_646_254_808_13,
        1.706_167_732_170_483,
        0.753_543_086_543_546,
        -0.892_809_701_024_797_5,
    ];
    let values = case.values(&[1e-6]);
    for (found, expected) in values.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-5, "{found}, {expected}");
    }
    let call = case.call(&[1e-6]);
    let facts = case.model.predict(&call).unwrap().facts;
    assert_eq!(facts[0].value, "bdf", "{facts:?}");
}

/// `y' = -λ (y - cos t) - sin t`, `y(0) = 1`, is `cos t` for every λ: A. Prothero and A. Robinson, Math. Comp. 28
/// (1974) 145. The derivative with respect to λ is zero, that with respect to the start `exp(-λ t)`.
#[test]
fn prothero_and_robinson() {
    let options = r#"
        state = { y = "y0" }
        rate = { y = "-lambda * (y - cos(t)) - sin(t)" }
        observe = "y"
    "#;
    let times = times(10.0, 50);
    let case = case(options, &["lambda", "y0"], &[], &times);
    let exact: Vec<f64> = times.iter().map(|t| t.cos()).collect();
    for lambda in [1.0, 1e3, 1e6] {
        close(&case.values(&[lambda, 1.0]), &exact, 1e-6, "the values");
        let jacobian = case.jacobian(&[lambda, 1.0]);
        for (i, t) in times.iter().enumerate() {
            assert!((lambda * jacobian[(i, 0)]).abs() < 1e-6, "{lambda} at {t}");
            assert!((jacobian[(i, 1)] - (-lambda * t).exp()).abs() < 1e-6, "{lambda} at {t}");
        }
    }
}
