//! Gaussian processes with given hyperparameters, conditioned on their scores: universal kriging.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, multiply, multiply_transposed};
use serde::{Deserialize, Serialize};

use super::factor::{Factor, Weights};
use super::kernel::Kernel;
use super::likelihood::{Hyperparameters, measured, restricted};
use super::nearest::{Conditioned, Near, Restored};

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
    /// Number of neighbours of a run in the approximation for many runs; `None` for the exact process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub neighbours: Option<usize>,
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
    runs: Conditioning,
    /// `alpha` (`components x runs`) and `beta` (`components x terms`), one component per row.
    alpha: Matrix,
    beta: Matrix,
    /// Variance of each process.
    variances: Vec<f64>,
    /// Restricted log-likelihood of the scores.
    pub log_likelihood: f64,
}

/// The means by which errors follow from the runs.
#[derive(Debug, Clone, PartialEq)]
enum Conditioning {
    /// Factors of all runs.
    All(Factor),
    /// Nearest runs.
    Near(Near),
}

impl Field {
    /// Conditions the processes on the runs; `None` if the covariance cannot be factored or the runs do not determine
    /// the trend.
    pub fn new(kernel: Kernel, choice: Choice, runs: Runs<'_>) -> Option<Self> {
        let points = measured(runs.points, &choice.length_scales);
        let trend = runs.regressors.select_columns(&choice.terms);
        let scores = runs.scores.select_columns(&choice.components);
        if let Some(neighbours) = choice.neighbours {
            let both = [&trend, &scores];
            let (near, found) = Near::new(kernel, &points, choice.nugget, both, neighbours)?;
            return Self::nearby(kernel, choice, points, near, found);
        }
        let (covariance, _) = kernel.among(&points, choice.nugget);
        let (factor, jitter) = Factor::new(covariance, &trend)?;
        if factor.size() <= factor.terms() {
            return None;
        }
        let Weights { alpha, beta, squares } = factor.weights(&scores);
        let (log_likelihood, variances) =
            restricted(factor.free(), factor.determinants(), &squares);
        let nugget = choice.nugget + jitter;
        let (alpha, beta) = (alpha.transposed(), beta.transposed());
        let runs = Conditioning::All(factor);
        Some(Self { choice, kernel, nugget, points, runs, alpha, beta, variances, log_likelihood })
    }

    /// Restores processes of many runs from what was found before; `None` if the parts do not fit.
    pub fn restored(
        kernel: Kernel,
        choice: Choice,
        runs: Runs<'_>,
        found: Conditioned,
    ) -> Option<Self> {
        let points = measured(runs.points, &choice.length_scales);
        let trend = runs.regressors.select_columns(&choice.terms);
        let near = Near::of(kernel, points.clone(), trend, &found, choice.neighbours?)?;
        Self::nearby(kernel, choice, points, near, found)
    }

    fn nearby(
        kernel: Kernel,
        choice: Choice,
        points: Matrix,
        near: Near,
        found: Conditioned,
    ) -> Option<Self> {
        let Conditioned { restored, alpha, precisions } = found;
        let Restored { nugget, log_likelihood, variances, beta, .. } = restored;
        let (components, terms) = (choice.components.len(), choice.terms.len());
        let fits = beta.len() == components
            && beta.iter().all(|row| row.len() == terms)
            && variances.len() == components
            && (alpha.rows(), alpha.columns()) == (components, points.columns())
            && precisions.len() == points.columns();
        let beta = Matrix::from_rows(terms, fits.then_some(beta)?);
        let runs = Conditioning::Near(near);
        Some(Self { choice, kernel, nugget, points, runs, alpha, beta, variances, log_likelihood })
    }

    /// Returns what [`Self::restored`] needs; `None` for exact processes, which are conditioned again.
    pub fn found(&self) -> Option<Conditioned> {
        let Conditioning::Near(near) = &self.runs else { return None };
        let restored = Restored {
            nugget: self.nugget,
            log_likelihood: self.log_likelihood,
            variances: self.variances.clone(),
            beta: self.beta.iter_rows().map(<[f64]>::to_vec).collect(),
            r_inverse: near.root(),
        };
        let (alpha, precisions) = (self.alpha.clone(), near.diagonal().to_vec());
        Some(Conditioned { restored, alpha, precisions })
    }

    /// Returns the mean of each component (`points x components`) at points in standard variables (one per column)
    /// with these values of the regressors.
    ///
    /// Each point is computed separately, so that its bits do not depend on the other points in the batch: the sums
    /// involve cancellation.
    pub fn mean(&self, points: &Matrix, regressors: &Matrix) -> Matrix {
        let place = measured(points, &self.choice.length_scales);
        let process = match &self.runs {
            Conditioning::All(_) => {
                multiply_each(&self.kernel.above_one(&place, &self.points), &self.alpha)
            }
            Conditioning::Near(near) => near.process(&place, &self.alpha),
        };
        let trend = regressors.select_columns(&self.choice.terms);
        let ones: Vec<f64> = self.alpha.iter_rows().map(|alpha| alpha.iter().sum()).collect();
        Matrix::from_fn(points.columns(), ones.len(), |i, c| {
            process[(i, c)] + ones[c] + dot(trend.row(i), self.beta.row(c))
        })
    }

    /// Returns the variance of a new run's score about the mean (`points x components`), including the uncertainty of
    /// the trend: `s^2 (1 + nugget - k' K^-1 k + u' (F' K^-1 F)^-1 u)` with `u = f - F' K^-1 k`.
    pub fn variance(&self, points: &Matrix, regressors: &Matrix) -> Matrix {
        let trend = regressors.select_columns(&self.choice.terms);
        let shares = match &self.runs {
            Conditioning::All(factor) => self.shares(factor, points, &trend),
            Conditioning::Near(near) => {
                near.variance(&measured(points, &self.choice.length_scales), &trend)
            }
        };
        Matrix::from_fn(shares.len(), self.variances.len(), |i, c| self.variances[c] * shares[i])
    }

    fn shares(&self, factor: &Factor, points: &Matrix, trend: &Matrix) -> Vec<f64> {
        let white = multiply_transposed(&self.correlations(points), &factor.lower_inverse);
        let own = multiply(trend, &factor.r_inverse);
        let shared = multiply(&white, &factor.q);
        let share = |i: usize| {
            let known = dot(white.row(i), white.row(i));
            let unknown = own.row(i).iter().zip(shared.row(i)).map(|(a, b)| (a - b) * (a - b));
            (1.0 + self.nugget - known).max(0.0) + unknown.sum::<f64>()
        };
        (0..points.columns()).map(share).collect()
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
        let trend = regressors.select_columns(&self.choice.terms);
        let factor = match &self.runs {
            Conditioning::All(factor) => factor,
            Conditioning::Near(near) => {
                return near.covariance(&measured(points, &self.choice.length_scales), &trend);
            }
        };
        let white = multiply_transposed(&self.correlations(points), &factor.lower_inverse);
        let mut unknown = multiply(&trend, &factor.r_inverse);
        let shared = multiply(&white, &factor.q);
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
    ///
    /// With many runs `P_ii` follows from the variance of a run given its nearest others, which is an upper bound, so
    /// that the residuals are too large rather than too small.
    pub fn left_out(&self) -> Matrix {
        let precisions = self.precisions();
        Matrix::from_fn(precisions.len(), self.alpha.rows(), |i, c| {
            self.alpha[(c, i)] / precisions[i]
        })
    }

    /// Returns the diagonal of `P`.
    fn precisions(&self) -> Vec<f64> {
        match &self.runs {
            // If a run alone determines a term of the trend, `P_ii` is zero: the other runs cannot predict it. The
            // floor keeps the residual finite.
            Conditioning::All(factor) => {
                factor.precisions().into_iter().map(|(p, k)| p.max(1e-13 * k)).collect()
            }
            Conditioning::Near(near) => near.diagonal().to_vec(),
        }
    }

    /// Returns the mean square of the leave-one-out residuals of the first component in units of their own standard
    /// deviations `s / sqrt(P_ii)`; above one for a process that is too sure of itself.
    pub fn left_out_ratio(&self) -> f64 {
        let precisions = self.precisions();
        let n = precisions.len() as f64;
        let square = |(i, p): (usize, &f64)| self.alpha[(0, i)].powi(2) / (p * self.variances[0]);
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

/// Returns the inner products of all rows of one matrix with all of another, each computed alone.
fn multiply_each(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_fn(a.rows(), b.rows(), |i, j| dot(a.row(i), b.row(j)))
}

impl Choice {
    /// Returns the choice with these hyperparameters.
    pub fn new(components: Vec<usize>, terms: Vec<usize>, found: Hyperparameters) -> Self {
        let Hyperparameters { length_scales, nugget } = found;
        Self { components, terms, length_scales, nugget, neighbours: None }
    }
}
