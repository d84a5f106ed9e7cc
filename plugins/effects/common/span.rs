//! The times that curves span.

use lacuna::data::{Coordinates, Layout};
use lacuna::plugin::effect::Situation;
use lacuna::study::problem::Complaints;
use toml::{Table, Value};

/// The grid of the last axis: that of every curve; one zero where the last axis is no grid.
pub fn grid(layout: &Layout) -> &[f64] {
    match layout.axes.last().map(|axis| &axis.coordinates) {
        Some(Coordinates::Grid { values, .. }) => values,
        _ => &[0.0],
    }
}

/// The first and the last time of curves, and the shortest step between two of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// The first time.
    pub first: f64,
    /// The last time.
    pub last: f64,
    /// The shortest step.
    pub step: f64,
    /// The number of points.
    pub count: usize,
}

impl Span {
    /// Of a layout; `None` where its curves have fewer than two points.
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

    /// Of all data: from the first time of all to the last.
    pub fn of_all(situation: &Situation<'_>) -> Option<Self> {
        let all = situation.layouts.blocks.iter().filter_map(Self::of);
        all.reduce(|a, b| Self {
            first: a.first.min(b.first),
            last: a.last.max(b.last),
            step: a.step.min(b.step),
            count: a.count.max(b.count),
        })
    }

    /// The time from the first to the last.
    pub fn duration(&self) -> f64 {
        self.last - self.first
    }

    /// A share of the duration, though not less than a step.
    pub fn share(&self, share: f64) -> f64 {
        (share * self.duration()).max(self.step)
    }

    /// Says in the options of an effect of a pulse that it begins at zero, where that is inside a record; a record
    /// that does not reach back begins with the pulse.
    pub fn add_pulse(&self, options: &mut Table) {
        if self.first < 0.0 && self.last > 0.0 {
            options.insert("start".to_owned(), Value::Float(0.0));
        }
    }

    /// Complains of an effect on curves where the response has none.
    pub fn check(layout: &Layout, complaints: &mut Complaints<'_>) {
        if Self::of(layout).is_none() {
            complaints
                .at("use")
                .say("the response has no curves for this effect")
                .expected("a last axis of at least two numbers, such as times");
        }
    }
}

/// The response in which each curve, with the values that it had, became what `change` writes.
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
