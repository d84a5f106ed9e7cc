//! The energy distance of two samples (Székely and Rizzo, J. Statistical Planning and Inference 143 (2013) 1249).

use crate::math::random::{Stream, permutation};

/// The distance of two samples, and the probability of a larger one if both have the same distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Square root of `(2 E|X - Y| - E|X - X'| - E|Y - Y'|) / (2 E|X - Y|)`: from 0 for equal distributions to 1.
    pub coefficient: f64,
    /// Share of random permutations of the pooled samples with a larger coefficient.
    pub probability: f64,
}

/// Number of random permutations.
const PERMUTATIONS: u64 = 99;

/// Compares two samples of points.
pub fn energy(a: &[Vec<f64>], b: &[Vec<f64>], stream: &Stream) -> Energy {
    let all: Vec<&Vec<f64>> = a.iter().chain(b).collect();
    let n = all.len();
    let distance =
        |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
    let distances: Vec<f64> = all.iter().flat_map(|x| all.iter().map(|y| distance(x, y))).collect();
    let coefficient = |order: &[usize]| {
        let mean = |from: &[usize], to: &[usize]| {
            let row = |&i: &usize| to.iter().map(|j| distances[i * n + j]).sum::<f64>();
            let sum: f64 = from.iter().map(row).sum();
            sum / (from.len() * to.len()) as f64
        };
        let (first, second) = order.split_at(a.len());
        let between = 2.0 * mean(first, second);
        ((between - mean(first, first) - mean(second, second)).max(0.0) / between).sqrt()
    };
    let own = coefficient(&(0..n).collect::<Vec<_>>());
    let permuted = |k: u64| coefficient(&permutation(&mut stream.at(k).generator(), n));
    let larger = (0..PERMUTATIONS).filter(|&k| permuted(k) >= own).count();
    let probability = (larger + 1) as f64 / (PERMUTATIONS + 1) as f64;
    Energy { coefficient: own, probability }
}
