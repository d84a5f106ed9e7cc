//! Mean square and draws of the bias under its prior.

use lacuna::math::moments::log_sum;
use lacuna::math::random::{Stream, uniform};
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply};

use super::orthant::{mean_squares, points, random_points};
use super::prior::Prior;
use crate::discrepancies::common::normal_draw;

/// Number of proposals from which a draw of the functionals is taken, with the probabilities of their weights.
const PROPOSALS: usize = 100;

/// A prior split into the functionals that are not negative and the values given them.
struct Split {
    /// Mean and covariance of the functionals.
    mean: Vec<f64>,
    cholesky: Cholesky,
    /// Weights of the functionals' deviations in the values, `places x functionals`.
    map: Matrix,
    /// Covariance of the values given the functionals.
    rest: Matrix,
}

impl Split {
    fn of(mean: &[f64], covariance: &Matrix, places: usize) -> Option<Self> {
        let mean = &mean[places..];
        let m = mean.len();
        let own = Matrix::from_fn(m, m, |a, b| covariance[(places + a, places + b)]);
        let cholesky = Cholesky::new(&own).ok()?;
        let cross = Matrix::from_fn(m, places, |k, i| covariance[(places + k, i)]);
        let map = cholesky.solve_matrix(&cross).transposed();
        let taken = multiply(&map, &cross);
        let rest = Matrix::from_fn(places, places, |i, j| covariance[(i, j)] - taken[(i, j)]);
        Some(Self { mean: mean.to_vec(), cholesky, map, rest })
    }
}

impl Prior {
    /// Returns the mean square of the bias at each output.
    pub fn mean_squares(&self, hyper: &[f64], outputs: usize) -> Option<Vec<f64>> {
        let values = self.values(hyper)?;
        let mut squares = vec![0.0; outputs];
        let mut known: Vec<(Option<usize>, Vec<f64>)> = Vec::new();
        for block in &self.blocks {
            let found = known.iter().position(|(group, _)| *group == block.group);
            let place = found.unwrap_or(known.len());
            if found.is_none() {
                let own = self.squares_of(block.of(values))?;
                known.push((block.group, own));
            }
            block.outputs.iter().zip(&known[place].1).for_each(|(&i, s)| squares[i] = *s);
        }
        Some(squares)
    }

    fn squares_of(&self, values: (f64, f64)) -> Option<Vec<f64>> {
        let joint = self.joint(&self.grid, values)?;
        let n = self.grid.len();
        if self.conditions() == 0 {
            let one = |i: usize| joint.covariance[(i, i)].max(0.0) + joint.mean[i].powi(2);
            return Some((0..n).map(one).collect());
        }
        let split = Split::of(&joint.mean, &joint.covariance, n)?;
        let drawn = points(&split.mean, &split.cholesky);
        let squares = mean_squares(&drawn, &split.mean, &split.map, &joint.mean[..n]);
        Some(squares.iter().enumerate().map(|(i, s)| s + split.rest[(i, i)].max(0.0)).collect())
    }

    /// Draws a bias of all outputs.
    pub fn draw(&self, hyper: &[f64], outputs: usize, stream: &Stream) -> Option<Vec<f64>> {
        let values = self.values(hyper)?;
        let mut bias = vec![0.0; outputs];
        for (s, block) in self.blocks.iter().enumerate() {
            let own = self.draw_series(block.of(values), &stream.at(s as u64))?;
            block.outputs.iter().zip(own).for_each(|(&i, b)| bias[i] = b);
        }
        Some(bias)
    }

    fn draw_series(&self, values: (f64, f64), stream: &Stream) -> Option<Vec<f64>> {
        let joint = self.joint(&self.grid, values)?;
        constrained_draw(&joint.mean, &joint.covariance, self.grid.len(), stream)
    }
}

/// Draws the first `places` components of a normal vector, given that none of the others is negative.
pub(super) fn constrained_draw(
    mean: &[f64],
    covariance: &Matrix,
    places: usize,
    stream: &Stream,
) -> Option<Vec<f64>> {
    let split = Split::of(mean, covariance, places)?;
    let mut rng = stream.generator();
    let m = split.mean.len();
    let mut moved = vec![0.0; m];
    if m > 0 {
        let cube = Matrix::from_fn(PROPOSALS, m, |_, _| uniform(&mut rng));
        let proposed = random_points(&split.mean, &split.cholesky, &cube);
        let total = log_sum(proposed.log_weights.iter().copied());
        let mut left = uniform(&mut rng);
        let of = |log: &f64| {
            left -= (log - total).exp();
            left <= 0.0
        };
        let chosen = proposed.log_weights.iter().position(of).unwrap_or(PROPOSALS - 1);
        let own = proposed.values.row(chosen).iter().zip(&split.mean);
        moved.iter_mut().zip(own).for_each(|(d, (c, m))| *d = c - m);
    }
    let shifted: Vec<f64> = (0..places).map(|i| mean[i] + dot(split.map.row(i), &moved)).collect();
    normal_draw(&shifted, &split.rest, &stream.named("rest"))
}
