//! Curves for the tests of effects.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use lacuna::data::{Axis, Layout, Unit};
use lacuna::plugin::{Effect, registry};

/// An effect from its options.
pub fn effect(name: &str, options: &str) -> Box<dyn Effect> {
    registry::from_text::<dyn Effect>(name, options).unwrap_or_else(|e| panic!("{e}")).plugin
}

/// One curve over these times.
pub fn curve(times: Vec<f64>) -> Layout {
    let seconds = Unit::parse("s").unwrap();
    let axes = vec![Axis::grid("time", times, seconds)];
    Layout { name: "y".into(), unit: Unit::parse("m").unwrap(), axes }
}

/// So many times, a step apart, from zero on.
pub fn even(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|i| step * i as f64).collect()
}

/// Times that are a step apart in the mean, each step between half and one and a half of that.
pub fn uneven(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|i| step * (i as f64 + 0.25 * (1.7 * i as f64).sin())).collect()
}

/// The largest difference from a formula, over points of these indices.
pub fn largest(
    found: &[f64],
    times: &[f64],
    range: std::ops::Range<usize>,
    exact: impl Fn(f64) -> f64,
) -> f64 {
    range.map(|i| (found[i] - exact(times[i])).abs()).fold(0.0, f64::max)
}
