//! Times at which the rates are discontinuous, whatever the states.

use lacuna::expression::Break;

use super::flow::{Flow, Quantity};

/// A time at which the integration stops and restarts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Last time before the discontinuity.
    pub before: f64,
    /// For a jump: the first time after it, and the index of its break.
    pub jump: Option<(f64, usize)>,
}

/// Returns all stops within a time span, in ascending order and without repetition.
pub fn stops(flow: &Flow<'_>, span: (f64, f64), samples: &[f64]) -> Vec<Stop> {
    let mut stops = Vec::new();
    for (index, broken) in flow.system.breaks.iter().enumerate() {
        if !depends_on_states(broken, flow) && broken.quantity.depends_on(0) {
            Crossings::of(broken, flow).find(index, span, samples, &mut stops);
        }
    }
    stops.sort_by(|a, b| {
        let jump = |stop: &Stop| stop.jump.is_none();
        a.before.total_cmp(&b.before).then(jump(a).cmp(&jump(b)))
    });
    stops.dedup_by(|later, earlier| later.before <= earlier.jump.map_or(earlier.before, |j| j.0));
    stops
}

/// Returns true if the position of a break depends on the states.
pub fn depends_on_states(broken: &Break, flow: &Flow<'_>) -> bool {
    let coordinates = flow.system.coordinates();
    (coordinates - flow.system.states.len()..coordinates).any(|i| broken.quantity.depends_on(i))
}

/// Distance on either side of a jump: wide enough that rounding of a step's end cannot reach across it.
fn gap((first, last): (f64, f64)) -> f64 {
    1e-13 * (last - first).max(first.abs()).max(last.abs())
}

/// Search for the times at which the quantity of a break takes its values.
struct Crossings<'a> {
    broken: &'a Break,
    quantity: Quantity<'a>,
    point: Vec<f64>,
}

impl<'a> Crossings<'a> {
    fn of(broken: &'a Break, flow: &Flow<'_>) -> Self {
        let point = flow.point(0.0, &vec![0.0; flow.system.states.len()]);
        Self { broken, quantity: Quantity::new(&broken.quantity), point }
    }

    fn at(&mut self, time: f64) -> f64 {
        self.point[0] = time;
        self.quantity.value(&self.point)
    }

    fn find(&mut self, index: usize, span: (f64, f64), samples: &[f64], stops: &mut Vec<Stop>) {
        let (first, last) = span;
        let (low, high) = (self.at(first), self.at(last));
        let middle = self.at(0.5 * (first + last));
        let straight =
            (middle - 0.5 * (low + high)).abs() <= 1e-12 * low.abs().max(high.abs()) && low != high;
        let jumps = self.broken.jumps;
        if straight && (!jumps || self.broken.at.len() > 1) {
            let time = |value: &f64| first + (value - low) / (high - low) * (last - first);
            let inside = self.broken.at.iter().map(time).filter(|t| first < *t && *t < last);
            let gap = gap((first, last));
            stops.extend(inside.map(|time| {
                if jumps {
                    Stop { before: time - gap, jump: Some((time + gap, index)) }
                } else {
                    Stop { before: time, jump: None }
                }
            }));
        } else if self.broken.at.len() == 1 {
            self.search(index, span, if straight { &[] } else { samples }, stops);
        }
    }

    /// Looks for changes of side between neighbouring samples and their midpoints.
    fn search(
        &mut self,
        index: usize,
        (first, last): (f64, f64),
        samples: &[f64],
        stops: &mut Vec<Stop>,
    ) {
        let value = self.broken.at[0];
        let gap = gap((first, last));
        let inside = samples.iter().copied().filter(|t| first < *t && *t < last);
        let mut left = (first, self.at(first) > value);
        for right in inside.chain([last]) {
            for time in [0.5 * (left.0 + right), right] {
                let side = self.at(time) > value;
                if side != left.1 {
                    let (low, high) = self.edge(value, left.0, time, left.1);
                    let jump = self.broken.jumps.then_some((high + gap, index));
                    stops.push(Stop { before: low - gap, jump });
                }
                left = (time, side);
            }
        }
    }

    /// Returns the neighbouring floating-point numbers between which the quantity changes side.
    fn edge(&mut self, value: f64, mut low: f64, mut high: f64, side: bool) -> (f64, f64) {
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return (low, high);
            }
            if (self.at(middle) > value) == side { low = middle } else { high = middle }
        }
    }
}
