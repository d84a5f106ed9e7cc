//! Restricted likelihood of the length scales and the nugget.

use std::f64::consts::TAU;

use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::Target;
use lacuna_linalg::{Matrix, multiply_transposed, vector};

use super::factor::Factor;
use super::kernel::Kernel;
use super::options::{Bounds, Nugget};

/// Hyperparameters of a Gaussian process; its variance and trend follow from them.
#[derive(Debug, Clone, PartialEq)]
pub struct Hyperparameters {
    /// Length scale of each parameter, in units of the standard variable.
    pub length_scales: Vec<f64>,
    /// Variance of the noise as a fraction of the variance of the process.
    pub nugget: f64,
}

/// Scores with a common trend and covariance: `Y = F B + Z`, the columns of `Z` independent Gaussian processes with
/// the covariance `s_c^2 (C + nugget I)`.
///
/// The trend's coefficients are integrated out under a flat prior and each `s_c^2` is at its restricted estimate `y'
/// P y / (N - p)`, which leaves the restricted (marginal) log-likelihood of the length scales and the nugget: `-1/2
/// sum_c [(N - p) (1 + log 2 pi s_c^2) + log |K| + log |F' K^-1 F|]` (Rasmussen and Williams 2006, equation 2.45;
/// Harville 1974). Its derivative with respect to a hyperparameter is `-1/2 sum_c [tr(P dK) - a_c' dK a_c / s_c^2]`
/// with `a_c = P y_c`.
///
/// As a density its coordinates are the logarithms of the length scales, followed by that of the nugget if it is
/// estimated.
#[derive(Debug, Clone, Copy)]
pub struct Restricted<'a> {
    /// Correlation function.
    pub kernel: Kernel,
    /// Runs in standard variables, one per column.
    pub points: &'a Matrix,
    /// `F` (`N x p`).
    pub trend: &'a Matrix,
    /// `Y` (`N x C`).
    pub scores: &'a Matrix,
    /// Bounds of the hyperparameters.
    pub bounds: Bounds,
    /// Nugget, or that it is estimated.
    pub nugget: Nugget,
}

/// Mean square of the residuals of scores of size 1 below which they count as rounding errors.
const ROUND_OFF: f64 = 1e-28;

impl Restricted<'_> {
    /// Returns the hyperparameters at a point of the density.
    pub fn at(&self, point: &[f64]) -> Hyperparameters {
        let d = self.points.rows();
        let length_scales = point[..d].iter().map(|x| x.exp()).collect();
        let nugget = match self.nugget {
            Nugget::Fixed(nugget) => nugget,
            Nugget::Estimated(_) => point[d].exp(),
        };
        Hyperparameters { length_scales, nugget }
    }

    /// Returns the log-likelihood alone; minus infinity if the covariance cannot be factored.
    pub fn value(&self, point: &[f64]) -> f64 {
        let Hyperparameters { length_scales, nugget } = self.at(point);
        let (covariance, _) = self.kernel.among(&measured(self.points, &length_scales), nugget);
        let Some((factor, _)) = Factor::new(covariance, self.trend) else {
            return f64::NEG_INFINITY;
        };
        restricted(factor.free(), factor.determinants(), &factor.weights(self.scores).squares).0
    }

    /// Returns the log-likelihood and its derivatives; `None` if the covariance cannot be factored.
    pub fn slopes(&self, point: &[f64]) -> Option<Slopes> {
        let Hyperparameters { length_scales, nugget } = self.at(point);
        let points = measured(self.points, &length_scales);
        let (covariance, slopes) = self.kernel.among(&points, nugget);
        let (factor, _) = Factor::new(covariance, self.trend)?;
        let weights = factor.weights(self.scores);
        let (value, variances) = restricted(factor.free(), factor.determinants(), &weights.squares);
        // A fixed nugget has no derivative.
        let moved = Moved { points: &points, slopes: &slopes, alpha: weights.alpha.transposed() };
        let (gradient, pulls) =
            moved.by_logarithms(&factor, &variances, nugget, Target::dimension(self));
        let information = information(&factor, &moved.alpha, &variances, &pulls);
        Some(Slopes { value, gradient, information })
    }
}

/// Restricted likelihood around a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Slopes {
    /// Log-likelihood.
    pub value: f64,
    /// Derivative with respect to each coordinate.
    pub gradient: Vec<f64>,
    /// Average of the observed and the expected information (Gilmour, Thompson and Cullis 1995), with the variances
    /// profiled out: `1/2 sum_c [q_i' P q_j / s_c^2 - (a_c' q_i) (a_c' q_j) / (s_c^4 (N - p))]` with
    /// `q_i = dK_i a_c`. Positive semidefinite.
    pub information: Matrix,
}

/// Returns the restricted log-likelihood and the estimates of the variances `s_c^2`: `free` is `N - p`, `determinants`
/// `log |K| + log |F' K^-1 F|`, `squares` the diagonal of `Y' P Y`.
pub fn restricted(free: f64, determinants: f64, squares: &[f64]) -> (f64, Vec<f64>) {
    let variances: Vec<f64> = squares.iter().map(|s| (s / free).max(ROUND_OFF)).collect();
    let each = |v: &f64| free * (1.0 + (TAU * v).ln()) + determinants;
    (-0.5 * variances.iter().map(each).sum::<f64>(), variances)
}

/// Density of hyperparameters with the information that scoring needs.
pub trait Scored: Target {
    /// Returns the log-likelihood and its derivatives; `None` if the covariance cannot be factored.
    fn slopes(&self, point: &[f64]) -> Option<Slopes>;

    /// Number of length scales; the coordinate after theirs is the logarithm of the nugget.
    fn length_scales(&self) -> usize;
}

impl Scored for Restricted<'_> {
    fn slopes(&self, point: &[f64]) -> Option<Slopes> {
        Restricted::slopes(self, point)
    }

    fn length_scales(&self) -> usize {
        self.points.rows()
    }
}

/// Derivatives of a covariance with respect to its hyperparameters.
struct Moved<'a> {
    /// Runs in length scales, one per column.
    points: &'a Matrix,
    /// `-c'(r) / r` of each pair, below the diagonal.
    slopes: &'a Matrix,
    /// `P Y`, one component per row.
    alpha: Matrix,
}

impl Moved<'_> {
    /// Returns the gradient with respect to the first `count` of the logarithms of length scales and nugget, and
    /// `dK_i a_c` of each component and logarithm, one per row.
    fn by_logarithms(
        &self,
        factor: &Factor,
        variances: &[f64],
        nugget: f64,
        count: usize,
    ) -> (Vec<f64>, Matrix) {
        let (n, d, components) = (factor.size(), self.points.rows(), self.alpha.rows());
        let inside = self.inside(factor, variances);
        let mut gradient = vec![0.0; count];
        let mut pulls = Matrix::zeros(components * count, n);
        let mut change = vec![0.0; n];
        for i in 0..n {
            let (inside, slopes) = (&inside.row(i)[..=i], &self.slopes.row(i)[..i]);
            for (k, slope) in gradient[..d].iter_mut().enumerate() {
                let row = self.points.row(k);
                let change = &mut change[..i];
                for ((change, x), h) in change.iter_mut().zip(row).zip(slopes) {
                    *change = h * ((row[i] - x) * (row[i] - x));
                }
                *slope -= vector::dot(&inside[..i], change);
                for c in 0..components {
                    let alpha = self.alpha.row(c);
                    let pull = pulls.row_mut(c * count + k);
                    pull[i] += vector::dot(change, &alpha[..i]);
                    vector::add_scaled(&mut pull[..i], alpha[i], change);
                }
            }
            if count > d {
                gradient[d] -= 0.5 * nugget * inside[i];
            }
        }
        for c in (0..components).filter(|_| count > d) {
            let pull = pulls.row_mut(c * count + d);
            pull.iter_mut().zip(self.alpha.row(c)).for_each(|(q, a)| *q = nugget * a);
        }
        (gradient, pulls)
    }

    /// Returns `sum_c (P - a_c a_c' / s_c^2) = C K^-1 - S S'`, with `C` the number of components.
    fn inside(&self, factor: &Factor, variances: &[f64]) -> Matrix {
        let count = self.alpha.rows() as f64;
        let directions = factor.trend_directions();
        let (n, p) = (factor.size(), factor.terms());
        let sides = Matrix::from_fn(n, p + variances.len(), |i, j| match j.checked_sub(p) {
            None => count.sqrt() * directions[(i, j)],
            Some(c) => self.alpha[(c, i)] / variances[c].sqrt(),
        });
        let (mut inside, sides) = (factor.inverse(), multiply_transposed(&sides, &sides));
        for (w, s) in inside.as_mut_slice().iter_mut().zip(sides.as_slice()) {
            *w = count * *w - s;
        }
        inside
    }
}

fn information(factor: &Factor, alpha: &Matrix, variances: &[f64], pulls: &Matrix) -> Matrix {
    let count = pulls.rows() / variances.len().max(1);
    let free = (factor.size() - factor.terms()) as f64;
    let white = factor.whitened(&pulls.transposed()).transposed();
    let mut information = Matrix::zeros(count, count);
    for (c, v) in variances.iter().enumerate() {
        let along = |i: usize| vector::dot(alpha.row(c), pulls.row(c * count + i)) / v;
        for i in 0..count {
            for j in 0..count {
                let product = vector::dot(white.row(c * count + i), white.row(c * count + j)) / v;
                information[(i, j)] += 0.5 * (product - along(i) * along(j) / free);
            }
        }
    }
    information
}

/// Returns standard variables in units of the length scales.
pub fn measured(points: &Matrix, length_scales: &[f64]) -> Matrix {
    Matrix::from_fn(points.rows(), points.columns(), |k, i| points[(k, i)] / length_scales[k])
}

/// Returns the log-likelihood and its gradient by this number of hyperparameters: minus infinity and zero where the
/// covariance cannot be factored.
pub fn value_and_gradient(slopes: Option<Slopes>, count: usize) -> (f64, Vec<f64>) {
    match slopes {
        Some(slopes) => (slopes.value, slopes.gradient),
        None => (f64::NEG_INFINITY, vec![0.0; count]),
    }
}

impl Target for Restricted<'_> {
    fn dimension(&self) -> usize {
        self.points.rows() + usize::from(matches!(self.nugget, Nugget::Estimated(_)))
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
        let [low, high] = self.bounds.length_scale;
        let mut bounds = vec![(low.ln(), high.ln()); self.points.rows()];
        if matches!(self.nugget, Nugget::Estimated(_)) {
            let [low, high] = self.bounds.nugget;
            bounds.push((low.ln(), high.ln()));
        }
        bounds
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let (mut rng, bounds) = (stream.generator(), Target::bounds(self));
        Matrix::from_fn(count, bounds.len(), |_, j| {
            bounds[j].0 + (bounds[j].1 - bounds[j].0) * uniform(&mut rng)
        })
    }
}
