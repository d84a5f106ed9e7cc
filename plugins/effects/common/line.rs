//! Effects that depend on the variation of the response along a line of places.

use std::collections::BTreeMap;

use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::effect::{Situation, propose};
use toml::{Table, Value};

use super::{Along, Stations};

/// A line: an axis of the response with the coordinates of its places.
#[derive(Debug, Clone, Copy)]
pub struct Line<'a> {
    /// Name of the axis.
    pub axis: &'a str,
    /// Coordinates of the axis labels, in `unit`.
    pub positions: &'a BTreeMap<String, f64>,
    /// Unit of the coordinates.
    pub unit: &'a Unit,
}

impl<'a> Line<'a> {
    /// The axis of a layout with the places on it.
    fn on(&self, layout: &'a Layout) -> Option<(Along<'a>, Stations)> {
        let along = Along::new(layout, self.axis)?;
        Some((along, Stations::new(along.axis, self.positions)))
    }

    /// Response in which each place shows the sum that `weights` gives, from the coordinates of the neighbouring places
    /// and its own; unchanged if the layout has no such line.
    pub fn combined(
        &self,
        layout: &'a Layout,
        response: &[f64],
        weights: impl Fn(&[f64], f64) -> [f64; 3],
    ) -> Vec<f64> {
        match self.on(layout) {
            Some((along, stations)) => along.combine(response, &stations.rows(weights)),
            None => response.to_vec(),
        }
    }

    /// The derivative of [`Line::combined`] by an unknown, in one column, from those of the weights.
    pub fn combined_slopes(
        &self,
        layout: &'a Layout,
        response: &[f64],
        slopes: impl Fn(&[f64], f64) -> [f64; 3],
    ) -> Matrix {
        let column = match self.on(layout) {
            Some((along, stations)) => along.combine_slopes(response, &stations.rows(slopes)),
            None => vec![0.0; response.len()],
        };
        Matrix::from_vec(response.len(), 1, column)
    }

    /// Options of the effect that a search should try: along the places whose coordinates are known, and along every
    /// axis of lengths. `prior` returns the prior of the unknown `key` for the mean distance between places; lines of
    /// fewer than `least` places are skipped.
    pub fn proposals(
        &self,
        situation: &Situation<'_>,
        least: usize,
        key: &str,
        prior: impl Fn(f64) -> Distribution,
    ) -> Vec<Table> {
        let metre = Unit::parse("m").unwrap_or_default();
        let is_length = |axis: &Axis| match &axis.coordinates {
            Coordinates::Grid { unit, .. } => unit.same_dimension(&metre),
            Coordinates::Labels(_) => axis.name == self.axis,
        };
        let mut found: Vec<Table> = Vec::new();
        for axis in situation.layouts.blocks.iter().flat_map(|b| &b.axes).filter(|a| is_length(a)) {
            let stations = Stations::new(axis, self.positions);
            if stations.count() < least || stations.coincide() {
                continue;
            }
            let mut table = propose(&[(key, prior(stations.spacing()))]);
            table.insert("axis".into(), Value::String(axis.name.clone()));
            if matches!(axis.coordinates, Coordinates::Labels(_)) {
                let entry = |(label, x): (&String, &f64)| (label.clone(), Value::Float(*x));
                let positions: Table = self.positions.iter().map(entry).collect();
                table.insert("positions".into(), Value::Table(positions));
                table.insert("unit".into(), Value::String(self.unit.to_string()));
            }
            if !found.iter().any(|other| other.get("axis") == table.get("axis")) {
                found.push(table);
            }
        }
        found
    }
}
