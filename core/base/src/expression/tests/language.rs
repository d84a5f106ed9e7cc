//! Meaning of expressions.

use super::*;
use crate::math::random::{Stream, uniform};
use crate::matrix::Matrix;

#[test]
fn operators_bind_as_in_mathematics() {
    for (text, expected) in [
        ("2 + 3 * 4 ^ 2", 50.0),
        ("-x ^ 2", -4.0),
        ("(-x) ^ 2", 4.0),
        ("2 ^ 3 ^ 2", 512.0),
        ("2 ^ -1", 0.5),
        ("2 ^ -x * y", 0.75),
        ("8 / 4 / 2", 1.0),
        ("8 - 4 - 2", 2.0),
        ("x * -y", -6.0),
        ("- - x", 2.0),
        ("+x - +y", -1.0),
        ("-v[2] ^ 2", -4.0),
        ("1.5e1 + .5 + 2. + 1E-1", 17.6),
        ("if(x < y and not y < x or x > 100, 1, 0)", 1.0),
        ("if(not x > y, 1, 0)", 1.0),
        ("if(x + 1 >= y and x != y, 5, 6) / 2", 2.5),
        ("pi - e", std::f64::consts::PI - std::f64::consts::E),
    ] {
        assert_eq!(values(text), [expected], "{text}");
    }
}

#[test]
fn functions_are_those_of_the_books() {
    // Abramowitz and Stegun, tables 7.1 and 6.1 (erf, gamma(5/2) = 1.32934 03882); elementary identities.
    for (text, expected) in [
        ("erf(0.5)", 0.520_499_877_813_046_5),
        ("erfc(0.5) + erf(0.5)", 1.0),
        ("exp(log_gamma(2.5))", 1.329_340_388_179_137),
        ("log_gamma(5)", 24f64.ln()),
        ("atan2(1, -1)", 0.75 * std::f64::consts::PI),
        ("hypot(3, 4)", 5.0),
        ("log1p(1e-20) + expm1(1e-20)", 2e-20),
        ("sign(-3) + sign(0) + sign(7)", 0.0),
        ("floor(-0.5) + ceil(0.5)", 0.0),
        ("min(x, y, -1) + max(x, y, 1)", 2.0),
        ("log_sum_exp(1000, 1000)", 1000.0 + 2f64.ln()),
        ("pow(x, y) + cosh(0) + tanh(0) + asin(0) + acos(1)", 9.0),
    ] {
        assert!(near(values(text)[0], expected, 1e-15), "{text}: {:?}", values(text));
    }
}

#[test]
fn vectors_go_element_by_element() {
    for (text, expected) in [
        ("2 * v + x", &[4.0, -2.0, 10.0][..]),
        ("v * v", &[1.0, 4.0, 16.0]),
        ("v[2:3] - v[1:2]", &[-3.0, 6.0]),
        ("v[:2]", &[1.0, -2.0]),
        ("v[2:]", &[-2.0, 4.0]),
        ("v[3]", &[4.0]),
        ("v[[3, 3, 1]]", &[4.0, 4.0, 1.0]),
        ("[x, v, y][3]", &[-2.0]),
        ("[x, v, y][length(v) + 1]", &[4.0]),
        ("sum(v) + mean(v)", &[4.0]),
        ("min(v) * max(v)", &[-8.0]),
        ("max(v, 0)", &[1.0, 0.0, 4.0]),
        ("dot(v, [1, 2, 3] * x)", &[18.0]),
        ("if(v > 0, v, x)", &[1.0, 2.0, 4.0]),
        ("log_sum_exp([x, x])", &[2.0 + std::f64::consts::LN_2]),
        // 3, 2 * 3 + 1, 2 * 7 + 1; and a different factor for each step.
        ("recurrence(1, 2, [1, 1, 1])", &[3.0, 7.0, 15.0]),
        ("recurrence(1, [2, 0, 1], [1, 1, 1])", &[3.0, 1.0, 2.0]),
        ("interpolate([0, 1, 1.5, 2, 9], [1, 2, 4], [10, 20, 0])", &[10.0, 10.0, 15.0, 20.0, 0.0]),
        ("interpolate(y, [1, 2, 4], v)", &[1.0]),
    ] {
        assert_eq!(values(text), expected, "{text}");
    }
}

#[test]
fn what_is_undefined_stays_so() {
    for text in [
        "log(-x)",
        "min(0, log(-x))",
        "max(log(-x), 0)",
        "min([1, log(-x)])",
        "if(log(-x) > 0, 1, 2)",
        "if(not (log(-x) > 0), 1, 2)",
        "if(x > 0 and log(-x) > 0, 1, 2)",
        "sign(log(-x))",
        "log_sum_exp(1, log(-x))",
        "interpolate(log(-x), [1, 2], [1, 1])",
        "sum([1, 0 / 0])",
    ] {
        assert!(values(text)[0].is_nan(), "{text}: {:?}", values(text));
    }
    // A decisive side suffices, and the branch not taken is not evaluated.
    for text in ["if(x < 0 and log(-x) > 0, 1, 2)", "if(x < 0, log(-x), 2)"] {
        assert_eq!(values(text), [2.0], "{text}");
    }
    assert_eq!(values("if(x > 0 or log(-x) > 0, 1, 2)"), [1.0]);
}

#[test]
fn definitions_stand_in_any_order_and_are_shared() {
    let mut scope = scope(&["x"]);
    scope.define("last", "square + exp(middle)").unwrap();
    scope.define("middle", "square / 2").unwrap();
    scope.define("square", "x * x").unwrap();
    scope.define("spare", "x * x + x").unwrap();
    let program = scope.compile(&["last", "middle"]).unwrap();
    assert_eq!(program.value(&[2.0]), [4.0 + 2f64.exp(), 2.0]);
    // x * x, half of it, the exponential, the sum: no repetition, and nothing that no output needs.
    assert_eq!(program.instructions(), 4);
    assert!(program.depends_on(0));
}

#[test]
fn elements_of_unknown_vectors_may_be_declared_in_any_order() {
    for (order, point) in [
        (["a", "t[1]", "t[2]", "t[3]"], [9.0, 1.0, 2.0, 3.0]),
        (["t[3]", "a", "t[1]", "t[2]"], [3.0, 9.0, 1.0, 2.0]),
    ] {
        let program = program(scope(&order), "sum(t * [1, 10, 100]) + a * t[2] + sum(t[[1, 1]])");
        assert_eq!(program.value(&point), [341.0]);
        let gradient = program.gradient(&point).1;
        for (name, slope) in order.iter().zip(&gradient) {
            let expected = [("a", 2.0), ("t[1]", 3.0), ("t[2]", 19.0), ("t[3]", 100.0)];
            assert!(expected.contains(&(*name, *slope)), "{name}: {slope}");
        }
    }
}

#[test]
fn matrices_of_data_multiply_vectors() {
    let mut scope = scope(&["a", "b"]);
    let matrix = Matrix::from_rows(2, [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]);
    scope.data("X", Data::Matrix(matrix)).unwrap();
    let program = program(scope, "matrix_product(X, [a, b])");
    assert_eq!(program.value(&[1.0, 10.0]), [21.0, 43.0, 65.0]);
    let (_, jacobian) = program.jacobian(&[1.0, 10.0]);
    assert_eq!(jacobian.as_slice(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
}

/// Source: Python's values of random expressions, parsed by Python and evaluated with mpmath's functions.
#[test]
fn random_expressions_have_the_values_that_python_gives() {
    let mut count = 0;
    for line in include_str!("mpmath.txt").lines().filter(|line| !line.starts_with('#')) {
        let (text, numbers) = line.split_once(" ; ").unwrap();
        let numbers: Vec<f64> = numbers.split(" ; ").map(|x| x.parse().unwrap()).collect();
        let program = program(scope(&["a", "b", "c"]), text);
        let (value, gradient) = program.gradient(&numbers[..3]);
        assert!(near(value, numbers[3], 2e-12), "{text}: {value}, expected {}", numbers[3]);
        let largest = numbers[4..].iter().fold(1.0_f64, |most, x| most.max(x.abs()));
        for (slope, expected) in gradient.iter().zip(&numbers[4..]) {
            let close = (slope - expected).abs() <= 1e-10 * largest;
            assert!(close, "{text}: slope {slope}, expected {expected}");
        }
        count += 1;
    }
    assert_eq!(count, 220);
}

#[test]
fn a_batch_gives_the_bits_of_single_points() {
    let mut scope = scope(&["a", "b", "s"]);
    let mut rng = Stream::root(1).generator();
    let mut random = |n: usize| (0..n).map(|_| uniform(&mut rng)).collect::<Vec<f64>>();
    scope.data("x", Data::Vector(random(37))).unwrap();
    scope.data("y", Data::Vector(random(37))).unwrap();
    scope.define("line", "a + b * x").unwrap();
    scope.define("density", "sum(normal_log_density(y, line, s))").unwrap();
    scope.define("shape", "if(a > b, sin(a) ^ s, log_sum_exp([a, b, s]))").unwrap();
    let program = scope.compile(&["density", "line", "shape"]).unwrap();
    let points = Matrix::from_vec(21, 3, random(63));
    let values = program.values(&points);
    for (point, row) in points.iter_rows().zip(values.iter_rows()) {
        let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&program.value(point)), bits(row));
    }
}

/// Long sums and deep nesting use no stack.
#[test]
fn long_expressions_are_read() {
    let text = vec!["x"; 50_000].join(" + ");
    assert_eq!(values(&text), [100_000.0]);
    let nested = format!("{}x{}", "(".repeat(150), ")".repeat(150));
    assert_eq!(values(&nested), [2.0]);
    let signs = format!("{}x", "-".repeat(150));
    assert_eq!(values(&signs), [2.0]);
}
