//! Gaussian processes with given hyperparameters, conditioned on their scores: universal kriging.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, multiply, multiply_transposed};
use serde::{Deserialize, Serialize};

use super::factor::{Factor, Weights};
use super::kernel::Kernel;
use super::likelihood::{Hyperparameters, measured, restricted};

/// Choices that define a field; the rest follows from the runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// Indices of its components.
    pub components: Vec<usize>,
    /// Indices of the regressors of its trend.
    pub terms: Vec<usize>,
    /// Length scale of each parameter, in units of the standard variable.
    pub length_scales: Vec<f64>,
    /// Variance of the noise as a fraction of the variance of the process.
    pub nugget: f64,
}

/// The runs as used by the fields.
#[derive(Debug, Clone, Copy)]
pub struct Runs<'a> {
    /// Standard variables, one run per column.
    pub points: &'a Matrix,
    /// All regressors at the runs (`runs x regressors`).
    pub regressors: &'a Matrix,
    /// Scores of all components (`runs x components`).
    pub scores: &'a Matrix,
}

/// Independent Gaussian processes with a common covariance and trend, one for each of its components.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The choices that define it.
    pub choice: Choice,
    kernel: Kernel,
    /// Nugget plus the jitter that the factorisation needed.
    pub nugget: f64,
    /// Runs in units of the length scales, one run per column.
    points: Matrix,
    factor: Factor,
    /// `alpha` (`components x runs`) and `beta` (`components x terms`), one component per row.
    alpha: Matrix,
    beta: Matrix,
    /// Variance of each process.
    variances: Vec<f64>,
    /// Restricted log-likelihood of the scores.
    pub log_likelihood: f64,
}

impl Field {
    /// Conditions the processes on the runs; `None` if the covariance cannot be factored or the runs do not determine
    /// the trend.
    pub fn new(kernel: Kernel, choice: Choice, runs: Runs<'_>) -> Option<Self> {
        let points = measured(runs.points, &choice.length_scales);
        let trend = runs.regressors.select_columns(&choice.terms);
        let (covariance, _) = kernel.among(&points, choice.nugget);
        let (factor, jitter) = Factor::new(covariance, &trend)?;
        if factor.size() <= factor.terms() {
            return None;
        }
        let Weights { alpha, beta, squares } =
            factor.weights(&runs.scores.select_columns(&choice.components));
        let (log_likelihood, variances) = restricted(&factor, &squares);
        let nugget = choice.nugget + jitter;
        let (alpha, beta) = (alpha.transposed(), beta.transposed());
        Some(Self {
            choice,
            kernel,
            nugget,
            points,
            factor,
            alpha,
            beta,
            variances,
            log_likelihood,
        })
    }

    /// Returns the mean of each component (`points x components`) at points in standard variables (one per column)
    /// with these values of the regressors.
    ///
    /// Each point is computed separately, so that its bits do not depend on the other points in the batch: the sums
    /// involve cancellation.
    pub fn mean(&self, points: &Matrix, regressors: &Matrix) -> Matrix {
        let place = measured(points, &self.choice.length_scales);
        let above = self.kernel.above_one(&place, &self.points);
        let trend = regressors.select_columns(&self.choice.terms);
        let ones: Vec<f64> = self.alpha.iter_rows().map(|alpha| alpha.iter().sum()).collect();
        Matrix::from_fn(points.columns(), ones.len(), |i, c| {
            let process = dot(above.row(i), self.alpha.row(c)) + ones[c];
            process + dot(trend.row(i), self.beta.row(c))
        })
    }

    /// Returns the variance of a new run's score about the mean (`points x components`), including the uncertainty of
    /// the trend: `s^2 (1 + nugget - k' K^-1 k + u' (F' K^-1 F)^-1 u)` with `u = f - F' K^-1 k`.
    pub fn variance(&self, points: &Matrix, regressors: &Matrix) -> Matrix {
        let white = multiply_transposed(&self.correlations(points), &self.factor.lower_inverse);
        let trend = regressors.select_columns(&self.choice.terms);
        let own = multiply(&trend, &self.factor.r_inverse);
        let shared = multiply(&white, &self.factor.q);
        let share = |i: usize| {
            let known = dot(white.row(i), white.row(i));
            let unknown = own.row(i).iter().zip(shared.row(i)).map(|(a, b)| (a - b) * (a - b));
            (1.0 + self.nugget - known).max(0.0) + unknown.sum::<f64>()
        };
        let shares: Vec<f64> = (0..points.columns()).map(share).collect();
        Matrix::from_fn(shares.len(), self.variances.len(), |i, c| self.variances[c] * shares[i])
    }

    /// Returns the covariances of the errors of the first component among points (`points x points`), including the
    /// uncertainty of the trend, without the nugget.
    pub fn covariance(&self, points: &Matrix, regressors: &Matrix) -> Matrix {
        let mut all = self.shared_covariance(points, regressors);
        all.as_mut_slice().iter_mut().for_each(|c| *c *= self.variances[0]);
        all
    }

    /// Returns the covariances of [`Self::covariance`] for a process of variance one; those of a component are its variance
    /// times these.
    pub fn shared_covariance(&self, points: &Matrix, regressors: &Matrix) -> Matrix {
        let white = multiply_transposed(&self.correlations(points), &self.factor.lower_inverse);
        let trend = regressors.select_columns(&self.choice.terms);
        let mut unknown = multiply(&trend, &self.factor.r_inverse);
        let shared = multiply(&white, &self.factor.q);
        for (a, b) in unknown.as_mut_slice().iter_mut().zip(shared.as_slice()) {
            *a -= b;
        }
        let place = measured(points, &self.choice.length_scales);
        let mut all = self.kernel.between(&place, &place);
        let known = multiply_transposed(&white, &white);
        let unknown = multiply_transposed(&unknown, &unknown);
        let terms = known.as_slice().iter().zip(unknown.as_slice());
        for (c, (known, unknown)) in all.as_mut_slice().iter_mut().zip(terms) {
            *c = *c - known + unknown;
        }
        all
    }

    /// Returns the derivatives of each component (rows) with respect to the standard variables at a point, and with
    /// respect to the regressors (`terms` of its choice).
    pub fn gradient(&self, point: &[f64]) -> (Matrix, &Matrix) {
        let scales = &self.choice.length_scales;
        let place: Vec<f64> = point.iter().zip(scales).map(|(z, l)| z / l).collect();
        let correlations = self.kernel.gradient(&place, &self.points);
        let mut gradient = multiply_transposed(&self.alpha, &correlations);
        for c in 0..gradient.rows() {
            gradient.row_mut(c).iter_mut().zip(scales).for_each(|(slope, l)| *slope /= l);
        }
        (gradient, &self.beta)
    }

    /// Returns the leave-one-out residuals of the scores (`runs x components`), with the hyperparameters kept and the
    /// trend refitted: `(P y)_i / P_ii` (Dubrule 1983; Rasmussen and Williams 2006, equation 5.12).
    pub fn left_out(&self) -> Matrix {
        // If a run alone determines a term of the trend, `P_ii` is zero: the other runs cannot predict it. The floor
        // keeps the residual finite.
        let precisions: Vec<f64> =
            self.factor.precisions().into_iter().map(|(p, k)| p.max(1e-13 * k)).collect();
        Matrix::from_fn(precisions.len(), self.alpha.rows(), |i, c| {
            self.alpha[(c, i)] / precisions[i]
        })
    }

    /// Returns the mean square of the leave-one-out residuals of the first component in units of their own standard
    /// deviations `s / sqrt(P_ii)`; above one for a process that is too sure of itself.
    pub fn left_out_ratio(&self) -> f64 {
        let precisions = self.factor.precisions();
        let n = precisions.len() as f64;
        let square = |(i, (p, k)): (usize, &(f64, f64))| {
            self.alpha[(0, i)].powi(2) / (p.max(1e-13 * k) * self.variances[0])
        };
        precisions.iter().enumerate().map(square).sum::<f64>() / n
    }

    /// Weights of the correlations with the runs (`components x runs`) and coefficients of the trend (`components x
    /// terms`).
    pub fn weights(&self) -> (&Matrix, &Matrix) {
        (&self.alpha, &self.beta)
    }

    /// Variance of the process of each component.
    pub fn variances(&self) -> &[f64] {
        &self.variances
    }

    fn correlations(&self, points: &Matrix) -> Matrix {
        self.kernel.between(&measured(points, &self.choice.length_scales), &self.points)
    }
}

impl Choice {
    /// Returns the choice with these hyperparameters.
    pub fn new(components: Vec<usize>, terms: Vec<usize>, found: Hyperparameters) -> Self {
        let Hyperparameters { length_scales, nugget } = found;
        Self { components, terms, length_scales, nugget }
    }
}
