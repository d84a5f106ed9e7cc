//! Increasing maps of an interval onto itself.
//!
//! With `u` from 0 to 1 along the interval the map is
//!
//! ```text
//! w(u) = A(u) / A(1),   A(u) = ∫₀ᵘ exp(g(s)) ds,   g(s) = Σ_k c_k cos(k π s),
//! ```
//!
//! increasing for all coefficients `c_k`. A constant in `g` changes nothing, so that there is none.

use std::f64::consts::PI;

use lacuna::matrix::Matrix;

/// Nodes and weights of Gauss and Legendre's quadrature with four points on [-1, 1].
const QUADRATURE: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// The map at the points of a grid.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Map {
    /// Place to which each point of the grid is mapped, in the unit of the grid; the ends stay.
    pub to: Vec<f64>,
    /// Derivative of each place by each coefficient, `points x coefficients`.
    pub by: Matrix,
}

impl Map {
    /// The map with these coefficients, at the points of an increasing grid of at least two points.
    pub fn new(grid: &[f64], coefficients: &[f64]) -> Self {
        let (first, last) = (grid[0], grid[grid.len() - 1]);
        let pieces = Pieces::new(grid, coefficients);
        let columns = coefficients.len() + 1;
        // Integrals from the first point to each point: of exp(g), then of exp(g) times each cosine.
        let mut sums = Matrix::zeros(grid.len(), columns);
        for i in 1..grid.len() {
            let mut row = sums.row(i - 1).to_vec();
            pieces.add(i - 1, &mut row);
            sums.row_mut(i).copy_from_slice(&row);
        }
        let total = sums.row(grid.len() - 1).to_vec();
        let length = last - first;
        let share = |i: usize| sums[(i, 0)] / total[0];
        let mut to: Vec<f64> = (0..grid.len()).map(|i| first + length * share(i)).collect();
        to[grid.len() - 1] = last;
        let by = Matrix::from_fn(grid.len(), columns - 1, |i, k| {
            length * (sums[(i, k + 1)] - share(i) * total[k + 1]) / total[0]
        });
        Self { to, by }
    }
}

/// Nodes of the quadrature between the points of the grid.
struct Pieces {
    /// Range of the nodes before each point but the first.
    ranges: Vec<std::ops::Range<usize>>,
    /// Weight of each node times the scaled `exp(g)`.
    weights: Vec<f64>,
    /// Cosines at each node, `nodes x coefficients`.
    cosines: Matrix,
}

impl Pieces {
    fn new(grid: &[f64], coefficients: &[f64]) -> Self {
        let (first, length) = (grid[0], grid[grid.len() - 1] - grid[0]);
        let most = 0.25 / coefficients.len().max(1) as f64;
        let (mut ranges, mut weights, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
        for ends in grid.windows(2) {
            let [from, to] = [0, 1].map(|e| (ends[e] - first) / length);
            let count = ((to - from) / most).ceil().max(1.0);
            let half = 0.5 * (to - from) / count;
            let begin = nodes.len();
            for piece in 0..count as usize {
                let middle = from + half * (2 * piece + 1) as f64;
                nodes.extend(QUADRATURE.iter().map(|(x, _)| middle + half * x));
                weights.extend(QUADRATURE.iter().map(|(_, w)| half * w));
            }
            ranges.push(begin..nodes.len());
        }
        let cosines = Matrix::from_fn(nodes.len(), coefficients.len(), |i, k| {
            ((k + 1) as f64 * PI * nodes[i]).cos()
        });
        let sum = |row: &[f64]| row.iter().zip(coefficients).map(|(x, c)| x * c).sum::<f64>();
        let exponents: Vec<f64> = cosines.iter_rows().map(sum).collect();
        // The quotient is the same for every factor of exp(g); this one avoids an overflow.
        let largest = exponents.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        weights.iter_mut().zip(exponents).for_each(|(w, g)| *w *= (g - largest).exp());
        Self { ranges, weights, cosines }
    }

    /// Adds the integrals over the interval after a point.
    fn add(&self, interval: usize, sums: &mut [f64]) {
        for node in self.ranges[interval].clone() {
            let weight = self.weights[node];
            sums[0] += weight;
            for (sum, cosine) in sums[1..].iter_mut().zip(self.cosines.row(node)) {
                *sum += weight * cosine;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::Map;
    use crate::effects::common::testing::uneven;

    /// Modified Bessel functions I0 to I8 at 1, which expand `exp(cos π s)` into cosines (Abramowitz and Stegun (1964),
    /// 9.6.34; the digits from `SciPy`'s `iv`).
    const BESSEL: [f64; 9] = [
        1.266_065_877_752_008_4,
        0.565_159_103_992_485_1,
        0.135_747_669_767_038_3,
        0.022_168_424_924_331_902,
        0.002_737_120_221_046_866,
        2.714_631_559_569_719e-4,
        2.248_866_148_147_573e-5,
        1.599_218_231_200_995e-6,
        9.960_624_033_363_986e-8,
    ];

    #[test]
    fn one_cosine_is_a_series_of_bessel_functions() {
        let grid: Vec<f64> = uneven(9, 0.5).iter().map(|t| t + 3.0).collect();
        let length = grid[8] - grid[0];
        let map = Map::new(&grid, &[1.0]);
        for (t, found) in grid.iter().zip(&map.to) {
            let u = (t - grid[0]) / length;
            let term = |n: usize| BESSEL[n] / BESSEL[0] * (n as f64 * PI * u).sin() / n as f64;
            let expected = u + 2.0 / PI * (1..9).map(term).sum::<f64>();
            assert!(((found - grid[0]) / length - expected).abs() < 1e-9, "{u}");
        }
    }

    /// The warps of the simulated curves of Tucker, Wu and Srivastava (Computational Statistics and Data Analysis 61
    /// (2013) 50), after Kneip and Ramsay (2008): `(exp(a u) - 1) / (exp(a) - 1)`. Their logarithmic rate is a straight
    /// line, whose expansion in cosines is `-4 a / π² Σ cos(k π u) / k²` over odd `k`. The rest after `k` = 7
    /// integrates to less than `4 a / π³ Σ 1/k³` = 5.0e-4, times the largest rate, 1.6.
    #[test]
    fn it_contains_the_warps_of_the_literature() {
        let grid: Vec<f64> = (0..=50).map(|i| 0.02 * f64::from(i)).collect();
        for a in [-1.0_f64, 0.5, 1.0] {
            let term = |k: usize| match k % 2 {
                1 => -4.0 * a / (PI * k as f64).powi(2),
                _ => 0.0,
            };
            let map = Map::new(&grid, &(1..=7).map(term).collect::<Vec<_>>());
            for (u, found) in grid.iter().zip(&map.to) {
                let expected = (a * u).exp_m1() / a.exp_m1();
                assert!((found - expected).abs() < 8e-4, "{a} {u}: {found} {expected}");
            }
        }
    }

    #[test]
    fn it_increases_for_every_coefficient_and_keeps_the_ends() {
        let grid = uneven(40, 0.1);
        for coefficients in [[40.0, -30.0, 25.0], [-2000.0, 0.0, 900.0]] {
            let map = Map::new(&grid, &coefficients);
            assert!(map.to.windows(2).all(|w| w[0] <= w[1]));
            assert_eq!((map.to[0], map.to[39]), (grid[0], grid[39]));
        }
    }
}
