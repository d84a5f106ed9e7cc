//! Restricted likelihood by Vecchia's approximation.

use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna_linalg::{Matrix, multiply, solve_lower, solve_lower_matrix, vector};
use rayon::prelude::*;

use super::super::factor::{JITTERS, WhiteTrend, column_squares, without};
use super::super::kernel::Kernel;
use super::super::likelihood::{
    Hyperparameters, Restricted, Scored, Slopes, measured, restricted, value_and_gradient,
};
use super::order::Neighbours;
use super::precision::{Block, CHUNK, Precision};

/// [`Restricted`] with the density of each run given its neighbours in place of that given all runs before it
/// (Vecchia 1988), so that its cost is linear in the number of runs.
///
/// The trend's coefficients are integrated out and the variances profiled as in the exact likelihood, with which it
/// agrees if all runs before a run are its neighbours. If the neighbours hold the blocks of some runs alone, it is the
/// likelihood of these runs given their neighbours. Its gradient is exact: that of the whitened scores of each block
/// (Guinness, Statistics and Computing 31 (2021) 25).
#[derive(Debug, Clone, Copy)]
pub struct Nearby<'a> {
    /// Scores, trend, kernel and bounds.
    pub whole: Restricted<'a>,
    /// Neighbours of the runs.
    pub neighbours: &'a Neighbours,
}

/// Generalised least squares with the approximate precision.
pub struct Solved<'a> {
    /// Factor of the precision.
    pub precision: Precision<'a>,
    /// Factors of the trend.
    pub trend: WhiteTrend,
    /// Coefficients of the trend (`p x C`).
    pub beta: Matrix,
    /// Restricted log-likelihood.
    pub value: f64,
    /// Variance of each process.
    pub variances: Vec<f64>,
    /// Nugget with the jitter that the factorisation needed.
    pub nugget: f64,
}

impl<'a> Solved<'a> {
    /// Solves for scores (`N x C`) and trend (`N x p`) at points in length scales, with the least jitter that permits
    /// it; `None` if none does, or the columns of the trend are dependent.
    pub fn new(
        kernel: Kernel,
        points: &Matrix,
        neighbours: &'a Neighbours,
        nugget: f64,
        trend: &Matrix,
        scores: &Matrix,
    ) -> Option<Self> {
        if neighbours.count() <= trend.columns() {
            return None;
        }
        let factored = |jitter: &f64| {
            let nugget = nugget + jitter;
            Some((Precision::new(kernel, points, neighbours, nugget)?, nugget))
        };
        let (precision, nugget) = JITTERS.iter().find_map(factored)?;
        let own = WhiteTrend::new(&precision.whitened(trend))?;
        let (white, along) = without(&own.q, precision.whitened(scores));
        let free = (neighbours.count() - trend.columns()) as f64;
        let determinants = precision.log_determinant + own.log_information;
        let (value, variances) = restricted(free, determinants, &column_squares(&white));
        let beta = multiply(&own.r_inverse, &along);
        Some(Self { precision, trend: own, beta, value, variances, nugget })
    }

    /// Returns the restricted log-likelihood and variances with the quadratic forms `r' K^-1 r` of the residuals `r`
    /// (`C x N`) and their weights `K^-1 r`, which the exact covariance gives.
    pub fn restricted(&self, free: f64, residuals: &Matrix, alpha: &Matrix) -> (f64, Vec<f64>) {
        let rows = residuals.iter_rows().zip(alpha.iter_rows());
        let squares: Vec<f64> = rows.map(|(r, a)| vector::dot(r, a)).collect();
        let determinants = self.precision.log_determinant + self.trend.log_information;
        restricted(free, determinants, &squares)
    }
}

impl Nearby<'_> {
    fn solved(&self, place: &Matrix, nugget: f64) -> Option<Solved<'_>> {
        let Restricted { kernel, trend, scores, .. } = self.whole;
        Solved::new(kernel, place, self.neighbours, nugget, trend, scores)
    }

    /// Returns the log-likelihood alone; minus infinity if the covariance cannot be factored.
    pub fn value(&self, point: &[f64]) -> f64 {
        let Hyperparameters { length_scales, nugget } = self.whole.at(point);
        let place = measured(self.whole.points, &length_scales);
        self.solved(&place, nugget).map_or(f64::NEG_INFINITY, |solved| solved.value)
    }

    /// Returns the sums of a part of the runs.
    fn part(&self, chunk: usize, moved: &Moved<'_>) -> Option<Sums> {
        let last = self.neighbours.count().min((chunk + 1) * CHUNK);
        let mut sums = Sums::new(Target::dimension(self), moved.scores, moved.columns.columns());
        for k in chunk * CHUNK..last {
            let block = self.neighbours.block(k);
            let local = Block::new(self.whole.kernel, moved.points, block, moved.jittered)?;
            sums.add(&local, block, moved);
        }
        Some(sums)
    }
}

/// Arguments of the derivatives that all blocks have in common.
struct Moved<'a> {
    /// Runs in length scales, one per column.
    points: &'a Matrix,
    /// Nugget, and the same with the jitter that the factorisation needed.
    nugget: f64,
    jittered: f64,
    /// Number of columns that are residuals of scores; the others are directions of the trend.
    scores: usize,
    /// `(Y - F beta)_c / s_c`, then `F R^-1` (`N x (C + p)`).
    columns: Matrix,
}

/// Sums over blocks, by the logarithms of length scales and nugget.
struct Sums {
    scores: usize,
    gradient: Vec<f64>,
    /// Inner products of each whitened residual with its derivative (`hyperparameters x components`).
    along: Matrix,
    /// Inner products of the derivatives of the whitened residuals, summed over the components.
    products: Matrix,
    /// Sums of the relative derivatives of the conditional variances, and of their products.
    slopes: Vec<f64>,
    squares: Matrix,
    /// Derivatives of the whitened columns of one block (`hyperparameters x columns`).
    changes: Matrix,
}

impl Sums {
    fn new(count: usize, scores: usize, columns: usize) -> Self {
        Self {
            scores,
            gradient: vec![0.0; count],
            along: Matrix::zeros(count, scores),
            products: Matrix::zeros(count, count),
            slopes: vec![0.0; count],
            squares: Matrix::zeros(count, count),
            changes: Matrix::zeros(count, columns),
        }
    }

    /// Adds the block of one run.
    ///
    /// With the factor `L` of the block, the derivative of `L^-1 z` is `-G L^-1 z`, where `G` is the lower triangle of
    /// `L^-1 dK L^-T` with half of its diagonal; its last row follows from the last row of `L^-1` alone.
    fn add(&mut self, local: &Block, block: &[u32], moved: &Moved<'_>) {
        let columns = moved.columns.columns();
        let mut white =
            Matrix::from_fn(block.len(), columns, |j, c| moved.columns[(block[j] as usize, c)]);
        let lower = local.cholesky.lower();
        solve_lower_matrix(lower, &mut white);
        let last = block.len() - 1;
        let count = self.gradient.len();
        let mut turns = vec![0.0; count];
        for (a, turn) in turns.iter_mut().enumerate() {
            let mut row = local.change(a, moved.nugget);
            solve_lower(lower, &mut row);
            *turn = row[last];
            row[last] *= 0.5;
            let change = self.changes.row_mut(a);
            change.fill(0.0);
            row.iter().enumerate().for_each(|(j, g)| vector::add_scaled(change, -g, white.row(j)));
        }
        let white = white.row(last);
        for (a, &turn) in turns.iter().enumerate() {
            let change = self.changes.row(a);
            let slope: f64 = white.iter().zip(change).map(|(w, c)| w * c).sum();
            // A direction of the trend enters once for each component.
            let own = self.scores;
            let of_scores: f64 = white[..own].iter().zip(&change[..own]).map(|(w, c)| w * c).sum();
            let of_trend = slope - of_scores;
            self.gradient[a] -= of_scores + own as f64 * (of_trend + 0.5 * turn);
            for c in 0..own {
                self.along[(a, c)] += white[c] * change[c];
            }
            self.slopes[a] += turn;
            for (b, other) in turns.iter().enumerate().take(a + 1) {
                let others = self.changes.row(b);
                let product = change[..own].iter().zip(&others[..own]).map(|(x, y)| x * y);
                self.products[(a, b)] += product.sum::<f64>();
                self.squares[(a, b)] += turn * other;
            }
        }
    }

    fn join(&mut self, other: &Self) {
        vector::add_scaled(&mut self.gradient, 1.0, &other.gradient);
        vector::add_scaled(&mut self.slopes, 1.0, &other.slopes);
        for (own, part) in [
            (&mut self.along, &other.along),
            (&mut self.products, &other.products),
            (&mut self.squares, &other.squares),
        ] {
            vector::add_scaled(own.as_mut_slice(), 1.0, part.as_slice());
        }
    }

    /// Returns the information: `sum_c [D_c' D_c - (D_c' w_c) (D_c' w_c)' / (N - p)] + C / 4 [T' T - (T' 1) (T' 1)' / N]`
    /// with the whitened residuals `w_c`, their derivatives `D_c` and the relative derivatives `T` of the conditional
    /// variances. Both parts are positive semidefinite. Its mean is, up to the order of `1 / N`, the Fisher information of the
    /// hyperparameters with the variances profiled out; like the average information it follows the data if these are no realisation of the
    /// process.
    fn information(&self, free: f64, runs: usize) -> Matrix {
        let components = self.scores as f64;
        Matrix::from_fn(self.gradient.len(), self.gradient.len(), |i, j| {
            let (a, b) = (i.max(j), i.min(j));
            let along = vector::dot(self.along.row(a), self.along.row(b)) / free;
            let slopes = self.slopes[a] * self.slopes[b] / runs as f64;
            self.products[(a, b)] - along + 0.25 * components * (self.squares[(a, b)] - slopes)
        })
    }
}

impl Block {
    /// Returns `dK w`, with `w` the weights and `dK` the derivative by the logarithm of a length scale or, after these,
    /// of the nugget.
    fn change(&self, a: usize, nugget: f64) -> Vec<f64> {
        let mut change = vec![0.0; self.weights.len()];
        if a == self.points.rows() {
            change.iter_mut().zip(&self.weights).for_each(|(c, w)| *c = nugget * w);
            return change;
        }
        let place = self.points.row(a);
        for i in 1..place.len() {
            let (own, mut sum) = (self.weights[i], 0.0);
            for (j, slope) in self.slopes.row(i)[..i].iter().enumerate() {
                let entry = slope * (place[i] - place[j]) * (place[i] - place[j]);
                sum += entry * self.weights[j];
                change[j] += entry * own;
            }
            change[i] += sum;
        }
        change
    }
}

impl Scored for Nearby<'_> {
    fn slopes(&self, point: &[f64]) -> Option<Slopes> {
        let Hyperparameters { length_scales, nugget } = self.whole.at(point);
        let place = measured(self.whole.points, &length_scales);
        let Solved { trend, beta, value, variances, nugget: jittered, .. } =
            self.solved(&place, nugget)?;
        let fitted = multiply(self.whole.trend, &beta);
        let directions = multiply(self.whole.trend, &trend.r_inverse);
        let scores = variances.len();
        let columns = Matrix::from_fn(fitted.rows(), scores + directions.columns(), |i, c| match c
            .checked_sub(scores)
        {
            None => (self.whole.scores[(i, c)] - fitted[(i, c)]) / variances[c].sqrt(),
            Some(t) => directions[(i, t)],
        });
        let moved = Moved { points: &place, nugget, jittered, scores, columns };
        let chunks = self.neighbours.count().div_ceil(CHUNK);
        let parts = (0..chunks).into_par_iter().map(|chunk| self.part(chunk, &moved));
        let parts: Option<Vec<Sums>> = parts.collect();
        let mut sums = Sums::new(Target::dimension(self), scores, moved.columns.columns());
        parts?.iter().for_each(|part| sums.join(part));
        let blocks = self.neighbours.count();
        let information = sums.information((blocks - directions.columns()) as f64, blocks);
        Some(Slopes { value, gradient: sums.gradient, information })
    }

    fn length_scales(&self) -> usize {
        self.whole.points.rows()
    }
}

impl Target for Nearby<'_> {
    fn dimension(&self) -> usize {
        Target::dimension(&self.whole)
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|point| self.value(point)).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        value_and_gradient(self.slopes(point), point.len())
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        Target::bounds(&self.whole)
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.whole.prior_draws(count, stream)
    }
}
