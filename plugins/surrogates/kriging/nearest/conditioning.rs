//! Predictions of a process of many runs.

use std::cell::OnceCell;

use lacuna_linalg::radial::squared_distances;
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Cholesky, Matrix, multiply, multiply_transposed};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::super::factor::JITTERS;
use super::super::kernel::Kernel;
use super::conjugate::{Covariance, solve, tiles};
use super::likelihood::Solved;
use super::order::Neighbours;
use super::tree::{Tree, Wanted};

/// Error of the mean that the solution may leave anywhere, as a fraction of the typical standard deviation of a run
/// given the others.
const ERROR: f64 = 1e-2;
/// Attempts to find the weights: number of neighbours of the preconditioner, as a multiple, and jitter.
const ATTEMPTS: [(f64, f64); 6] =
    [(1.0, 0.0), (2.5, 0.0), (2.5, 1e-10), (2.5, 1e-8), (2.5, 1e-6), (2.5, 1e-4)];
/// Number of partial sums of covariances, the same on any number of threads.
const PARTS: usize = 8;

/// Number of runs whose correlations with some places are computed together.
const TILE: usize = 512;

/// Errors of a process that is conditioned on many runs.
///
/// The error at a point is that of the best linear prediction from its nearest runs alone. The emulator's mean uses all
/// runs, so that its own error is smaller: the variance is an upper bound, close if the neighbours carry nearly all
/// information. These predictions being linear in the runs, their errors have a joint covariance, which is positive
/// semidefinite and exact for the hyperparameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Near {
    kernel: Kernel,
    neighbours: usize,
    nugget: f64,
    tree: Tree,
    /// Runs in length scales, one per column, and the same in parts that stay in the cache.
    points: Matrix,
    tiles: Vec<Matrix>,
    /// Trend at the runs (`N x p`).
    trend: Matrix,
    /// Root of the covariance of the trend's coefficients (`p x p`).
    r_inverse: Matrix,
    /// Diagonal of the projection `P`, as the neighbours give it.
    precisions: Vec<f64>,
}

/// Results of conditioning that are saved rather than computed again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Restored {
    /// Nugget plus the jitter that the solution needed.
    pub nugget: f64,
    /// Restricted log-likelihood of the scores.
    pub log_likelihood: f64,
    /// Variance of each process.
    pub variances: Vec<f64>,
    /// Coefficients of the trend (`components x terms`).
    pub beta: Vec<Vec<f64>>,
    /// Root of their covariance (`terms x terms`).
    pub r_inverse: Vec<Vec<f64>>,
}

/// A process as conditioned, or as read from a file.
pub struct Conditioned {
    /// Numbers of few runs' size.
    pub restored: Restored,
    /// Weights of the correlations (`components x runs`).
    pub alpha: Matrix,
    /// Diagonal of the projection `P`.
    pub precisions: Vec<f64>,
}

/// Prediction from the nearest runs.
struct Local {
    runs: Vec<u32>,
    weights: Vec<f64>,
    /// Share of the process's variance that the runs leave.
    left: f64,
}

/// Trend and weights of the runs.
struct Weighted<'a> {
    solved: Solved<'a>,
    /// Scores without their trends (`C x N`).
    rest: Matrix,
    /// Weights (`C x N`).
    alpha: Matrix,
}

impl<'a> Weighted<'a> {
    fn new(
        kernel: Kernel,
        points: &Matrix,
        neighbours: &'a Neighbours,
        nugget: f64,
        [trend, scores]: [&Matrix; 2],
    ) -> Option<Self> {
        let solved = Solved::new(kernel, points, neighbours, nugget, trend, scores)?;
        let fitted = multiply(trend, &solved.beta);
        let rest = Matrix::from_fn(scores.columns(), scores.rows(), |c, i| {
            scores[(i, c)] - fitted[(i, c)]
        });
        let mut variances = solved.precision.variances();
        variances.sort_by(f64::total_cmp);
        let typical = variances[variances.len() / 2];
        let limits: Vec<f64> =
            solved.variances.iter().map(|v| ERROR * (v * typical).sqrt()).collect();
        let covariance = Covariance::new(kernel, points, solved.nugget);
        let alpha = solve(&covariance, &solved.precision, &rest, &limits)?;
        Some(Self { solved, rest, alpha })
    }
}

impl Near {
    /// Conditions processes with scores (`N x C`) and a trend (`N x p`) on runs in length scales (one per column), of
    /// which `neighbours` carry the errors. `None` if no jitter permits a solution.
    pub fn new(
        kernel: Kernel,
        points: &Matrix,
        nugget: f64,
        [trend, scores]: [&Matrix; 2],
        neighbours: usize,
    ) -> Option<(Self, Conditioned)> {
        let neighbours = neighbours.min(points.columns());
        let few = Neighbours::of(points, neighbours);
        let many = OnceCell::new();
        let more = |times: f64| (times * neighbours as f64) as usize;
        // All runs before a run cannot be more, and a jitter far below the nugget changes nothing.
        let worth = |(times, jitter): &&(f64, f64)| {
            (*times == 1.0 || *jitter > 0.0 || neighbours + 1 < points.columns())
                && (*jitter == 0.0 || *jitter > 0.1 * nugget)
        };
        let attempt = |(times, jitter): &(f64, f64)| {
            let near = match *times {
                1.0 => &few,
                times => many.get_or_init(|| Neighbours::of(points, more(times))),
            };
            Weighted::new(kernel, points, near, nugget + jitter, [trend, scores])
        };
        let Weighted { solved, rest, alpha } = ATTEMPTS.iter().filter(worth).find_map(attempt)?;
        let free = (points.columns() - trend.columns()) as f64;
        let (value, variances) = solved.restricted(free, &rest, &alpha);
        let rows = |m: &Matrix| m.iter_rows().map(<[f64]>::to_vec).collect();
        let restored = Restored {
            nugget: solved.nugget,
            log_likelihood: value,
            variances,
            beta: rows(&solved.beta.transposed()),
            r_inverse: rows(&solved.trend.r_inverse),
        };
        let directions = solved.precision.coloured(&solved.trend.q);
        let conditioned = Conditioned { restored, alpha, precisions: Vec::new() };
        let mut near = Self::of(kernel, points.clone(), trend.clone(), &conditioned, neighbours)?;
        near.precisions = near.precisions(&directions);
        let conditioned = Conditioned { precisions: near.precisions.clone(), ..conditioned };
        Some((near, conditioned))
    }

    /// Rebuilds the errors of processes that were conditioned before; `None` if the sizes do not fit.
    pub fn of(
        kernel: Kernel,
        points: Matrix,
        trend: Matrix,
        conditioned: &Conditioned,
        neighbours: usize,
    ) -> Option<Self> {
        let n = points.columns();
        let neighbours = neighbours.min(n);
        let tree = Tree::new(&points, &(0..n).collect::<Vec<_>>());
        let p = trend.columns();
        let r_inverse = &conditioned.restored.r_inverse;
        if r_inverse.len() != p || r_inverse.iter().any(|row| row.len() != p) {
            return None;
        }
        let r_inverse = Matrix::from_rows(p, r_inverse);
        let (nugget, precisions) = (conditioned.restored.nugget, conditioned.precisions.clone());
        let tiles = tiles(&points, TILE);
        Some(Self { kernel, neighbours, nugget, tree, points, tiles, trend, r_inverse, precisions })
    }

    /// Returns the sums of correlations minus 1 with the runs times their weights (`places x components`), for places in
    /// length scales (one per column). The bits of a place do not depend on the others.
    pub fn process(&self, places: &Matrix, alpha: &Matrix) -> Matrix {
        let mut sums = Matrix::zeros(places.columns(), alpha.rows());
        for (t, tile) in self.tiles.iter().enumerate() {
            let above = self.kernel.above_one(places, tile);
            let runs = t * TILE..t * TILE + tile.columns();
            for (i, above) in above.iter_rows().enumerate() {
                for (c, sum) in sums.row_mut(i).iter_mut().enumerate() {
                    *sum += dot(above, &alpha.row(c)[runs.clone()]);
                }
            }
        }
        sums
    }

    /// Returns the diagonal of `P` from the variance of each run given its neighbours; `directions` is
    /// `K^-1 F R^-1`.
    fn precisions(&self, directions: &Matrix) -> Vec<f64> {
        let precision = |i: usize| {
            let local = self.local(&self.points.column(i), Some(i as u32));
            let own = 1.0 / (local.left + self.nugget).max(f64::MIN_POSITIVE);
            // If a run alone determines a term of the trend, the other runs cannot predict it.
            (own - dot(directions.row(i), directions.row(i))).max(1e-13 * own)
        };
        (0..self.points.columns()).into_par_iter().map(precision).collect()
    }

    /// Returns the root of the covariance of the trend's coefficients, row by row.
    pub fn root(&self) -> Vec<Vec<f64>> {
        self.r_inverse.iter_rows().map(<[f64]>::to_vec).collect()
    }

    /// Returns the diagonal of `P`.
    pub fn diagonal(&self) -> &[f64] {
        &self.precisions
    }

    /// Predicts a place in length scales from its nearest runs, without one of them: from blocks of one size.
    fn local(&self, place: &[f64], except: Option<u32>) -> Local {
        let count = self.neighbours + usize::from(except.is_none());
        let wanted = Wanted { except, ..Wanted::all(count) };
        let runs = self.tree.nearest(place, wanted);
        let indices: Vec<usize> = runs.iter().map(|&run| run as usize).collect();
        let near = self.points.select_columns(&indices);
        let own = Matrix::from_vec(place.len(), 1, place.to_vec());
        let mut weights = self.kernel.between(&own, &near).into_vec();
        let (mut covariance, _) = self.kernel.among(&near, self.nugget);
        let mut added = 0.0;
        for jitter in JITTERS {
            for i in 0..covariance.rows() {
                covariance[(i, i)] += jitter - added;
            }
            added = jitter;
            let Ok(cholesky) = Cholesky::new(&covariance) else { continue };
            let known = cholesky.quadratic(&weights);
            cholesky.solve(&mut weights);
            return Local { runs, weights, left: (1.0 - known).max(0.0) };
        }
        // Without a factor nothing is known: the prior.
        Local { runs: Vec::new(), weights: Vec::new(), left: 1.0 }
    }

    /// Returns the predictions of some places (one per column), and `(f - F' w)' R^-1` of each with its trend `f` and
    /// weights `w` (`places x terms`).
    fn predicted(&self, places: &Matrix, trend: &Matrix) -> (Vec<Local>, Matrix) {
        let local = |i: usize| self.local(&places.column(i), None);
        let locals: Vec<Local> = (0..places.columns()).into_par_iter().map(local).collect();
        let mut rest = trend.clone();
        for (i, local) in locals.iter().enumerate() {
            for (&run, &weight) in local.runs.iter().zip(&local.weights) {
                add_scaled(rest.row_mut(i), -weight, self.trend.row(run as usize));
            }
        }
        (locals, multiply(&rest, &self.r_inverse))
    }

    /// Returns the variances of a new run at places in length scales (one per column) with these trends
    /// (`places x terms`), for a process of variance one: at least the nugget.
    pub fn variance(&self, places: &Matrix, trend: &Matrix) -> Vec<f64> {
        let (locals, unknown) = self.predicted(places, trend);
        let shares = locals.iter().zip(unknown.iter_rows());
        shares.map(|(local, u)| self.nugget + local.left + dot(u, u)).collect()
    }

    /// Returns the covariances of the errors among places, without the nugget, for a process of variance one.
    pub fn covariance(&self, places: &Matrix, trend: &Matrix) -> Matrix {
        let (locals, unknown) = self.predicted(places, trend);
        let unknown = multiply_transposed(&unknown, &unknown);
        let known = self.shared(places, &locals);
        let own = self.kernel.between(places, places);
        let n = locals.len();
        Matrix::from_fn(n, n, |i, j| {
            let process = if i == j {
                locals[i].left
            } else {
                own[(i, j)] - 0.5 * (known[(i, j)] + known[(j, i)])
            };
            process + 0.5 * (unknown[(i, j)] + unknown[(j, i)])
        })
    }

    /// Returns `2 w_i' k(X, x_j) - w_i' K w_j` of all pairs, whose symmetric part is what the predictions take from the
    /// covariance.
    fn shared(&self, places: &Matrix, locals: &[Local]) -> Matrix {
        let n = locals.len();
        let mut used: Vec<u32> = locals.iter().flat_map(|local| local.runs.clone()).collect();
        used.sort_unstable();
        used.dedup();
        let mut users: Vec<Vec<(usize, f64)>> = vec![Vec::new(); used.len()];
        for (i, local) in locals.iter().enumerate() {
            for (run, weight) in local.runs.iter().zip(&local.weights) {
                if let Ok(s) = used.binary_search(run) {
                    users[s].push((i, *weight));
                }
            }
        }
        let mut terms: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
        for (s, list) in users.iter().enumerate() {
            for &(i, weight) in list {
                terms[i].push((s, weight));
            }
        }
        let indices: Vec<usize> = used.iter().map(|&run| run as usize).collect();
        let points = self.points.select_columns(&indices);
        let part = |part: usize| {
            let mut sum = Matrix::zeros(n, n);
            let (mut among, mut slopes) = (vec![0.0; used.len()], vec![0.0; used.len().max(n)]);
            let mut row = vec![0.0; n];
            for s in (part..used.len()).step_by(PARTS) {
                let place = points.column(s);
                squared_distances(&place, &points, &mut among);
                self.kernel.evaluate(&mut among, &mut slopes[..used.len()]);
                among[s] += self.nugget;
                squared_distances(&place, places, &mut row);
                self.kernel.evaluate(&mut row, &mut slopes[..n]);
                for (x, terms) in row.iter_mut().zip(&terms) {
                    let taken: f64 = terms.iter().map(|&(t, weight)| weight * among[t]).sum();
                    *x = 2.0 * *x - taken;
                }
                users[s].iter().for_each(|&(i, weight)| add_scaled(sum.row_mut(i), weight, &row));
            }
            sum
        };
        let parts: Vec<Matrix> = (0..PARTS).into_par_iter().map(part).collect();
        let mut all = Matrix::zeros(n, n);
        for sum in &parts {
            add_scaled(all.as_mut_slice(), 1.0, sum.as_slice());
        }
        all
    }
}
