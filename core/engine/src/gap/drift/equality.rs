//! Tests of equality in the model in which each window has its own parameters.

use lacuna::math::special::gamma_tails;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{
    Cholesky, Matrix, gram, multiply, multiply_transposed, multiply_vector, symmetric_eigen,
};
use serde::{Deserialize, Serialize};

/// Directions in which the data contribute less than this share of the precision of data and prior are not tested.
const SAYS_NOTHING: f64 = 0.01;

/// The precision that the prior adds to the common values in the test, relative to the prior's own: practically none.
const FLAT: f64 = 1e-8;

/// A test of whether parameters are the same in all pieces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Equality {
    /// The Wald statistic: chi squared with this number of degrees of freedom if the values are equal and the noise is
    /// known.
    pub statistic: f64,
    /// The degrees of freedom: the number of differences that the data determine.
    pub freedom: usize,
    /// The p-value; 1 if there is nothing to compare.
    pub p: f64,
}

impl Equality {
    fn of(statistic: f64, freedom: usize) -> Self {
        let p = if freedom == 0 {
            1.0
        } else {
            gamma_tails(0.5 * freedom as f64, 0.5 * statistic).1.exp()
        };
        Self { statistic, freedom, p }
    }

    /// The statistic on a scale that does not depend on the degrees of freedom (Wilson and Hilferty, Proceedings of the
    /// National Academy of Sciences 17 (1931) 684).
    pub(super) fn standardised(&self) -> f64 {
        if self.freedom == 0 {
            return 0.0;
        }
        let freedom = self.freedom as f64;
        let spread = 2.0 / (9.0 * freedom);
        ((self.statistic / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
    }
}

/// All tests of one set of data.
#[derive(Debug, Clone)]
pub(super) struct EqualityTests {
    /// All parameters in all windows.
    pub all: Equality,
    /// All parameters between the conditions, each taken as a whole; `None` with one condition.
    pub conditions: Option<Equality>,
    /// Each parameter while the others may differ too.
    pub marginal: Vec<Equality>,
    /// Each parameter while the others are equal everywhere.
    pub alone: Vec<Equality>,
}

impl EqualityTests {
    /// All statistics in a fixed order.
    pub fn each(&mut self) -> Vec<&mut Equality> {
        let Self { all, conditions, marginal, alone } = self;
        let rest = conditions.iter_mut().chain(marginal).chain(alone);
        std::iter::once(all).chain(rest).collect()
    }
}

/// The whitened linear model of the windows, in units of the standard deviations of the priors.
pub(super) struct WindowSlopes {
    /// The slopes of each window by each parameter, `(windows * parameters) x values`.
    pub slopes: Matrix,
    /// The products of the slopes, `(windows * parameters) x (windows * parameters)`.
    pub information: Matrix,
    /// The products of the slopes after projection onto the complement of the common unknowns; shape as `information`.
    pub left: Matrix,
    /// An orthonormal basis of the slopes of the common unknowns, one direction per row.
    common: Matrix,
    parameters: usize,
}

impl WindowSlopes {
    /// The model from the whitened slopes of the windows and of all common unknowns, each in units of the prior's
    /// width.
    pub fn new(slopes: Matrix, common: &Matrix, parameters: usize) -> Option<Self> {
        let mut normal = gram(&common.transposed());
        let largest = (0..normal.rows()).map(|j| normal[(j, j)]).fold(0.0, f64::max);
        (0..normal.rows()).for_each(|j| normal[(j, j)] += FLAT + 1e-13 * largest);
        let common = Cholesky::new(&normal).ok()?.whiten_matrix(common);
        let information = multiply_transposed(&slopes, &slopes);
        let along = multiply_transposed(&slopes, &common);
        let taken = multiply_transposed(&along, &along);
        let size = slopes.rows();
        let left = Matrix::from_fn(size, size, |a, b| information[(a, b)] - taken[(a, b)]);
        Some(Self { slopes, information, left, common, parameters })
    }

    /// The number of windows.
    pub fn count(&self) -> usize {
        self.slopes.rows() / self.parameters.max(1)
    }

    /// The leverage of each whitened value: the share of it that the common unknowns explain.
    pub fn leverage(&self) -> Vec<f64> {
        let mut all = vec![0.0; self.common.columns()];
        for row in self.common.iter_rows() {
            all.iter_mut().zip(row).for_each(|(l, q)| *l += q * q);
        }
        all
    }

    /// A whitened residual after projection onto the complement of the common unknowns.
    pub fn rest(&self, white: &[f64]) -> Vec<f64> {
        let along = multiply_vector(&self.common, white);
        let mut rest = white.to_vec();
        for (a, row) in along.iter().zip(self.common.iter_rows()) {
            rest.iter_mut().zip(row).for_each(|(r, q)| *r -= a * q);
        }
        rest
    }

    /// The posterior precision of the windows' parameters, with the prior around the joint fit.
    pub fn precision(&self) -> Matrix {
        let mut precision = self.information.clone();
        (0..precision.rows()).for_each(|j| precision[(j, j)] += 1.0);
        precision
    }

    /// All tests of a whitened residual; `conditions` lists the windows of each condition.
    pub fn tests(&self, white: &[f64], conditions: &[Vec<usize>]) -> Option<EqualityTests> {
        let score = multiply_vector(&self.slopes, &self.rest(white));
        let precision = self.precision();
        let all = wald(&score, &self.left, &precision)?;
        let inverse = Cholesky::new(&precision).ok()?.inverse();
        let estimate = multiply_vector(&inverse, &score);
        let spread = multiply(&multiply(&inverse, &self.left), &inverse);
        let (mut marginal, mut alone) = (Vec::new(), Vec::new());
        for j in 0..self.parameters {
            let own: Vec<usize> = (0..self.count()).map(|w| w * self.parameters + j).collect();
            let differ = contrasts(&own, self.slopes.rows());
            let around = |m: &Matrix| multiply_transposed(&multiply(&differ, m), &differ);
            let differences = multiply_vector(&differ, &estimate);
            marginal.push(wald(&differences, &around(&spread), &around(&inverse))?);
            let part = |m: &Matrix| m.select_rows(&own).select_columns(&own);
            let own_score: Vec<f64> = own.iter().map(|&a| score[a]).collect();
            alone.push(wald(&own_score, &part(&self.left), &part(&precision))?);
        }
        let measured: Vec<&Vec<usize>> = conditions.iter().filter(|own| !own.is_empty()).collect();
        let conditions = match &measured[..] {
            [] | [_] => None,
            several => Some(self.of_conditions(&score, several)?),
        };
        Some(EqualityTests { all, conditions, marginal, alone })
    }

    /// The test with equal parameters in all windows of a condition.
    fn of_conditions(&self, score: &[f64], of: &[&Vec<usize>]) -> Option<Equality> {
        let p = self.parameters;
        let sum = Matrix::from_fn(of.len() * p, score.len(), |a, b| {
            f64::from(u8::from(a % p == b % p && of[a / p].contains(&(b / p))))
        });
        let around = |m: &Matrix| multiply_transposed(&multiply(&sum, m), &sum);
        let mut precision = around(&self.information);
        (0..precision.rows()).for_each(|j| precision[(j, j)] += 1.0);
        wald(&multiply_vector(&sum, score), &around(&self.left), &precision)
    }
}

/// Helmert contrasts of the chosen entries of a vector, one per row.
fn contrasts(chosen: &[usize], size: usize) -> Matrix {
    let rows = chosen.len().saturating_sub(1);
    let mut all = Matrix::zeros(rows, size);
    for k in 0..rows {
        let n = (k + 1) as f64;
        let scale = 1.0 / (n * (n + 1.0)).sqrt();
        for &before in &chosen[..=k] {
            all[(k, before)] = scale;
        }
        all[(k, chosen[k + 1])] = -n * scale;
    }
    all
}

/// The Wald statistic of a vector with this covariance under the null hypothesis, along the directions in which it is
/// not small against `whole`.
fn wald(vector: &[f64], covariance: &Matrix, whole: &Matrix) -> Option<Equality> {
    if vector.is_empty() {
        return Some(Equality::of(0.0, 0));
    }
    let factor = Cholesky::new(whole).ok()?;
    let half = factor.whiten_matrix(covariance).transposed();
    let relative = factor.whiten_matrix(&half);
    let eigen = symmetric_eigen(&relative).ok()?;
    let mut white = vector.to_vec();
    factor.whiten(&mut white);
    let (mut statistic, mut freedom) = (0.0, 0);
    for (k, &value) in eigen.values.iter().enumerate() {
        if value > SAYS_NOTHING {
            statistic += dot(&eigen.vectors.column(k), &white).powi(2) / value;
            freedom += 1;
        }
    }
    Some(Equality::of(statistic, freedom))
}
