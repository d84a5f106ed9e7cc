//! The fitted surrogate.

use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::FitError;
use lacuna::plugin::{Emulator, Fact, Forward};
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, multiply, transposed_multiply, transposed_multiply_vector};
use serde::{Deserialize, Serialize};

use super::NAME;
use super::inputs::{Input, positions, scaled};
use crate::surrogates::polynomial_chaos::bytes;
use crate::surrogates::polynomial_chaos::{Basis, Coordinate, Terms};

/// Expansion of one component of the outputs in the positions along its directions.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Component {
    /// Directions among the scaled inputs (`inputs x directions`).
    pub directions: Matrix,
    /// Polynomials of the positions.
    pub basis: Basis,
    pub coefficients: Vec<f64>,
}

/// The fitted surrogate: `y(x) = mean + sum_c s_c(W_c' x) loadings_c`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reduced {
    pub inputs: Vec<Input>,
    pub components: Vec<Component>,
    /// Mean of each output, then the contribution of one unit of each component (`(1 + components) x outputs`).
    pub loadings: Matrix,
    /// Number of groups of runs that were left out in turn.
    pub folds: usize,
    pub fit_error: FitError,
}

/// All of a component except its numbers.
#[derive(Debug, Serialize, Deserialize)]
struct Written {
    directions: usize,
    coordinates: Vec<Coordinate>,
    exponents: Vec<u16>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Header {
    inputs: Vec<Input>,
    components: Vec<Written>,
    folds: usize,
    runs: usize,
    outputs: usize,
}

impl Reduced {
    /// Loads the file that [`Emulator::save`] wrote; fails if it is damaged or from another plugin.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Stop> {
        let (header, numbers) = bytes::read_as::<Header>(NAME, bytes)?;
        Self::read(header, numbers).ok_or_else(|| bytes::damaged_as(NAME))
    }

    fn read(header: Header, numbers: Vec<f64>) -> Option<Self> {
        let Header { inputs, components, folds, runs, outputs } = header;
        let d = inputs.len();
        if d == 0 || !inputs.iter().all(Input::is_sound) {
            return None;
        }
        let mut rest = numbers.as_slice();
        let mut take = |rows: usize, columns: usize| {
            let (own, others) = rest.split_at_checked(rows.checked_mul(columns)?)?;
            rest = others;
            Some(Matrix::from_vec(rows, columns, own.to_vec()))
        };
        let mut read = Vec::new();
        for Written { directions, coordinates, exponents } in components {
            let whole = directions > 0
                && coordinates.len() == directions
                && exponents.len().is_multiple_of(directions);
            let mut degrees = exponents.iter().enumerate();
            if !whole
                || !degrees.all(|(k, &e)| coordinates[k % directions].reaches(usize::from(e)))
            {
                return None;
            }
            let terms = Terms::from_exponents(directions, exponents);
            let coefficients = take(terms.len(), 1)?.into_vec();
            let directions = take(d, directions)?;
            read.push(Component { directions, basis: Basis::new(coordinates, terms), coefficients });
        }
        let loadings = take(read.len() + 1, outputs)?;
        let relative = take(1, outputs)?.into_vec();
        let residuals = take(runs, outputs)?;
        let fit_error = FitError { relative, residuals };
        rest.is_empty().then_some(Self { inputs, components: read, loadings, folds, fit_error })
    }
}

impl Component {
    fn scores(&self, scaled: &Matrix) -> Vec<f64> {
        let values = self.basis.values(&positions(scaled, &self.directions));
        values.iter_rows().map(|row| dot(row, &self.coefficients)).collect()
    }

    /// Returns the derivative by each scaled input at one point.
    fn gradient(&self, scaled: &Matrix) -> Vec<f64> {
        let place = positions(scaled, &self.directions);
        let slopes = transposed_multiply_vector(&self.basis.gradient(place.row(0)), &self.coefficients);
        self.directions.iter_rows().map(|row| dot(row, &slopes)).collect()
    }
}

impl Forward for Reduced {
    fn dimension(&self) -> usize {
        self.inputs.len()
    }

    fn outputs(&self) -> usize {
        self.loadings.columns()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        multiply(&self.basis(points), &self.loadings)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        transposed_multiply(&self.loadings, &self.basis_gradient(point))
    }

    fn linear(&self) -> Option<&dyn Linear> {
        Some(self)
    }
}

impl Linear for Reduced {
    fn coefficients(&self) -> &Matrix {
        &self.loadings
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        let scaled = scaled(&self.inputs, points);
        let scores: Vec<Vec<f64>> = self.components.iter().map(|c| c.scores(&scaled)).collect();
        Matrix::from_fn(points.rows(), scores.len() + 1, |i, c| match c {
            0 => 1.0,
            c => scores[c - 1][i],
        })
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        let scaled = scaled(&self.inputs, &Matrix::from_vec(1, point.len(), point.to_vec()));
        let mut gradient = Matrix::zeros(self.components.len() + 1, point.len());
        for (c, component) in self.components.iter().enumerate() {
            let slopes = component.gradient(&scaled);
            for (j, slope) in slopes.iter().enumerate() {
                gradient[(c + 1, j)] = slope * self.inputs[j].slope(point[j]);
            }
        }
        gradient
    }
}

impl Emulator for Reduced {
    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        let all = |count: &dyn Fn(&Component) -> usize| {
            let mut counts: Vec<usize> = self.components.iter().map(count).collect();
            counts.sort_unstable();
            match counts[..] {
                [] => "none".to_owned(),
                [least, .., largest] => format!("{least}, {}, {largest}", counts[counts.len() / 2]),
                [one] => one.to_string(),
            }
        };
        let of = if self.components.len() > 1 { " of a component (least, median, largest)" } else { "" };
        let directions = all(&|c| c.directions.columns());
        vec![
            Fact::new(format!("directions{of}"), directions),
            Fact::new(format!("terms{of}"), all(&|c| c.coefficients.len())),
            Fact::new("principal components of the outputs", self.components.len()),
            Fact::new("groups of runs left out in turn", self.folds),
        ]
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        let components = self.components.iter().map(|c| Written {
            directions: c.directions.columns(),
            coordinates: c.basis.coordinates().to_vec(),
            exponents: c.basis.terms().exponents().to_vec(),
        });
        let header = Header {
            inputs: self.inputs.clone(),
            components: components.collect(),
            folds: self.folds,
            runs: self.fit_error.residuals.rows(),
            outputs: self.outputs(),
        };
        let mut numbers: Vec<&[f64]> = Vec::new();
        for component in &self.components {
            numbers.push(&component.coefficients);
            numbers.push(component.directions.as_slice());
        }
        numbers.push(self.loadings.as_slice());
        numbers.push(&self.fit_error.relative);
        numbers.push(self.fit_error.residuals.as_slice());
        bytes::write_as(NAME, &header, &numbers)
    }
}
