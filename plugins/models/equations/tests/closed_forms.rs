//! Systems whose solutions are known in closed form.

use super::*;

const OSCILLATOR: &str = r#"
state = { x = "x0", v = 0.0 }
rate = { x = "v", v = "-(k * x + c * v) / m" }
where = { m = "2" }
observe = { x = "x", v = "v", energy = "0.5 * m * v^2 + 0.5 * k * x^2" }
"#;

/// `m x'' + c x' + k x = 0`, `x(0) = x0`, `x'(0) = 0`.
fn oscillation(x0: f64, k: f64, c: f64, m: f64, t: f64) -> (f64, f64) {
    let decay = c / (2.0 * m);
    let omega = (k / m - decay * decay).sqrt();
    let (sin, cos) = (omega * t).sin_cos();
    let fall = x0 * (-decay * t).exp();
    (fall * (cos + decay / omega * sin), -fall * (k / m / omega) * sin)
}

#[test]
fn damped_oscillator() {
    let times = times(20.0, 200);
    let labels = ["energy", "x", "v"];
    let form = |p: &[f64]| {
        let at = |t: &f64| oscillation(p[1], p[0], p[2], 2.0, *t);
        let energy = |(x, v): (f64, f64)| v * v + 0.5 * p[0] * x * x;
        let energies = times.iter().map(|t| energy(at(t)));
        let x = times.iter().map(|t| at(t).0);
        energies.chain(x).chain(times.iter().map(|t| at(t).1)).collect()
    };
    for (method, tolerance) in [("auto", 1e-7), ("bdf", 3e-6), ("esdirk", 3e-6)] {
        let options = format!("{OSCILLATOR}solver = {{ method = \"{method}\" }}");
        let case = case(&options, &["k", "x0", "c"], &labels, &times);
        case.is(&[8.0, 0.3, 0.2], form, tolerance, 10.0 * tolerance);
    }
    let options = format!("{OSCILLATOR}solver = {{ relative_tolerance = 1e-11 }}");
    let case = case(&options, &["k", "x0", "c"], &labels, &times);
    case.is(&[8.0, 0.3, 0.2], form, 1e-9, 1e-8);
}

/// P.-F. Verhulst: `n = K / (1 + (K / n0 - 1) exp(-r t))`.
#[test]
fn logistic_growth() {
    let options = r#"
        state = { n = { start = "n0" } }
        rate = { n = "r * n * (1 - n / capacity)" }
        observe = "n"
    "#;
    let times = times(8.0, 40);
    let case = case(options, &["n0", "r", "capacity"], &[], &times);
    let form = |p: &[f64]| {
        let at = |t: &f64| p[2] / (1.0 + (p[2] / p[0] - 1.0) * (-p[1] * t).exp());
        times.iter().map(at).collect()
    };
    case.is(&[0.02, 1.3, 5.0], form, 1e-7, 1e-6);
}

/// `v = w tanh(g t / w)`, `z = (w² / g) log cosh(g t / w)`, `w = sqrt(m g / b)`.
#[test]
fn free_fall_with_quadratic_drag() {
    let options = r#"
        state = { z = 0.0, v = 0.0 }
        rate = { z = "v", v = "g - b / m * v * abs(v)" }
        observe = { speed = "v", depth = "z" }
    "#;
    let times = times(6.0, 60);
    let case = case(options, &["g", "b", "m"], &["speed", "depth"], &times);
    let form = |p: &[f64]| {
        let w = (p[2] * p[0] / p[1]).sqrt();
        let speeds = times.iter().map(|t| w * (p[0] * t / w).tanh());
        speeds.chain(times.iter().map(|t| w * w / p[0] * (p[0] * t / w).cosh().ln())).collect()
    };
    case.is(&[9.81, 0.4, 1.5], form, 1e-7, 1e-6);
}

/// The invariant `d x - c log x + b y - a log y` of V. Volterra.
#[test]
fn predators_and_prey_keep_their_invariant() {
    let options = r#"
        state = { x = "x0", y = 5.0 }
        rate = { x = "a * x - b * x * y", y = "d * x * y - c * y" }
        where = { b = "0.1", c = "1.5", d = "0.075" }
        observe = "d * x - c * log(x) + b * y - a * log(y)"
    "#;
    let case = case(options, &["a", "x0"], &[], &times(50.0, 500));
    let (a, x0): (f64, f64) = (1.0, 10.0);
    let invariant = |p: &[f64]| 0.075 * p[1] - 1.5 * p[1].ln() + 0.5 - p[0] * 5f64.ln();
    case.is(&[a, x0], |p| vec![invariant(p); 500], 1e-6, 3e-5);
}

/// With the start time as an input: a decay is the same later, and its rates are those of the elapsed time.
#[test]
fn the_start_may_be_unknown() {
    let options = r#"
        start_time = "begin"
        state = { y = "2 * begin" }
        rate = { y = "-y * t" }
        observe = "y"
    "#;
    let times = times(3.0, 6);
    let case = case(options, &["begin"], &[], &times);
    let form = |p: &[f64]| {
        let at = |t: &f64| 2.0 * p[0] * (0.5 * (p[0] * p[0] - t * t)).exp();
        times.iter().map(at).collect()
    };
    case.is(&[0.3], form, 1e-7, 1e-6);
    let late = case.rejected(&[0.8]);
    assert_eq!(late, "the first t, 0.5, is before the start t, 0.8");
}

/// Formulas without states, on two numeric axes with the labels between them.
#[test]
fn formulas() {
    let built = from_text::<dyn Model>(
        "equations",
        "observe = { sum = \"a * x + z\", product = \"exp(-a) * x * z\" }",
    );
    let grid = |name: &str, values: &[f64]| Axis::grid(name, values.to_vec(), unit("1"));
    let axes = vec![
        grid("x", &[1.0, 2.0, 3.0]),
        Axis::labels("what", ["sum", "product"]),
        grid("z", &[10.0, 20.0]),
    ];
    let case = Case {
        model: built.unwrap().plugin,
        names: vec!["a".to_owned()],
        layout: Layout { name: "y".into(), unit: unit("1"), axes },
        scenario: Scenario::default(),
    };
    let form = |p: &[f64]| {
        let mut values = Vec::new();
        for x in [1.0, 2.0, 3.0] {
            values.extend([10.0, 20.0].map(|z| p[0] * x + z));
            values.extend([10.0, 20.0].map(|z| (-p[0]).exp() * x * z));
        }
        values
    };
    case.is(&[0.7], form, 1e-15, 1e-12);
}
