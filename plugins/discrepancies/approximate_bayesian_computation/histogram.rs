//! The Jensen-Shannon divergence between smoothed histograms.
//!
//! Each point is a normal density of standard deviation `width`, whose probabilities of the bins are added; the first
//! and the last bin are open. The probabilities are smooth functions of the values.

use std::f64::consts::TAU;

use lacuna::math::special::normal_cdf;
use lacuna_linalg::Matrix;

/// Number of bins of the values, and along each direction of a plane.
const BINS: usize = 50;
const BINS_OF_PLANE: usize = 20;

/// Probabilities of the data's bins.
#[derive(Debug, Clone)]
pub(super) struct Histogram {
    /// Probability of each bin of the coordinate, `points x bins`; a single one without a coordinate.
    across: Matrix,
    edges: Vec<f64>,
    width: f64,
    data: Vec<f64>,
}

impl Histogram {
    pub fn new(coordinate: Option<&[f64]>, data: &[f64], width: f64) -> Self {
        let bins = if coordinate.is_some() { BINS_OF_PLANE } else { BINS };
        let across = match coordinate {
            None => Matrix::from_fn(data.len(), 1, |_, _| 1.0),
            Some(at) => {
                let edges = edges(at, width, bins);
                let rows: Vec<Vec<f64>> = at.iter().map(|x| masses(&edges, width, *x)).collect();
                Matrix::from_fn(at.len(), bins, |i, b| rows[i][b])
            }
        };
        let mut all = Self { across, edges: edges(data, width, bins), width, data: Vec::new() };
        all.data = all.probabilities(data);
        all
    }

    /// Silverman's width for a normal kernel (Density Estimation (1986), 3.31); `None` if it is zero.
    pub fn silverman(data: &[f64]) -> Option<f64> {
        let n = data.len() as f64;
        let mean = data.iter().sum::<f64>() / n;
        let sd = (data.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let mut sorted = data.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |p: f64| sorted[((n - 1.0) * p).round() as usize];
        let range = (at(0.75) - at(0.25)) / 1.34;
        let spread = if range > 0.0 { sd.min(range) } else { sd };
        let width = 0.9 * spread * n.powf(-0.2);
        (width > 0.0).then_some(width)
    }

    /// Probabilities of the bins of a sample, those of one bin of the coordinate after those of another.
    fn probabilities(&self, values: &[f64]) -> Vec<f64> {
        let bins = self.edges.len() + 1;
        let mut all = vec![0.0; self.across.columns() * bins];
        for (value, across) in values.iter().zip(self.across.iter_rows()) {
            let along = masses(&self.edges, self.width, *value);
            for (row, a) in all.chunks_mut(bins).zip(across) {
                row.iter_mut().zip(&along).for_each(|(p, b)| *p += a * b / values.len() as f64);
            }
        }
        all
    }

    pub fn square(&self, values: &[f64], slopes: Option<&mut [f64]>) -> f64 {
        let simulated = self.probabilities(values);
        let mut by = vec![0.0; simulated.len()];
        let mut divergence = 0.0;
        for ((p, q), by) in self.data.iter().zip(&simulated).zip(&mut by) {
            let middle = 0.5 * (p + q);
            if *p > 0.0 {
                divergence += 0.5 * p * (p / middle).ln();
            }
            // Not a number stays so.
            if *q > 0.0 || q.is_nan() {
                *by = 0.5 * (q / middle).ln();
                divergence += q * *by;
            }
        }
        if let Some(slopes) = slopes {
            self.add_slopes(values, &by, slopes);
        }
        if divergence < 0.0 { 0.0 } else { divergence }
    }

    /// Writes the derivatives by the values, given those by the probabilities of the bins.
    fn add_slopes(&self, values: &[f64], by: &[f64], slopes: &mut [f64]) {
        let bins = self.edges.len() + 1;
        for ((slope, value), across) in slopes.iter_mut().zip(values).zip(self.across.iter_rows()) {
            let density = |edge: &f64| {
                let z = (edge - value) / self.width;
                (-0.5 * z * z).exp() / (self.width * TAU.sqrt())
            };
            let densities: Vec<f64> = self.edges.iter().map(density).collect();
            let of_row = |row: &[f64]| -> f64 {
                // What moves up leaves the bin below an edge for the one above it.
                let moved = densities.iter().zip(row.windows(2));
                moved.map(|(d, pair)| d * (pair[1] - pair[0])).sum()
            };
            let rows = by.chunks(bins).zip(across);
            *slope = rows.map(|(row, a)| a * of_row(row)).sum::<f64>() / values.len() as f64;
        }
    }
}

/// Edges between so many bins: evenly spaced, one width beyond the smallest and the largest value.
fn edges(values: &[f64], width: f64, bins: usize) -> Vec<f64> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min) - width;
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + width;
    let step = (high - low) / (bins - 2) as f64;
    (0..bins - 1).map(|k| low + step * k as f64).collect()
}

/// Probability of each bin under a normal density about a value.
fn masses(edges: &[f64], width: f64, value: f64) -> Vec<f64> {
    let mut below = 0.0;
    let of = |edge: Option<&f64>| edge.map_or(1.0, |edge| normal_cdf((edge - value) / width));
    let mut one = |edge: Option<&f64>| {
        let here = of(edge);
        let mass = here - below;
        below = here;
        mass
    };
    let mut all: Vec<f64> = edges.iter().map(|edge| one(Some(edge))).collect();
    all.push(one(None));
    all
}
