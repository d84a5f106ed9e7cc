//! Derivatives compared with closed forms, finite differences, and each other.

use super::*;
use crate::matrix::Matrix;

/// Every function of one number with its derivative from tables of calculus, and a point inside its domain.
const TABLE: [(&str, &str, f64); 25] = [
    ("abs(x)", "sign(x)", -0.7),
    ("sqrt(x)", "1 / (2 * sqrt(x))", 0.7),
    ("exp(x)", "exp(x)", 0.7),
    ("expm1(x)", "exp(x)", 0.7),
    ("log(x)", "1 / x", 0.7),
    ("log10(x)", "1 / (x * log(10))", 0.7),
    ("log1p(x)", "1 / (1 + x)", 0.7),
    ("sin(x)", "cos(x)", 0.7),
    ("cos(x)", "-sin(x)", 0.7),
    ("tan(x)", "1 / cos(x)^2", 0.7),
    ("asin(x)", "1 / sqrt(1 - x^2)", 0.7),
    ("acos(x)", "-1 / sqrt(1 - x^2)", 0.7),
    ("atan(x)", "1 / (1 + x^2)", 0.7),
    ("sinh(x)", "cosh(x)", 0.7),
    ("cosh(x)", "sinh(x)", 0.7),
    ("tanh(x)", "1 / cosh(x)^2", 0.7),
    ("erf(x)", "2 / sqrt(pi) * exp(-x^2)", 0.7),
    ("erfc(x)", "-2 / sqrt(pi) * exp(-x^2)", 0.7),
    // digamma(1) is minus Euler's constant.
    ("log_gamma(x)", "-0.5772156649015329", 1.0),
    ("x^2.5", "2.5 * x^1.5", 0.7),
    ("2.5^x", "2.5^x * log(2.5)", 0.7),
    ("x^x", "x^x * (log(x) + 1)", 0.7),
    ("atan2(x, 2)", "2 / (x^2 + 4)", 0.7),
    ("atan2(2, x)", "-2 / (x^2 + 4)", 0.7),
    ("hypot(x, 2)", "x / sqrt(x^2 + 4)", 0.7),
];

#[test]
fn functions_have_the_derivatives_of_the_calculus() {
    for (text, derivative, x) in TABLE {
        let slope = program(scope(&["x"]), text).gradient(&[x]).1[0];
        let expected = program(scope(&["x"]), derivative).value(&[x])[0];
        assert!(near(slope, expected, 1e-14), "{text}: {slope}, expected {expected}");
    }
}

#[test]
fn kinks_have_the_slopes_that_are_documented() {
    for (text, x, expected) in [
        ("abs(x)", 0.0, 0.0),
        ("sign(x)", 0.0, 0.0),
        ("floor(x) + ceil(x)", 0.5, 0.0),
        ("min(x, 2 * x)", 0.0, 1.0),
        ("max(2 * x, x)", 0.0, 2.0),
        ("max([2 * x, x, 3 * x])", 0.0, 2.0),
        ("if(x >= 0, 3 * x, 4 * x)", 0.0, 3.0),
        ("interpolate(x, [0, 1, 2], [0, 10, 40])", 1.0, 30.0),
        ("interpolate(x, [0, 1, 2], [0, 10, 40])", 2.0, 0.0),
        ("hypot(x, 0 * x)", 0.0, 0.0),
        ("atan2(x, 0)", 0.0, 0.0),
        ("x^0", 0.0, 0.0),
        ("x^1.5", 0.0, 0.0),
        ("0^x", 1.0, 0.0),
        ("sqrt(x)", 0.0, f64::INFINITY),
        // An argument that does not contribute has slope zero, even if its own slope is infinite or undefined.
        ("if(x > 0, sqrt(x), x)", 0.0, 1.0),
        ("if(x > 0, log(x), -x)", -1.0, -1.0),
        ("0 * sqrt(x)", 0.0, 0.0),
        ("sqrt(floor(x))", 0.5, 0.0),
    ] {
        let program = program(scope(&["x"]), text);
        let slope = program.gradient(&[x]).1[0];
        assert_eq!(slope, expected, "{text} at {x}");
        assert_eq!(program.push_forward(&[x], &[1.0]).1[0], expected, "{text} at {x}, forward");
    }
}

/// Expressions that together use every instruction, on vectors of unknowns.
const VECTORS: [&str; 15] = [
    "sum(normal_log_density(y, a + b * x, s))",
    "a * x + b",
    "log_sum_exp(a * x)",
    "sum(if(x > 1, a * x^2, b / x))",
    "min(a * x) * max([a, b, s] * b)",
    "dot(matrix_product(X, [a, b]), x)",
    "interpolate(s * x, [0, 1, 2, 3], [0, 1, 8, 27])",
    "[a, b, s][[2, 2, 1, 3]] ^ 2",
    "mean(exp(-s * x) * [a, 1, 2, b])",
    "hypot(a * x, b) + atan2(a, x * s)",
    "max(a, b * x, s) - min(x, s)",
    "sum(student_t_log_density(y, 4 + a, b * x, s))",
    "recurrence(a, b, x * s)",
    "sum(normal_log_density(y, recurrence(0, b * x, x), s))",
    "recurrence(1, s, y)",
];

fn regression() -> Scope {
    let mut scope = scope(&["a", "b", "s"]);
    scope.data("x", Data::Vector(vec![0.3, 0.8, 1.4, 2.2])).unwrap();
    scope.data("y", Data::Vector(vec![1.0, 0.2, -0.4, 2.0])).unwrap();
    let rows = [[1.0, 0.5], [-0.3, 2.0], [0.1, 0.1], [4.0, -1.0]];
    scope.data("X", Data::Matrix(Matrix::from_rows(2, rows))).unwrap();
    scope
}

#[test]
fn both_modes_agree_with_each_other_and_with_differences() {
    let point = [0.7, 1.3, 0.9];
    for text in VECTORS {
        let program = program(regression(), text);
        let outputs = program.outputs();
        let (values, jacobian) = program.jacobian(&point);
        assert_eq!(values, program.value(&point));
        let weights: Vec<f64> = (0..outputs).map(|i| 1.0 + i as f64).collect();
        let pulled = program.pull_back(&point, &weights).1;
        for j in 0..3 {
            let mut direction = [0.0; 3];
            direction[j] = 1.0;
            let pushed = program.push_forward(&point, &direction).1;
            let h = 1e-6;
            let moved = |by: f64| {
                let mut moved = point;
                moved[j] += by;
                program.value(&moved)
            };
            let differences = moved(h).into_iter().zip(moved(-h)).map(|(a, b)| (a - b) / (2.0 * h));
            for (i, difference) in differences.enumerate() {
                assert!(near(pushed[i], difference, 1e-8), "{text}, {i}, {j}: {difference}");
                assert!(near(jacobian[(i, j)], pushed[i], 1e-14), "{text}, {i}, {j}");
            }
            let sum: f64 = pushed.iter().zip(&weights).map(|(t, w)| t * w).sum();
            assert!(near(pulled[j], sum, 1e-13), "{text}, {j}: {} and {sum}", pulled[j]);
        }
    }
}

/// An evaluator does again only what depends on a changed unknown; its numbers are those of the program.
#[test]
fn an_evaluator_that_moves_repeats_the_program_bit_by_bit() {
    use crate::expression::{DIRECTIONS, Evaluator};
    use crate::math::random::{Stream, uniform};
    let mut scope = scope(&["t", "k", "c", "x", "v"]);
    scope.define("force", "interpolate(t, [0, 1, 2, 3], [0, 2, -1, 1])").unwrap();
    scope.define("spring", "(2 * pi * k)^2 * sign(x) * abs(x)^1.5").unwrap();
    scope.define("up", "v").unwrap();
    scope
        .define("on", "force - spring - if(v > 0, c * v^2, c * log1p(abs(v))) + max(x, 3 * t) / v")
        .unwrap();
    scope.define("constant", "2").unwrap();
    let program = scope.compile(&["up", "on", "constant"]).unwrap();
    let mut evaluator = Evaluator::new(&program);
    let pattern = evaluator.prepare(&[false, true, true, true, true], 5).unwrap();
    assert_eq!(pattern, [vec![4], vec![1, 2, 3, 4], vec![]]);
    let mut rng = Stream::root(5).generator();
    let mut point = [0.5, 1.5, 0.3, 0.0, 0.0];
    for step in 0..200 {
        // Zero among the values: at x = 0 and v = 0 slopes are infinite or undefined.
        for (i, x) in point.iter_mut().enumerate() {
            if step % (i + 1) == 0 {
                *x = if step % 7 == i { 0.0 } else { 4.0 * uniform(&mut rng) - 1.0 };
            }
        }
        evaluator.at(&point);
        let mut values = [0.0; 3];
        evaluator.values(&mut values);
        let mut derivatives = [0.0; 5];
        evaluator.derivatives(&mut derivatives);
        let unit = |j: usize| std::array::from_fn::<f64, 5, _>(|i| if i == j { 1.0 } else { 0.0 });
        let single = |i: usize, j: usize| program.push_forward(&point, &unit(j)).1[i];
        let places =
            pattern.iter().enumerate().flat_map(|(i, row)| row.iter().map(move |j| (i, *j)));
        for (found, (i, j)) in derivatives.iter().zip(places) {
            let expected = single(i, j);
            let both = found.is_nan() && expected.is_nan() || *found == expected;
            assert!(both || near(*found, expected, 1e-14), "{i} by {j}: {found}, {expected}");
        }
        let lanes = std::array::from_fn(|_| 2.0 * uniform(&mut rng) - 1.0);
        let mut directions = [lanes; 5];
        directions[step % 5] = [0.0; DIRECTIONS];
        directions[(step + 1) % 5][0] = 0.0;
        let mut slopes = [[0.0; DIRECTIONS]; 3];
        evaluator.slopes_together(&directions, &mut slopes);
        for l in 0..DIRECTIONS {
            let direction: Vec<f64> = directions.iter().map(|lanes| lanes[l]).collect();
            let (expected, pushed) = program.push_forward(&point, &direction);
            let mut own = [0.0; 3];
            evaluator.slopes(&direction, &mut own);
            for i in 0..3 {
                assert_eq!(values[i].to_bits(), expected[i].to_bits(), "{i} at {point:?}");
                assert_eq!(slopes[i][l].to_bits(), pushed[i].to_bits(), "{i} at {point:?}");
                assert_eq!(own[i].to_bits(), pushed[i].to_bits(), "{i} at {point:?}");
            }
        }
    }
}
