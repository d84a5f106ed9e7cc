//! Outputs that stand beside each other along an axis.

use std::collections::BTreeMap;

use lacuna::data::{Axis, Coordinates, Layout};
use lacuna::study::nearest::one_of;
use lacuna::study::problem::Complaints;

/// The value at a place as a sum over places of an axis, each with its weight.
pub type Row = [(usize, f64); 3];

/// An axis of a layout: how far apart its places stand in a response.
#[derive(Debug, Clone, Copy)]
pub struct Along<'a> {
    /// The axis.
    pub axis: &'a Axis,
    stride: usize,
}

impl<'a> Along<'a> {
    /// The axis of this name, if the layout has it.
    pub fn new(layout: &'a Layout, name: &str) -> Option<Self> {
        let (position, axis) = layout.axis(name)?;
        let stride = layout.axes[position + 1..].iter().map(Axis::len).product();
        Some(Self { axis, stride })
    }

    /// The response in which the values at each place are sums over places of the axis; without a row they stay.
    pub fn combine(&self, response: &[f64], rows: &[Option<Row>]) -> Vec<f64> {
        let mut out = response.to_vec();
        self.sums(response, rows, &mut out);
        out
    }

    /// The same sums, zero without a row.
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

    /// Complains of an axis that the response has not.
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

    /// Complains of a label that the axis has not.
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

/// Where the places of an axis stand on a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Stations {
    /// The places that have a coordinate, with it, in the order of the coordinates.
    sorted: Vec<(usize, f64)>,
    places: usize,
}

impl Stations {
    /// Of labels by their coordinates, or of a grid by its own.
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

    /// How many there are.
    pub fn count(&self) -> usize {
        self.sorted.len()
    }

    /// Whether two share a coordinate.
    pub fn coincide(&self) -> bool {
        self.sorted.windows(2).any(|w| w[0].1 >= w[1].1)
    }

    /// The mean distance between neighbours.
    pub fn spacing(&self) -> f64 {
        match (self.sorted.first(), self.sorted.last()) {
            (Some(first), Some(last)) if self.count() > 1 => {
                (last.1 - first.1) / (self.count() - 1) as f64
            }
            _ => 1.0,
        }
    }

    /// For each place of the axis the sum that `weights` gives, from the coordinates of two or three stations nearby
    /// and that of the place itself; none for a place without coordinate.
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

    /// Complains of coordinates that are missing, of no place, or of two places.
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

/// The weights of the values at two or three nodes in their polynomial at `x`, in its slope and in its curvature.
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
