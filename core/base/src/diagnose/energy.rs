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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::normal;

    fn sample(count: usize, shift: f64, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = Stream::root(seed).generator();
        (0..count).map(|_| vec![shift + normal(&mut rng), normal(&mut rng)]).collect()
    }

    /// For one number, `2 E|X - Y| - E|X - X'| - E|Y - Y'|` is `2 int (F - G)^2` (Székely and Rizzo, equation 2.5).
    #[test]
    fn the_coefficient_is_that_of_the_distribution_functions() {
        let (a, b) = (vec![vec![0.0], vec![1.0]], vec![vec![0.5], vec![2.0]]);
        // F - G is 0.5 on [0, 0.5) and on [1, 2), and 0 on [0.5, 1).
        let squared: f64 = 2.0 * (0.25 * 0.5 + 0.25 * 1.0);
        let between = 2.0 * (0.5 + 2.0 + 0.5 + 1.0) / 4.0;
        let found = energy(&a, &b, &Stream::root(1)).coefficient;
        assert!((found - (squared / between).sqrt()).abs() < 1e-14, "{found}");
    }

    #[test]
    fn a_shift_is_found_and_equality_is_not_refuted() {
        let equal = energy(&sample(200, 0.0, 1), &sample(200, 0.0, 2), &Stream::root(3));
        let shifted = energy(&sample(200, 0.0, 1), &sample(200, 1.0, 2), &Stream::root(3));
        assert!(equal.probability > 0.05 && equal.coefficient < 0.1, "{equal:?}");
        assert!(shifted.probability <= 0.01 && shifted.coefficient > 0.2, "{shifted:?}");
    }

    /// The probability is uniform if both samples have one distribution: below 0.1 in a tenth of 200 cases.
    #[test]
    fn the_probability_holds_its_level() {
        let below = |k: u64| {
            energy(&sample(20, 0.0, 2 * k), &sample(20, 0.0, 2 * k + 1), &Stream::root(k))
                .probability
                <= 0.1
        };
        let share = (0..200).filter(|&k| below(k)).count() as f64 / 200.0;
        assert!((share - 0.1).abs() < 4.0 * (0.09_f64 / 200.0).sqrt(), "{share}");
    }
}
