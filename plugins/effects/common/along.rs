//! Outputs that are neighbours along an axis.

use std::collections::BTreeMap;

use lacuna::data::{Axis, Coordinates, Layout};
use lacuna::text::nearest::one_of;
use lacuna::text::problem::Complaints;

/// Value at a place as a weighted sum of the values at three places of an axis: index and weight of each.
pub type Row = [(usize, f64); 3];

/// An axis of a layout, with the stride between its places in a response.
#[derive(Debug, Clone, Copy)]
pub struct Along<'a> {
    /// The axis itself.
    pub axis: &'a Axis,
    stride: usize,
}

impl<'a> Along<'a> {
    /// Returns the axis of this name; `None` if the layout does not have it.
    pub fn new(layout: &'a Layout, name: &str) -> Option<Self> {
        let (position, axis) = layout.axis(name)?;
        let stride = layout.axes[position + 1..].iter().map(Axis::len).product();
        Some(Self { axis, stride })
    }

    /// Response in which the value at each place of the axis is the weighted sum of its row; a place without a row is
    /// unchanged.
    pub fn combine(&self, response: &[f64], rows: &[Option<Row>]) -> Vec<f64> {
        let mut out = response.to_vec();
        self.sums(response, rows, &mut out);
        out
    }

    /// Like [`Along::combine`], but zero at a place without a row: the derivative of the combined response, from rows
    /// of derivatives.
    pub fn combine_slopes(&self, response: &[f64], rows: &[Option<Row>]) -> Vec<f64> {
        let mut out = vec![0.0; response.len()];
        self.sums(response, rows, &mut out);
        out
    }

    fn sums(&self, response: &[f64], rows: &[Option<Row>], out: &mut [f64]) {
        let block = self.stride * rows.len();
        for (out, response) in out.chunks_mut(block).zip(response.chunks(block)) {
            for (out, row) in out.chunks_mut(self.stride).zip(rows) {
                let Some([a, b, c]) = row else { continue };
                let [x, y, z] = [a, b, c].map(|(place, _)| &response[place * self.stride..]);
                for (i, out) in out.iter_mut().enumerate() {
                    *out = a.1 * x[i] + b.1 * y[i] + c.1 * z[i];
                }
            }
        }
    }

    /// Reports an axis that the response does not have.
    pub fn check(layout: &'a Layout, name: &str, complaints: &mut Complaints<'_>) -> Option<Self> {
        let found = Self::new(layout, name);
        if found.is_none() {
            let problem = complaints.at("axis").say(format!("the response has no axis `{name}`"));
            if !layout.axes.is_empty() {
                problem.expected(one_of(layout.axes.iter().map(|axis| axis.name.as_str())));
            }
        }
        found
    }

    /// Reports a label that the axis does not have.
    pub fn check_label(&self, key: &str, label: &str, complaints: &mut Complaints<'_>) {
        if self.axis.position(label).is_some() {
            return;
        }
        let name = &self.axis.name;
        let problem = complaints.at(key).say(match label {
            "" => format!("missing key `{key}`"),
            label => format!("the axis `{name}` has no `{label}`"),
        });
        if let Coordinates::Labels(labels) = &self.axis.coordinates {
            problem.expected(one_of(labels.iter().map(String::as_str)));
        }
    }
}

/// Coordinates of the places of an axis on a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Stations {
    /// Indices and coordinates of the places that have one, sorted by coordinate.
    sorted: Vec<(usize, f64)>,
    places: usize,
}

impl Stations {
    /// Takes the coordinates of labels from `positions`, and those of an axis of numbers from its grid.
    pub fn new(axis: &Axis, positions: &BTreeMap<String, f64>) -> Self {
        let mut sorted: Vec<(usize, f64)> = match &axis.coordinates {
            Coordinates::Grid { values, .. } => values.iter().copied().enumerate().collect(),
            Coordinates::Labels(labels) => {
                let known = |(i, label): (usize, &String)| Some((i, *positions.get(label)?));
                labels.iter().enumerate().filter_map(known).collect()
            }
        };
        sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
        Self { sorted, places: axis.len() }
    }

    /// Number of places with a coordinate.
    pub fn count(&self) -> usize {
        self.sorted.len()
    }

    /// Returns true if two places share a coordinate.
    pub fn coincide(&self) -> bool {
        self.sorted.windows(2).any(|w| w[0].1 >= w[1].1)
    }

    /// Mean distance between neighbours.
    pub fn spacing(&self) -> f64 {
        match (self.sorted.first(), self.sorted.last()) {
            (Some(first), Some(last)) if self.count() > 1 => {
                (last.1 - first.1) / (self.count() - 1) as f64
            }
            _ => 1.0,
        }
    }

    /// Returns for each place of the axis its row of weights: `weights` computes them from the coordinates of two or
    /// three nearby places and that of the place itself. `None` for a place without a coordinate.
    pub fn rows(&self, weights: impl Fn(&[f64], f64) -> [f64; 3]) -> Vec<Option<Row>> {
        let mut rows = vec![None; self.places];
        let near = self.count().min(3);
        if near < 2 {
            return rows;
        }
        for (k, &(place, x)) in self.sorted.iter().enumerate() {
            let begin = k.saturating_sub(1).min(self.count() - near);
            let nearby = &self.sorted[begin..begin + near];
            let mut nodes = [0.0; 3];
            nodes.iter_mut().zip(nearby).for_each(|(node, station)| *node = station.1);
            let mut row = weights(&nodes[..near], x).map(|weight| (place, weight));
            row.iter_mut().zip(nearby).for_each(|(entry, station)| entry.0 = station.0);
            rows[place] = Some(row);
        }
        rows
    }

    /// Reports coordinates that are missing, that belong to no place, or that two places share.
    pub fn check(
        along: &Along<'_>,
        positions: &BTreeMap<String, f64>,
        least: usize,
        complaints: &mut Complaints<'_>,
    ) {
        let found = Self::new(along.axis, positions);
        if matches!(along.axis.coordinates, Coordinates::Labels(_)) {
            for label in positions.keys() {
                along.check_label(&format!("positions.{label}"), label, complaints);
            }
        } else if !positions.is_empty() {
            let name = &along.axis.name;
            complaints.at("positions").say(format!("the axis `{name}` has coordinates of its own"));
        }
        if found.count() < least {
            complaints
                .at("positions")
                .say("too few places on a line to tell how the response changes along it")
                .expected(format!(
                    "the coordinates of at least {least}, such as `positions = {{ A = 0.1, B = 0.2 }}`"
                ))
                .found(found.count());
        } else if found.coincide() {
            complaints.at("positions").say("two places have one coordinate");
        }
    }
}

/// Weights of the values at two or three nodes in their interpolating polynomial at `x` (first row), in its first
/// derivative and in its second derivative (Lagrange).
pub fn lagrange(nodes: &[f64], x: f64) -> [[f64; 3]; 3] {
    let mut weights = [[0.0; 3]; 3];
    for (k, &node) in nodes.iter().enumerate() {
        let others = nodes.iter().enumerate().filter(|(m, _)| *m != k).map(|(_, other)| *other);
        // The product of (x - other) / (node - other) with its first two derivatives.
        let (mut value, mut slope, mut curvature) = (1.0, 0.0, 0.0);
        for other in others {
            let (factor, by) = ((x - other) / (node - other), 1.0 / (node - other));
            curvature = curvature * factor + 2.0 * slope * by;
            slope = slope * factor + value * by;
            value *= factor;
        }
        weights[0][k] = value;
        weights[1][k] = slope;
        weights[2][k] = curvature;
    }
    weights
}
