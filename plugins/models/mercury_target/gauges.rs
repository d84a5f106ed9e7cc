//! Strain gauges: conversion of position, direction and averaging length to weights of wall elements.

use super::settings::{Gauge, Place};
use super::shell::Shell;

/// Number of points that represent the length of a gauge.
const POINTS: usize = 16;

/// A gauge on the outer face of the wall.
#[derive(Debug, Clone)]
pub struct Sensor {
    weights: Vec<(usize, f64)>,
    axial: f64,
    hoop: f64,
}

/// The nodes of the wall along the meridian, and the end of the cap.
#[derive(Debug, Clone, Copy)]
pub struct Meridian<'a> {
    /// Coordinates (r, z) of the wall nodes, m, from the apex of the cap.
    pub nodes: &'a [[f64; 2]],
    /// Index of the node at which cap and cylinder meet.
    pub rim: usize,
}

impl Sensor {
    /// The gauge on the given wall. Strains belong to the middle of the elements and are interpolated linearly along
    /// the meridian within the cap or the cylinder; a gauge of length `L` at angle `θ` covers the length `L cos θ` of
    /// the meridian.
    pub fn new(gauge: &Gauge, wall: Meridian<'_>) -> Self {
        let (first, last, axis) = match gauge.place {
            Place::Cap => (0, wall.rim, 0),
            Place::Cylinder => (wall.rim, wall.nodes.len() - 1, 1),
        };
        let nodes = &wall.nodes[first..=last];
        let mut arc = vec![0.0];
        for pair in nodes.windows(2) {
            let step = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            arc.push(arc[arc.len() - 1] + step);
        }
        let middles: Vec<f64> = arc.windows(2).map(|s| 0.5 * (s[0] + s[1])).collect();
        let along: Vec<f64> = nodes.iter().map(|node| node[axis]).collect();
        let centre = interpolate(&along, gauge.position).map(|(k, share)| share * arc[k]);
        let centre: f64 = centre.into_iter().sum();

        let angle = gauge.angle.to_radians();
        let reach = gauge.length * angle.cos().abs();
        let mut weights = vec![0.0; middles.len()];
        for point in 0..POINTS {
            let offset = (point as f64 + 0.5) / POINTS as f64 - 0.5;
            for (k, share) in interpolate(&middles, centre + offset * reach) {
                weights[k] += share / POINTS as f64;
            }
        }
        let weights = weights.into_iter().enumerate().filter(|(_, w)| *w != 0.0);
        Self {
            weights: weights.map(|(k, w)| (first + k, w)).collect(),
            axial: angle.cos().powi(2),
            hoop: angle.sin().powi(2),
        }
    }

    /// Current strain at the gauge, dimensionless.
    pub fn read(&self, shell: &Shell) -> f64 {
        let at = |&(s, weight): &(usize, f64)| {
            let (strain, half) = (shell.strain(s), 0.5 * shell.elements[s].thickness);
            let axial = strain.meridional + half * strain.meridional_bend;
            let hoop = strain.hoop + half * strain.hoop_bend;
            weight * (self.axial * axial + self.hoop * hoop)
        };
        self.weights.iter().map(at).sum()
    }
}

/// The two knots around `x` and their linear weights; constant outside the ascending `knots`.
fn interpolate(knots: &[f64], x: f64) -> [(usize, f64); 2] {
    let last = knots.len() - 1;
    let upper = knots.partition_point(|&knot| knot <= x).clamp(1, last.max(1)).min(last);
    let lower = upper.saturating_sub(1);
    if lower == upper {
        return [(0, 1.0), (0, 0.0)];
    }
    let share = ((x - knots[lower]) / (knots[upper] - knots[lower])).clamp(0.0, 1.0);
    [(lower, 1.0 - share), (upper, share)]
}
