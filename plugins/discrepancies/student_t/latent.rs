//! Common errors represented by the weights of a few directions.

use std::ops::Range;

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{
    CommonError, ErrorOrigin, ErrorPath, Hyperparameter, Known, VariancePart,
};
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix};

use super::Directions;
use crate::discrepancies::common::Replicates;

/// Sine below which two directions count as the same.
const SAME: f64 = 1e-6;

/// All common errors together, `F zeta` with `zeta` standard normal, restricted to the orthonormal directions `Q` of
/// `zeta`.
///
/// A generalised least squares estimate weights the residuals with `X = C^-1 J`, where `J` holds the derivatives of
/// the response with respect to the parameters and `C = S + F F'` is the covariance of the mean curve, `S` that of
/// its noise alone. For `Q` that spans `F' X`
///
/// ```text
/// (S + F Q Q' F') X = S X + F F' X = J,
/// ```
///
/// so that the covariance with these directions alone weights the residuals as the full one does: estimate and
/// posterior covariance are the same, with no more directions than parameters. The directions depend on the size of
/// the noise, which is unknown; those for several sizes are kept together.
#[derive(Debug, Clone)]
pub(super) struct Latent {
    /// `F Q` over all outputs, one direction per row.
    directions: Matrix,
    /// Matrix `F` over all outputs.
    factor: Matrix,
    /// Orthonormal directions `Q`.
    kept: Matrix,
    parts: Vec<Part>,
    /// Index of the first weight among the hyperparameters.
    first: usize,
    /// Fraction of the variance of the mean curve along the directions, in units of its noise.
    pub share: f64,
}

/// One common error of a new replicate, over all outputs.
#[derive(Debug, Clone)]
struct Part {
    origin: ErrorOrigin,
    /// Error per unit of each weight (`outputs x weights`).
    along: Matrix,
    /// Variance outside the directions.
    rest: Vec<f64>,
    /// Columns of the factor of all errors that belong to it.
    columns: Range<usize>,
}

/// Noise for which the directions are chosen.
pub(super) struct Noise {
    /// Variance of the mean curve without common errors, for each measured output.
    pub variance: Vec<f64>,
    /// Ratios of the noise's standard deviation to that of `variance` for which directions are kept.
    pub sizes: Vec<f64>,
}

impl Latent {
    /// Chooses the directions on which the estimates depend and the leading ones that the options ask for, and adds
    /// their weights to the hyperparameters. `None` without common errors.
    pub fn new(
        known: &Known<'_>,
        replicates: &Replicates,
        noise: &Noise,
        limit: Directions,
        hyper: &mut Vec<Hyperparameter>,
    ) -> Result<Option<Self>, Stop> {
        let factor = beside_each_other(known.common);
        let weighted = in_units_of_noise(&factor, replicates, noise);
        let slopes = || Ok(in_units_of_noise(&(known.slopes)()?, replicates, noise));
        let kept = chosen(&weighted, slopes, &noise.sizes, limit)?;
        if kept.columns() == 0 {
            return Ok(None);
        }
        let along = lacuna_linalg::multiply(&weighted, &kept);
        let share = square(&along) / square(&weighted);
        let first = hyper.len();
        hyper.extend((1..=kept.columns()).map(weight));
        let directions = lacuna_linalg::multiply(&factor, &kept).transposed();
        let parts = parts(known.common, &kept);
        Ok(Some(Self { directions, factor, kept, parts, first, share }))
    }

    /// Returns the number of directions.
    pub fn count(&self) -> usize {
        self.directions.rows()
    }

    fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.count()
    }

    /// Returns the error at each output.
    pub fn error(&self, hyper: &[f64]) -> Vec<f64> {
        lacuna_linalg::transposed_multiply_vector(&self.directions, &hyper[self.range()])
    }

    /// Returns `F Q`.
    pub fn sampled(&self) -> Matrix {
        self.directions.transposed()
    }

    /// Returns `F (1 - Q Q')`.
    pub fn left_out(&self) -> Matrix {
        let along = lacuna_linalg::multiply_transposed(&self.sampled(), &self.kept);
        Matrix::from_fn(along.rows(), along.columns(), |i, j| self.factor[(i, j)] - along[(i, j)])
    }

    /// Draws the errors outside the directions, at each output.
    pub fn rest(&self, stream: &Stream) -> Vec<f64> {
        let mut rng = stream.generator();
        let all: Vec<f64> = (0..self.factor.columns()).map(|_| normal(&mut rng)).collect();
        lacuna_linalg::multiply_vector(&self.factor, &self.beside(&all))
    }

    /// Returns `(1 - Q Q') zeta`.
    fn beside(&self, zeta: &[f64]) -> Vec<f64> {
        let along = lacuna_linalg::transposed_multiply_vector(&self.kept, zeta);
        let along = lacuna_linalg::multiply_vector(&self.kept, &along);
        zeta.iter().zip(along).map(|(z, a)| z - a).collect()
    }

    /// Iterates over the errors of a new replicate, with the mean square of each at each output given the weights.
    pub fn predictive(&self, hyper: &[f64]) -> impl Iterator<Item = VariancePart> {
        let weights = hyper[self.range()].to_vec();
        self.parts.iter().map(move |part| {
            let error = lacuna_linalg::multiply_vector(&part.along, &weights);
            let square = error.iter().zip(&part.rest).map(|(e, rest)| e * e + rest);
            VariancePart { origin: part.origin.clone(), variance: square.collect() }
        })
    }

    /// Draws the errors of a new replicate given the weights, in the order of [`Latent::predictive`].
    pub fn errors(&self, hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let mut rng = stream.generator();
        let all: Vec<f64> = (0..self.factor.columns()).map(|_| normal(&mut rng)).collect();
        let beside = self.beside(&all);
        let weights = &hyper[self.range()];
        let one = |part: &Part| {
            let own = part.columns.clone();
            let sampled = lacuna_linalg::multiply_vector(&part.along, weights);
            let rows = self.factor.iter_rows().zip(sampled);
            let values =
                rows.map(|(row, e)| e + dot(&row[own.clone()], &beside[own.clone()])).collect();
            ErrorPath { origin: part.origin.clone(), values }
        };
        self.parts.iter().map(one).collect()
    }

    /// Adds the derivatives with respect to the weights, given those with respect to the outputs.
    pub fn add_gradient(&self, by_output: &[f64], by_hyper: &mut [f64]) {
        let by_weight = lacuna_linalg::multiply_vector(&self.directions, by_output);
        let own = &mut by_hyper[self.range()];
        own.iter_mut().zip(by_weight).for_each(|(sum, g)| *sum += g);
    }
}

fn weight(number: usize) -> Hyperparameter {
    Hyperparameter {
        name: format!("common[{number}]"),
        symbol: format!("common[{number}]"),
        unit: Unit::dimensionless(),
        prior: Distribution::Normal([0.0, 1.0]),
        log: false,
        start: 0.0,
    }
}

/// Returns the errors of a new replicate; each belongs to its own rows of the kept directions.
fn parts(common: &[CommonError], kept: &Matrix) -> Vec<Part> {
    let mut first = 0;
    let mut found = Vec::new();
    for error in common {
        let rows: Vec<usize> = (first..first + error.factor.columns()).collect();
        first += rows.len();
        if error.predictive && !rows.is_empty() {
            let columns = first - rows.len()..first;
            let along = lacuna_linalg::multiply(&error.factor, &kept.select_rows(&rows));
            let rest = error.factor.iter_rows().zip(along.iter_rows());
            let rest = rest.map(|(whole, along)| (dot(whole, whole) - dot(along, along)).max(0.0));
            found.push(Part { origin: error.origin.clone(), rest: rest.collect(), along, columns });
        }
    }
    found
}

/// Chooses the leading directions of the factor and those on which the estimates depend, both in units of the noise;
/// none without errors, and at most the rank of the errors.
fn chosen(
    weighted: &Matrix,
    slopes: impl FnOnce() -> Result<Matrix, Stop>,
    sizes: &[f64],
    limit: Directions,
) -> Result<Matrix, Stop> {
    if weighted.columns() == 0 {
        return Ok(Matrix::zeros(0, 0));
    }
    let svd = lacuna_linalg::thin_svd(weighted).map_err(refused)?;
    let squares: Vec<f64> = svd.values.iter().map(|s| s * s).collect();
    let rank = squares.iter().filter(|s| **s > 1e-24 * squares[0]).count();
    let total: f64 = squares.iter().sum();
    let (mut leading, mut carried) = (0, 0.0);
    while leading < rank.min(limit.most) && carried < limit.share * total {
        carried += squares[leading];
        leading += 1;
    }
    let first = |count: usize| svd.v.select_columns(&(0..count).collect::<Vec<_>>());
    if leading == rank {
        return Ok(first(rank));
    }
    let kept = joined(&first(leading), &that_matter(weighted, &slopes()?, sizes)?)?;
    Ok(if kept.columns() < rank { kept } else { first(rank) })
}

/// Returns the sum of the squares of all entries.
fn square(matrix: &Matrix) -> f64 {
    dot(matrix.as_slice(), matrix.as_slice())
}

fn refused(error: lacuna_linalg::Error) -> Stop {
    Stop::new(format!("the covariance of the common errors: {error}"))
}

/// Returns the factors of all errors side by side.
fn beside_each_other(common: &[CommonError]) -> Matrix {
    let rows = common.first().map_or(0, |error| error.factor.rows());
    let row = |i: usize| common.iter().flat_map(move |e| e.factor.row(i).iter().copied());
    let columns = common.iter().map(|error| error.factor.columns()).sum();
    Matrix::from_vec(rows, columns, (0..rows).flat_map(row).collect())
}

/// Returns the rows of the measured outputs, divided by the noise of the mean curve there.
fn in_units_of_noise(matrix: &Matrix, replicates: &Replicates, noise: &Noise) -> Matrix {
    Matrix::from_fn(replicates.measured.len(), matrix.columns(), |k, j| {
        matrix[(replicates.measured[k], j)] / noise.variance[k].sqrt()
    })
}

/// Returns `B' (s^2 + B B')^-1 A` for each size `s`, with the factor `B` and the slopes `A` in units of the noise;
/// columns are normalised.
fn that_matter(b: &Matrix, a: &Matrix, sizes: &[f64]) -> Result<Matrix, Stop> {
    let whole = lacuna_linalg::multiply_transposed(b, b);
    let mut found: Vec<Matrix> = Vec::new();
    for size in sizes {
        let mut covariance = whole.clone();
        for k in 0..covariance.rows() {
            covariance[(k, k)] += size * size;
        }
        let solved = Cholesky::new(&covariance).map_err(refused)?.solve_matrix(a);
        found.push(lacuna_linalg::transposed_multiply(b, &solved));
    }
    let columns = a.columns();
    let unit = |j: usize| {
        let column = found[j / columns].column(j % columns);
        let length = column.iter().map(|x| x * x).sum::<f64>().sqrt();
        column.into_iter().map(move |x| if length > 0.0 { x / length } else { 0.0 })
    };
    let rows: Vec<Vec<f64>> = (0..sizes.len() * columns).map(|j| unit(j).collect()).collect();
    Ok(Matrix::from_rows(b.columns(), rows).transposed())
}

/// Returns an orthonormal basis of the span of the columns of both matrices; the columns of `first` are orthonormal.
fn joined(first: &Matrix, second: &Matrix) -> Result<Matrix, Stop> {
    let along = lacuna_linalg::multiply(first, &lacuna_linalg::transposed_multiply(first, second));
    let beyond =
        Matrix::from_fn(second.rows(), second.columns(), |i, j| second[(i, j)] - along[(i, j)]);
    let svd = lacuna_linalg::thin_svd(&beyond).map_err(refused)?;
    let kept = svd.values.iter().filter(|s| **s > SAME).count();
    let row = |i: usize| first.row(i).iter().chain(&svd.u.row(i)[..kept]).copied();
    let columns = first.columns() + kept;
    Ok(Matrix::from_vec(second.rows(), columns, (0..second.rows()).flat_map(row).collect()))
}
