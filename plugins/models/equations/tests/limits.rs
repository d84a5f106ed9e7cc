//! Cases without an answer, scales, and reproducibility.

use super::*;

#[test]
fn a_solution_that_ends() {
    // `y = 1 / (1/y0 - t)` ends at t = 1/y0.
    let options = "state = { y = \"y0\" }\nrate = { y = \"y^2\" }\nobserve = \"y\"";
    let case = case(options, &["y0"], &[], &times(2.0, 10));
    let reason = case.rejected(&[1.0]);
    assert!(reason.starts_with("the integration stopped at t = 0.99999"), "{reason}");
    assert_eq!(case.rejected(&[1.0]), reason);
    assert_eq!(case.values(&[0.1]).len(), 10);
}

#[test]
fn rates_that_are_no_numbers() {
    let options = "state = { y = 1.0 }\nrate = { y = \"-1 / (2 * sqrt(y - a))\" }\nobserve = \"y\"";
    let case = case(options, &["a"], &[], &times(2.0, 10));
    // `y = a + (s - 3t/4)^(2/3)` with `s = (1 - a)^(3/2)` reaches `a` at 4s/3.
    let reason = case.rejected(&[0.5]);
    assert!(reason.starts_with("the integration stopped at t = 0.47"), "{reason}");
    assert_eq!(case.rejected(&[1.0]), "the rate of `y` is -inf at t = 0, y = 1");
    assert_eq!(case.rejected(&[2.0]), "the rate of `y` is NaN at t = 0, y = 1");
    assert_eq!(case.rejected(&[f64::NAN]), "the input `a` is NaN");
}

#[test]
fn values_that_are_no_numbers() {
    let case = case("observe = \"a / (t - 1)\"", &["a"], &[], &[0.5, 1.0, 1.5]);
    assert_eq!(case.rejected(&[2.0]), "what is observed is inf at t = 1");
    let started = super::case(
        "state = { y = \"log(a)\" }\nrate = { y = \"-y\" }\nobserve = { y = \"1 / y\" }",
        &["a"],
        &["y"],
        &[0.5],
    );
    assert_eq!(started.rejected(&[-1.0]), "the start value of `y` is NaN");
    assert_eq!(started.rejected(&[1.0]), "the observed `y` is inf at t = 0.5");
}

#[test]
fn steps_that_are_not_enough() {
    let options = r#"
        state = { x = 1.0, v = 0.0 }
        rate = { x = "v", v = "-x" }
        observe = "x"
        solver = { steps = 500, method = "runge_kutta" }
    "#;
    let reason = case(options, &[], &[], &[1e3]).rejected(&[]);
    assert!(reason.ends_with(": 500 steps are not enough"), "{reason}");
}

/// The rate changes sign at `y = 0` and holds the state there: no function of time solves this.
#[test]
fn a_rate_that_switches_without_end() {
    let options = r#"
        state = { y = 1.0 }
        rate = { y = "-sign(y)" }
        observe = "y"
        solver = { steps = 20000 }
    "#;
    let case = case(options, &[], &[], &times(2.0, 4));
    let reason = case.rejected(&[]);
    assert!(reason.starts_with("the integration stopped at t = 1"), "{reason}");
}

/// A decay with times and states of any size: tolerances follow the states.
#[test]
fn any_scale() {
    let options = "state = { y = 0.0 }\nrate = { y = \"source - y / tau\" }\nobserve = \"y\"";
    for (size, tau) in [(1e-12, 1e-9), (1.0, 1.0), (1e9, 1e12)] {
        let times = times(5.0 * tau, 10);
        let case = case(options, &["source", "tau"], &[], &times);
        let form = |p: &[f64]| {
            let at = |t: &f64| p[0] * p[1] * (1.0 - (-t / p[1]).exp());
            times.iter().map(at).collect::<Vec<f64>>()
        };
        let inputs = [size / tau, tau];
        close(&case.values(&inputs), &form(&inputs), 1e-6, &format!("the values for {tau}"));
        let jacobian = case.jacobian(&inputs);
        let by_source: Vec<f64> = form(&inputs).iter().map(|y| y / inputs[0]).collect();
        close(&jacobian.column(0), &by_source, 1e-6, "the derivative by the source");
    }
}

/// From rest, the last of a chain of integrators grows with the fifth power of the time, `t^5 / 120`: at first no
/// step is short enough for an error that is small relative to it, and its scale is unknown.
#[test]
fn what_begins_at_rest() {
    for scale in [1e-12, 1.0, 1e12] {
        let options = r#"
            state = { a = 0.0, b = 0.0, c = 0.0, d = 0.0, e = 0.0 }
            rate = { a = "push", b = "a", c = "b", d = "c", e = "d" }
            observe = "e"
            solver = { steps = 1000, method = "runge_kutta" }
        "#;
        let times = times(10.0, 20);
        let case = case(options, &["push"], &[], &times);
        let form = |p: &[f64]| times.iter().map(|t| p[0] * t.powi(5) / 120.0).collect();
        case.is(&[scale], form, 1e-7, 1e-6);
    }
}

#[test]
fn the_same_bits_on_any_thread() {
    let options = r#"
        state = { y = 2.0, z = 0.0 }
        rate = { y = "z", z = "mu * (1 - y^2) * z - y" }
        observe = { y = "y", z = "z" }
    "#;
    for mu in [0.5, 500.0] {
        let case = case(options, &["mu"], &["y", "z"], &times(20.0, 50));
        let first = case.values(&[mu]);
        let again: Vec<Vec<f64>> = std::thread::scope(|scope| {
            let spawn = |_| scope.spawn(|| case.values(&[mu]));
            let threads: Vec<_> = (0..4).map(spawn).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(again.iter().all(|values| *values == first));
    }
}

#[test]
fn calls_that_do_not_fit() {
    let case = case("observe = { y = \"a * t\" }", &["a"], &["y"], &[1.0, 2.0]);
    let fatal = |call: &Call<'_>| match case.model.predict(call) {
        Err(EvalError::Fatal(reason)) => reason,
        other => panic!("{other:?}"),
    };
    let call = case.call(&[1.0]);
    let other = Layout { axes: vec![Axis::labels("observed", ["z"])], ..case.layout.clone() };
    assert_eq!(
        fatal(&Call { inputs: &[], ..call }),
        "the equations take 1 inputs and were given 0"
    );
    let reason = fatal(&Call { layout: &other, ..call });
    assert_eq!(reason, "`model.observe.y`: unknown name `t` (help: names that are known: `a`)");
    let axes = vec![Axis::labels("observed", ["z"]), case.layout.axes[1].clone()];
    let other = Layout { axes, ..case.layout.clone() };
    assert_eq!(fatal(&Call { layout: &other, ..call }), "nothing observes `z`");
    let axes = vec![case.layout.axes[1].clone()];
    let other = Layout { axes, ..case.layout.clone() };
    assert!(fatal(&Call { layout: &other, ..call }).contains("0 axes of labels"));
}
