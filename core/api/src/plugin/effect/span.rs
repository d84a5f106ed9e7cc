//! Curves of a response and the times they span.

use lacuna_base::data::{Coordinates, Layout};
use lacuna_base::text::problem::Complaints;
use toml::{Table, Value};

use super::Situation;

/// Grid of the last axis, common to all curves, in the unit of that axis; a single zero if the last axis is not a grid.
pub fn grid(layout: &Layout) -> &[f64] {
    match layout.axes.last().map(|axis| &axis.coordinates) {
        Some(Coordinates::Grid { values, .. }) => values,
        _ => &[0.0],
    }
}

/// First and last time of curves and the shortest step, in the unit of the last axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// First time.
    pub first: f64,
    /// Last time.
    pub last: f64,
    /// Shortest step between neighbouring times.
    pub step: f64,
    /// Number of points of a curve.
    pub count: usize,
}

impl Span {
    /// Returns the span of a layout's curves; `None` if they have fewer than two points.
    pub fn of(layout: &Layout) -> Option<Self> {
        let at = grid(layout);
        let step = at.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        (at.len() >= 2).then(|| Self {
            first: at[0],
            last: at[at.len() - 1],
            step,
            count: at.len(),
        })
    }

    /// Returns the span of all data: earliest time, latest time, shortest step, largest number of points.
    pub fn of_all(situation: &Situation<'_>) -> Option<Self> {
        let all = situation.layouts.blocks.iter().filter_map(Self::of);
        all.reduce(|a, b| Self {
            first: a.first.min(b.first),
            last: a.last.max(b.last),
            step: a.step.min(b.step),
            count: a.count.max(b.count),
        })
    }

    /// Time from the first to the last point.
    pub fn duration(&self) -> f64 {
        self.last - self.first
    }

    /// A fraction of the duration, but at least one step.
    pub fn share(&self, share: f64) -> f64 {
        (share * self.duration()).max(self.step)
    }

    /// Sets `start = 0` in the options of an effect of the pulse if zero lies inside the record; a record that begins
    /// later begins with the effect.
    pub fn add_pulse(&self, options: &mut Table) {
        if self.first < 0.0 && self.last > 0.0 {
            options.insert("start".to_owned(), Value::Float(0.0));
        }
    }

    /// Reports an effect that acts on curves if the response has none.
    pub fn check(layout: &Layout, complaints: &mut Complaints<'_>) {
        if Self::of(layout).is_none() {
            complaints
                .at("use")
                .say("the response has no curves for this effect")
                .expected("a last axis of at least two numbers, such as times");
        }
    }
}

/// Response in which each curve (the values along the last axis) is replaced by the output of `change`, which receives
/// the values of the curve and a slice of zeros to write to.
pub fn each_curve(
    layout: &Layout,
    response: &[f64],
    mut change: impl FnMut(&[f64], &mut [f64]),
) -> Vec<f64> {
    let times = grid(layout).len().max(1);
    let mut out = vec![0.0; response.len()];
    for (values, out) in response.chunks(times).zip(out.chunks_mut(times)) {
        change(values, out);
    }
    out
}
