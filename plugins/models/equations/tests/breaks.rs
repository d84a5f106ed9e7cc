//! Discontinuous rates: tables, conditions of time, conditions of states.

use super::*;

/// `x'' + ω² x = F(t)` with piecewise linear force: on each piece, `x = p + q τ + A cos ωτ + B sin ωτ`.
fn forced(omega: f64, at: &[f64], force: &[f64], times: &[f64]) -> Vec<f64> {
    let (mut x, mut v) = (0.0, 0.0);
    let w2 = omega * omega;
    let mut values = Vec::new();
    let mut left = times.iter().peekable();
    for i in 0..at.len() - 1 {
        let (t0, t1) = (at[i], at[i + 1]);
        let slope = (force[i + 1] - force[i]) / (t1 - t0);
        let (p, q) = (force[i] / w2, slope / w2);
        let (a, b) = (x - p, (v - q) / omega);
        let piece = |t: f64| {
            let (sin, cos) = (omega * (t - t0)).sin_cos();
            (p + q * (t - t0) + a * cos + b * sin, q + omega * (b * cos - a * sin))
        };
        while let Some(t) = left.next_if(|t| **t <= t1) {
            values.push(piece(*t).0);
        }
        (x, v) = piece(t1);
    }
    values
}

const FORCED: &str = r#"
state = { x = 0.0, v = 0.0 }
rate = { x = "v", v = "force(t) - omega^2 * x" }
observe = "x"
"#;

#[test]
fn a_table_of_few_points() {
    // A pulse of 2 ms in ten seconds of rest must not be missed.
    let (at, force) = ([0.0, 6.0, 6.001, 6.002, 10.0], [0.0, 0.0, 500.0, 0.0, 0.0]);
    let times = times(10.0, 25);
    for method in ["auto", "bdf", "esdirk"] {
        let options = format!("{FORCED}solver = {{ method = \"{method}\" }}");
        let case = case(&options, &["omega"], &[], &times);
        let case = case.with_table("force", at.to_vec(), force.to_vec());
        case.is(&[3.0], |p| forced(p[0], &at, &force, &times), 1e-5, 1e-4);
    }
}

#[test]
fn a_table_and_a_record_of_a_hundred_thousand_points() {
    let at: Vec<f64> = (0..=100_000).map(|i| 1e-3 * f64::from(i)).collect();
    // A chirp with noise in a fixed pattern.
    let noise = |i: usize| ((i * 7919) % 1000) as f64 / 1000.0 - 0.5;
    let chirp = |(i, t): (usize, &f64)| (0.05 * t * t).sin() + 0.3 * noise(i);
    let force: Vec<f64> = at.iter().enumerate().map(chirp).collect();
    let case = case(FORCED, &["omega"], &[], &at[1..]);
    let case = case.with_table("force", at.clone(), force.clone());
    close(&case.values(&[2.0]), &forced(2.0, &at, &force, &at[1..]), 1e-7, "the values");
    let exact = derivative(&|p: &[f64]| forced(p[0], &at, &force, &at[1..]), &[2.0], 0);
    close(&case.jacobian(&[2.0]).column(0), &exact, 1e-5, "the derivative");
}

/// A push of unknown size, start and duration on a body with friction, `v' = a - v`.
#[test]
fn a_push_of_unknown_length() {
    let options = r#"
        state = { v = 0.0 }
        rate = { v = "if(t >= begin and t < begin + length, a, 0) - v" }
        observe = "v"
    "#;
    let times = times(10.0, 20);
    let case = case(options, &["a", "begin", "length"], &[], &times);
    let form = |p: &[f64]| {
        let at = |t: &f64| {
            let rise = |from: f64| if *t > from { 1.0 - (from - t).exp() } else { 0.0 };
            p[0] * (rise(p[1]) - rise(p[1] + p[2]))
        };
        times.iter().map(at).collect()
    };
    // The second push is much shorter than the spacing of the points; the third starts at one of them.
    for inputs in [[3.0, 1.3, 4.0], [3.0, 7.123, 0.005], [3.0, 1.52, 2.0]] {
        case.is(&inputs, form, 1e-7, 1e-6);
    }
    let at_a_point = form(&[3.0, 1.5, 2.0]);
    close(&case.values(&[3.0, 1.5, 2.0]), &at_a_point, 1e-7, "the values");
}

/// `y' = 1` up to `y = c`, `y' = 3` beyond: the derivative with respect to `c` comes only from the time of the
/// change.
#[test]
fn rates_that_jump_at_a_state() {
    for method in ["auto", "bdf", "esdirk"] {
        let options = format!(
            "state = {{ y = \"y0\" }}\nrate = {{ y = \"if(y < c, 1, 3)\" }}\nobserve = \"y\"\n\
             solver = {{ method = \"{method}\" }}"
        );
        let times = times(4.0, 9);
        let case = case(&options, &["c", "y0"], &[], &times);
        let form = |p: &[f64]| {
            let reach = p[0] - p[1];
            times.iter().map(|t| p[1] + t + 2.0 * (t - reach).max(0.0)).collect()
        };
        case.is(&[1.7, 0.2], form, 1e-6, 1e-5);
    }
}

/// A square wave: `y` rises and falls with slope one between multiples of half a period.
#[test]
fn a_square_wave() {
    let options = r#"
        state = { y = 0.0 }
        rate = { y = "sign(sin(2 * pi * t / period))" }
        observe = "y"
    "#;
    let times = times(10.0, 100);
    let case = case(options, &["period"], &[], &times);
    let form = |p: &[f64]| {
        let at = |t: &f64| {
            let phase = t.rem_euclid(p[0]);
            phase.min(p[0] - phase)
        };
        times.iter().map(at).collect::<Vec<f64>>()
    };
    let period = 1.37;
    close(&case.values(&[period]), &form(&[period]), 1e-7, "the values");
    let slope = |t: &f64| {
        let periods = (t / period).floor();
        if t.rem_euclid(period) < 0.5 * period { -periods } else { periods + 1.0 }
    };
    let slopes: Vec<f64> = times.iter().map(slope).collect();
    close(&case.jacobian(&[period]).column(0), &slopes, 1e-6, "the slopes");
}

/// `y' = -c y + u(t)` with a held input: between two nodes `y = u/c + (y0 - u/c) exp(-c t)`.
#[test]
fn a_held_input_jumps_at_its_nodes() {
    let options = r#"
        state = { y = "y0" }
        rate = { y = "force(t) - c * y" }
        observe = "y"
    "#;
    let at: Vec<f64> = (0..200).map(|i| 0.05 * f64::from(i)).collect();
    let force: Vec<f64> = (0..200).map(|i| f64::from(i * 37 % 11) - 5.0).collect();
    let times: Vec<f64> = (0..77).map(|i| 0.13 * f64::from(i)).collect();
    let case = case(options, &["c", "y0"], &[], &times);
    let case = case.with_curve("force", at.clone(), force.clone(), Interpolation::Hold);
    let form = |p: &[f64]| -> Vec<f64> {
        let [c, mut y] = [p[0], p[1]];
        let mut starts = vec![y];
        for (i, u) in force.iter().enumerate().take(force.len() - 1) {
            let decay = (-c * (at[i + 1] - at[i])).exp();
            y = u / c + (y - u / c) * decay;
            starts.push(y);
        }
        let value = |t: &f64| {
            let i = at.partition_point(|node| node <= t) - 1;
            force[i] / c + (starts[i] - force[i] / c) * (-c * (t - at[i])).exp()
        };
        times.iter().map(value).collect()
    };
    case.is(&[1.7, 0.2], form, 1e-7, 1e-5);
}

/// A smooth input through samples of a sine: `y' = cos(t)` integrates to `sin(t)`, within the error of the spline,
/// `5/384 h^4` times the fourth derivative (Hall and Meyer, Journal of Approximation Theory 16 (1976) 105), integrated.
#[test]
fn a_smooth_input_needs_no_stops() {
    let options = r#"
        state = { y = 0.0 }
        rate = { y = "gain * force(t)" }
        observe = "y"
    "#;
    let step = 0.05;
    let at: Vec<f64> = (0..=200).map(|i| step * f64::from(i)).collect();
    let force: Vec<f64> = at.iter().map(|t| t.cos()).collect();
    let times: Vec<f64> = (0..50).map(|i| 0.2 * f64::from(i)).collect();
    let case = case(options, &["gain"], &[], &times);
    let case = case.with_curve("force", at, force, Interpolation::Spline);
    let form = |p: &[f64]| times.iter().map(|t| p[0] * t.sin()).collect::<Vec<f64>>();
    // Near the ends the condition there adds to the error of the middle.
    let error = 10.0 * 10.0 * 5.0 / 384.0 * step.powi(4);
    case.is(&[1.5], form, error, error);
    let answer = case.model.predict(&case.call(&[1.5])).unwrap();
    let steps = answer.facts.iter().find(|fact| fact.name == "steps").unwrap();
    let steps: usize = steps.value.parse().unwrap();
    assert!(steps < 100, "{steps} steps");
}

/// `x' = speed`, `y' = table(x)`: the table is held, and `x` passes its nodes at `t = node / speed`, so that
/// `y = (sum of value times width) / speed`.
#[test]
fn a_held_table_of_a_state_moves_its_jumps() {
    let options = r#"
        state = { x = 0.0, y = 0.0 }
        rate = { x = "speed", y = "force(x)" }
        observe = "y"
    "#;
    let (at, force) = ([0.0, 1.0, 2.5, 3.5, 9.0], [1.0, -2.0, 4.0, 0.5, 0.0]);
    let times = times(4.0, 9);
    let case = case(options, &["speed"], &[], &times);
    let case = case.with_curve("force", at.to_vec(), force.to_vec(), Interpolation::Hold);
    let form = |p: &[f64]| {
        let until = |x: f64| -> f64 {
            let pieces = at.windows(2).zip(force);
            pieces.map(|(ends, value)| value * (x.min(ends[1]) - ends[0]).max(0.0)).sum()
        };
        times.iter().map(|t| until(p[0] * t) / p[0]).collect()
    };
    case.is(&[1.3], form, 1e-6, 1e-5);
}
