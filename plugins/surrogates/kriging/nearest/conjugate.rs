//! Solution of the equations of all runs by conjugate gradients.

use lacuna_linalg::Matrix;
use lacuna_linalg::radial::squared_distances;
use lacuna_linalg::vector::{add_scaled, dot};
use rayon::prelude::*;

use super::super::kernel::Kernel;
use super::precision::Precision;

/// Number of runs in a tile of the covariance, which stays in the cache.
const TILE: usize = 128;
/// Number of partial sums, the same on any number of threads.
const PARTS: usize = 8;
/// Number of steps after which the search for a solution is given up.
const MOST: usize = 300;
/// Number of steps from whose rate the number of all steps is extrapolated.
const EARLY: usize = 40;
/// Number of restarts from the residual as computed anew, which removes the rounding errors of the recurrence.
const RESTARTS: usize = 2;

/// Returns points in parts of this many columns.
pub fn tiles(points: &Matrix, size: usize) -> Vec<Matrix> {
    let tile = |first: usize| {
        let columns: Vec<usize> = (first..points.columns().min(first + size)).collect();
        points.select_columns(&columns)
    };
    (0..points.columns()).step_by(size).map(tile).collect()
}

/// Covariance `C + nugget I` of all runs, computed tile by tile whenever it is needed.
pub struct Covariance {
    kernel: Kernel,
    /// Runs in length scales, one per column.
    tiles: Vec<Matrix>,
    nugget: f64,
}

impl Covariance {
    /// The covariance of points in length scales (one per column).
    pub fn new(kernel: Kernel, points: &Matrix, nugget: f64) -> Self {
        Self { kernel, tiles: tiles(points, TILE), nugget }
    }

    /// Returns `X K` for vectors `X` (`vectors x runs`), of which those not `wanted` are left zero.
    fn multiply(&self, x: &Matrix, wanted: &[bool]) -> Matrix {
        let part = |part: usize| {
            let mut sum = Matrix::zeros(x.rows(), x.columns());
            for row in (part..self.tiles.len()).step_by(PARTS) {
                (0..=row).for_each(|column| self.add([row, column], x, wanted, &mut sum));
            }
            sum
        };
        let parts: Vec<Matrix> = (0..PARTS).into_par_iter().map(part).collect();
        let mut product = Matrix::zeros(x.rows(), x.columns());
        for part in &parts {
            add_scaled(product.as_mut_slice(), 1.0, part.as_slice());
        }
        for v in (0..x.rows()).filter(|&v| wanted[v]) {
            add_scaled(product.row_mut(v), self.nugget, x.row(v));
        }
        product
    }

    /// Adds the product with one tile and, off the diagonal, with its transpose.
    fn add(&self, [row, column]: [usize; 2], x: &Matrix, wanted: &[bool], sum: &mut Matrix) {
        let (rows, columns) = (&self.tiles[row], &self.tiles[column]);
        let mut correlations = [0.0; TILE];
        let mut slopes = [0.0; TILE];
        let count = columns.columns();
        let (correlations, slopes) = (&mut correlations[..count], &mut slopes[..count]);
        let among = column * TILE..column * TILE + count;
        let mut place = vec![0.0; rows.rows()];
        for i in 0..rows.columns() {
            place.iter_mut().enumerate().for_each(|(k, x)| *x = rows[(k, i)]);
            squared_distances(&place, columns, correlations);
            self.kernel.evaluate(correlations, slopes);
            let run = row * TILE + i;
            for v in (0..x.rows()).filter(|&v| wanted[v]) {
                sum[(v, run)] += dot(correlations, &x.row(v)[among.clone()]);
                if row != column {
                    add_scaled(&mut sum.row_mut(v)[among.clone()], x[(v, run)], correlations);
                }
            }
        }
    }
}

/// Returns the solutions `A` of `A K = R` for residuals `R` (`vectors x runs`), or `None` if one of them is not reached.
///
/// Conjugate gradients with the approximate precision as preconditioner (Hestenes and Stiefel 1952; Golub and Van Loan,
/// *Matrix Computations*, 11.5.2). The iteration of a vector ends when `r' B' B r`, about the square of the error in the
/// norm of the covariance, is at most `limits[v]` squared: the error of `k(x)' a` is at most that root at every point
/// `x` (Cauchy and Schwarz). The residual as computed anew, which carries rounding errors, must then have a root mean
/// square of at most `limits[v]`, or the iteration begins again from it.
pub fn solve(
    covariance: &Covariance,
    precision: &Precision<'_>,
    residuals: &Matrix,
    limits: &[f64],
) -> Option<Matrix> {
    let mut solutions = Matrix::zeros(residuals.rows(), residuals.columns());
    let mut rest = residuals.clone();
    for begun in 0..=RESTARTS {
        for v in 0..rest.rows() {
            let first = precision.multiply(rest.row(v));
            add_scaled(solutions.row_mut(v), 1.0, &first);
        }
        rest = left(covariance, residuals, &solutions);
        let mut iteration = Iteration::new(precision, rest);
        if !iteration.run(covariance, precision, &mut solutions, limits) {
            return None;
        }
        rest = left(covariance, residuals, &solutions);
        let size = |v: usize| (dot(rest.row(v), rest.row(v)) / rest.columns() as f64).sqrt();
        if (0..rest.rows()).all(|v| size(v) <= limits[v]) {
            return Some(solutions);
        }
        if begun == RESTARTS {
            break;
        }
    }
    None
}

/// Returns `R - A K`.
fn left(covariance: &Covariance, residuals: &Matrix, solutions: &Matrix) -> Matrix {
    let product = covariance.multiply(solutions, &vec![true; solutions.rows()]);
    let mut rest = residuals.clone();
    add_scaled(rest.as_mut_slice(), -1.0, product.as_slice());
    rest
}

/// State of the iteration of all vectors.
struct Iteration {
    rest: Matrix,
    direction: Matrix,
    /// `r' B' B r` of each vector.
    squares: Vec<f64>,
}

impl Iteration {
    fn new(precision: &Precision<'_>, rest: Matrix) -> Self {
        let mut direction = Matrix::zeros(rest.rows(), rest.columns());
        for v in 0..rest.rows() {
            direction.row_mut(v).copy_from_slice(&precision.multiply(rest.row(v)));
        }
        let squares = (0..rest.rows()).map(|v| dot(rest.row(v), direction.row(v))).collect();
        Self { rest, direction, squares }
    }

    fn sizes(&self) -> Vec<f64> {
        self.squares.iter().map(|square| square.max(0.0).sqrt()).collect()
    }

    /// Steps until each vector is below its limit; false if they do not get there.
    fn run(
        &mut self,
        covariance: &Covariance,
        precision: &Precision<'_>,
        solutions: &mut Matrix,
        limits: &[f64],
    ) -> bool {
        let first = self.sizes();
        let mut open: Vec<bool> = first.iter().zip(limits).map(|(size, l)| size > l).collect();
        for step in 1..=MOST {
            let product = covariance.multiply(&self.direction, &open);
            for v in (0..limits.len()).filter(|&v| open[v]) {
                let length = self.squares[v] / dot(self.direction.row(v), product.row(v));
                if !length.is_finite() {
                    return false;
                }
                add_scaled(solutions.row_mut(v), length, self.direction.row(v));
                add_scaled(self.rest.row_mut(v), -length, product.row(v));
                let better = precision.multiply(self.rest.row(v));
                let square = dot(self.rest.row(v), &better);
                let turn = square / self.squares[v];
                self.squares[v] = square;
                for (d, b) in self.direction.row_mut(v).iter_mut().zip(&better) {
                    *d = b + turn * *d;
                }
            }
            let sizes = self.sizes();
            for v in 0..limits.len() {
                open[v] &= sizes[v] > limits[v];
                let (gained, wanted) = ((first[v] / sizes[v]).ln(), (first[v] / limits[v]).ln());
                if step == EARLY && open[v] && gained * (MOST as f64) < wanted * EARLY as f64 {
                    return false;
                }
            }
            if !open.contains(&true) {
                return true;
            }
        }
        false
    }
}
