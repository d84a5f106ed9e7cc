//! Slopes of the responses at the runs as further rows of the regression.
//!
//! A run whose derivatives by `d` parameters are known gives `1 + d` rows: the value, and the slopes in the standard
//! variables, each times the factor under which the slopes of the polynomials are orthogonal as well (Peng, Hampton and
//! Doostan, Journal of Computational Physics 310 (2016) 440). The rows of a run are not independent, so that a set of
//! terms is judged by leaving out whole runs ([`super::by_run`]).

use lacuna_linalg::Matrix;

use super::columns::SlopeColumns;
use super::coordinate::Coordinate;
use super::terms::Basis;

/// Place of the slopes among the rows, and their scale.
pub(super) struct Slopes {
    /// Factor of each slope in a standard variable (`runs x parameters`); zero where it is not known.
    weights: Matrix,
    /// Factor of each slope in physical units, NaN where it is not known.
    scales: Matrix,
}

impl Slopes {
    /// Prepares the slopes at points, `runs x parameters`; `gradients` has those of each output by all parameters.
    pub fn new(coordinates: &[Coordinate], points: &Matrix, gradients: &Matrix) -> Self {
        let dimension = coordinates.len();
        let stretch = |i: usize, j: usize| coordinates[j].stretch(points[(i, j)]);
        let known = |i: usize, j: usize| {
            let mut own = gradients.row(i).iter().skip(j).step_by(dimension);
            own.all(|slope| slope.is_finite()) && stretch(i, j).is_finite()
        };
        let weights = Matrix::from_fn(points.rows(), dimension, |i, j| {
            let z = coordinates[j].standard(points[(i, j)]);
            if known(i, j) { coordinates[j].family().slope_weight(z) } else { 0.0 }
        });
        let scale = |i: usize, j: usize| {
            if known(i, j) { weights[(i, j)] * stretch(i, j) } else { f64::NAN }
        };
        let scales = Matrix::from_fn(points.rows(), dimension, scale);
        Self { weights, scales }
    }

    /// Returns the number of parameters.
    pub fn dimension(&self) -> usize {
        self.weights.columns()
    }

    /// Returns the number of known slopes.
    pub fn known(&self) -> usize {
        self.scales.as_slice().iter().filter(|scale| scale.is_finite()).count()
    }

    /// Returns the slope rows of one output: by the first parameter at all runs, then by the second, and so on.
    pub fn of_output(&self, gradients: &Matrix, output: usize) -> Vec<f64> {
        let dimension = self.dimension();
        let row = |j: usize, i: usize| {
            let scale = self.scales[(i, j)];
            if scale.is_nan() { 0.0 } else { scale * gradients[(i, output * dimension + j)] }
        };
        let runs = 0..self.weights.rows();
        (0..dimension).flat_map(|j| runs.clone().map(move |i| row(j, i))).collect()
    }

    /// Returns the slopes of the basis functions at the runs.
    pub fn columns(&self, basis: &Basis, points: &Matrix) -> SlopeColumns {
        let (terms, runs) = (basis.terms(), points.rows());
        let (mut parameters, mut ends) = (Vec::new(), Vec::new());
        for t in 0..terms.len() {
            let own = terms.term(t).iter().enumerate().filter(|(_, exponent)| **exponent > 0);
            parameters.extend(own.map(|(j, _)| j));
            ends.push(parameters.len());
        }
        let mut slopes = Matrix::zeros(parameters.len(), runs);
        for (i, point) in points.iter_rows().enumerate() {
            let mut entry = 0;
            basis.slopes(point, |_, j, slope| {
                let weight = self.weights[(i, j)];
                slopes[(entry, i)] = if weight == 0.0 { 0.0 } else { weight * slope };
                entry += 1;
            });
        }
        SlopeColumns { dimension: self.dimension(), parameters, ends, slopes }
    }
}

/// Returns the derivatives of components of the responses, whose directions are the columns of `directions`
/// (`outputs x components`): those of the first component by all parameters, then those of the second.
pub(super) fn of_components(gradients: &Matrix, directions: &Matrix, dimension: usize) -> Matrix {
    let mut of_scores = Matrix::zeros(gradients.rows(), directions.columns() * dimension);
    for (i, own) in gradients.iter_rows().enumerate() {
        let row = of_scores.row_mut(i);
        for (o, slopes) in own.chunks_exact(dimension.max(1)).enumerate() {
            for (k, direction) in directions.row(o).iter().enumerate() {
                for (j, slope) in slopes.iter().enumerate() {
                    row[k * dimension + j] += direction * slope;
                }
            }
        }
    }
    of_scores
}
