//! The library's answer to a change, by linearisation: how much of it the best candidate could explain.

use lacuna::plugin::effect::Situation;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix};
use serde::{Deserialize, Serialize};

use crate::gap::candidates::{Candidate, place, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::Fit;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{Projection, slopes};

/// The share of a change from which on a candidate that explains it is near to it. A verdict asks as much of an effect
/// that is like what is missing.
pub const NEAR: f64 = 0.6;

/// Candidates whose shares differ by no more than this are equally near.
const EQUAL: f64 = 0.05;

/// A ridge relative to the diagonal of the Gram matrix of one candidate, which has no inverse where sensors show nothing.
const RIDGE: f64 = 1e-9;

/// The candidates that come nearest to a change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Nearest {
    /// The share of the squared whitened length of the change, off the slopes of the parameters, that the best candidate
    /// explains with a size of its own on each sensor.
    pub explained: f64,
    /// The types that explain nearly as much, the best first; empty if that is less than 0.6 of it.
    pub types: Vec<String>,
    /// The squared whitened length that the best candidate leaves with one size on all sensors on which the change acts:
    /// the part that shows that its form is another one, in squared standard deviations.
    pub left: f64,
}

/// One candidate at one setting of its indices.
struct Column {
    kind: String,
    /// The whitened slope by its size, one value an output.
    white: Vec<f64>,
    /// The inner products of its parts on the sensors, off the slopes of the parameters.
    gram: Matrix,
    factor: Cholesky,
}

/// The derivatives of all candidates by their sizes, whitened and off the slopes of the parameters.
pub struct Screen {
    columns: Vec<Column>,
    whitener: Whitener,
    projection: Projection,
    /// The index of the sensor at each output; `None` where nothing is measured.
    sensor: Vec<Option<usize>>,
    /// The index of the sensor of each curve.
    of_curve: Vec<usize>,
}

impl Screen {
    /// The candidates at a fit without effects.
    pub fn of(
        experiment: &Experiment<'_>,
        candidates: &[Candidate],
        fit: &Fit,
        noise: &Noise,
    ) -> Self {
        let response = &fit.at.response;
        let system = System::new(experiment, Vec::new());
        let whitener = Whitener::new(experiment, noise, response);
        let projection = Projection::of(&system, fit);
        let places = sensors(experiment);
        let index = |curve| places.iter().position(|on| *on == place(curve)).unwrap_or(0);
        let of_curve: Vec<usize> = experiment.curves.iter().map(index).collect();
        let mut sensor = vec![None; experiment.outputs()];
        for (curve, s) in experiment.curves.iter().zip(&of_curve) {
            curve.measured.iter().for_each(|&i| sensor[i] = Some(*s));
        }
        let sd = noise.sd(experiment, response);
        let situation = Situation { layouts: experiment.layouts, response, noise: &sd };
        let mut screen = Self { columns: Vec::new(), whitener, projection, sensor, of_curve };
        for candidate in candidates {
            for (_, slope) in slopes(&system, fit, candidate, &situation) {
                let column = screen.column(&candidate.kind, &slope, places.len().max(1));
                screen.columns.extend(column);
            }
        }
        screen
    }

    fn column(&self, kind: &str, slope: &[f64], sensors: usize) -> Option<Column> {
        let row = Matrix::from_rows(slope.len(), [slope]);
        let white = self.whitener.whiten_rows(&row).into_vec();
        let part = |s: usize| -> Vec<f64> {
            let own = white.iter().zip(&self.sensor);
            own.map(|(x, sensor)| if *sensor == Some(s) { *x } else { 0.0 }).collect()
        };
        let parts = Matrix::from_rows(white.len(), (0..sensors).map(part));
        let (left, _) = self.projection.rest_of_rows(parts);
        let gram = Matrix::from_fn(sensors, sensors, |s, t| dot(left.row(s), left.row(t)));
        let largest = (0..sensors).map(|s| gram[(s, s)]).fold(0.0, f64::max);
        let ridged = Matrix::from_fn(sensors, sensors, |s, t| {
            gram[(s, t)] + if s == t { RIDGE * largest } else { 0.0 }
        });
        let factor = Cholesky::new(&ridged).ok().filter(|_| largest > 0.0)?;
        Some(Column { kind: kind.to_owned(), white, gram, factor })
    }

    /// The candidates that come nearest to a change of the response, one value an output in its unit, which acts on these
    /// curves; `None` if nothing of it is left off the slopes of the parameters.
    pub fn nearest(&self, change: &[f64], acts: &[bool]) -> Option<Nearest> {
        let white = self.whitener.whiten_rows(&Matrix::from_rows(change.len(), [change]));
        let (rest, _) = self.projection.rest_of_rows(white);
        let rest = rest.row(0);
        let whole = dot(rest, rest);
        if whole.is_nan() || whole <= 0.0 {
            return None;
        }
        let sensors = self.of_curve.iter().max().map_or(1, |last| last + 1);
        let mut touched = vec![false; sensors];
        for (s, acts) in self.of_curve.iter().zip(acts) {
            touched[*s] |= acts;
        }
        let mut shares: Vec<(&str, f64)> = Vec::new();
        let mut left = whole;
        for column in &self.columns {
            let mut products = vec![0.0; column.gram.rows()];
            for ((x, r), sensor) in column.white.iter().zip(rest).zip(&self.sensor) {
                if let Some(s) = sensor {
                    products[*s] += x * r;
                }
            }
            let share = (column.factor.quadratic(&products) / whole).clamp(0.0, 1.0);
            match shares.iter_mut().find(|(kind, _)| *kind == column.kind) {
                Some((_, best)) => *best = best.max(share),
                None => shares.push((&column.kind, share)),
            }
            left = left.min(whole - column.with_one_size(&products, &touched));
        }
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        let explained = shares.first().map_or(0.0, |(_, share)| *share);
        let least = NEAR.max(explained - EQUAL);
        let near = shares.iter().filter(|(_, share)| *share >= least);
        let types = near.map(|(kind, _)| (*kind).to_owned()).collect();
        Some(Nearest { explained, types, left: left.max(0.0) })
    }
}

impl Column {
    /// The squared length that it explains with one size on these sensors.
    fn with_one_size(&self, products: &[f64], touched: &[bool]) -> f64 {
        let own: Vec<usize> = (0..products.len()).filter(|&s| touched[s]).collect();
        let along: f64 = own.iter().map(|&s| products[s]).sum();
        let length: f64 = own
            .iter()
            .flat_map(|&s| own.iter().map(move |&t| (s, t)))
            .map(|at| self.gram[at])
            .sum();
        if length > 0.0 { along * along / length } else { 0.0 }
    }
}
