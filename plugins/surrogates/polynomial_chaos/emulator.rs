//! The fitted expansion.

use lacuna::linalg::{Matrix, multiply, transposed_multiply};
use lacuna::plugin::surrogate::{FitError, Linear, Sensitivity, SumOfSquares};
use lacuna::plugin::{Emulator, Fact};
use lacuna::run::Stop;
use serde::{Deserialize, Serialize};

use super::coordinate::Coordinate;
use super::options::Solver;
use super::squares::Squares;
use super::terms::{Basis, Terms};
use super::{bytes, sensitivity};

/// A polynomial chaos expansion of all outputs over the union of their terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Expansion {
    basis: Basis,
    /// `terms x outputs`.
    coefficients: Matrix,
    fit_error: FitError,
    summary: Summary,
}

/// How the expansion came about.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Summary {
    /// The solver that chose the terms.
    pub solver: Solver,
    /// The degree chosen for each output; zero for constant outputs.
    pub degrees: Vec<usize>,
    /// The number of terms of each output, the constant included.
    pub terms: Vec<usize>,
    /// The number of terms among which they were chosen.
    pub candidates: usize,
    /// The number of outputs that do not vary over the runs.
    pub constant: usize,
}

/// All of an expansion but its large arrays.
#[derive(Debug, Serialize, Deserialize)]
struct Header {
    coordinates: Vec<Coordinate>,
    exponents: Vec<u16>,
    outputs: usize,
    runs: usize,
    summary: Summary,
}

impl Expansion {
    pub(super) fn new(
        basis: Basis,
        coefficients: Matrix,
        fit_error: FitError,
        summary: Summary,
    ) -> Self {
        Self { basis, coefficients, fit_error, summary }
    }

    /// The mean and the variance of each output under the design's distribution.
    pub fn mean_and_variance(&self) -> (Vec<f64>, Vec<f64>) {
        let Sensitivity { mean, variance, .. } = self.moments();
        (mean, variance)
    }

    /// How the expansion came about.
    pub fn summary(&self) -> &Summary {
        &self.summary
    }

    /// The terms over which all outputs are expanded.
    pub fn terms(&self) -> &Terms {
        self.basis.terms()
    }

    /// Where the parameters sit in their families.
    pub fn basis_coordinates(&self) -> Vec<Coordinate> {
        self.basis.coordinates().to_vec()
    }

    fn moments(&self) -> Sensitivity {
        sensitivity::sensitivity(self.basis.terms(), &self.coefficients, self.dimension())
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, Stop> {
        let (header, mut numbers) = bytes::read::<Header>(bytes)?;
        let dimension = header.coordinates.len();
        let (outputs, runs) = (header.outputs, header.runs);
        let whole = dimension > 0 && header.exponents.len() % dimension == 0;
        let terms = header.exponents.len() / dimension.max(1);
        if !whole || numbers.len() != (terms + 1 + runs) * outputs {
            return Err(bytes::damaged());
        }
        let residuals = numbers.split_off((terms + 1) * outputs);
        let relative = numbers.split_off(terms * outputs);
        let mut degrees = header.exponents.iter().enumerate();
        if !degrees.all(|(k, &e)| header.coordinates[k % dimension].reaches(usize::from(e))) {
            return Err(bytes::damaged());
        }
        let terms_of = Terms::from_exponents(dimension, header.exponents);
        Ok(Self {
            basis: Basis::new(header.coordinates, terms_of),
            coefficients: Matrix::from_vec(terms, outputs, numbers),
            fit_error: FitError { relative, residuals: Matrix::from_vec(runs, outputs, residuals) },
            summary: header.summary,
        })
    }
}

impl Emulator for Expansion {
    fn dimension(&self) -> usize {
        self.basis.coordinates().len()
    }

    fn outputs(&self) -> usize {
        self.coefficients.columns()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        multiply(&self.basis.values(points), &self.coefficients)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        transposed_multiply(&self.coefficients, &self.basis.gradient(point))
    }

    fn linear(&self) -> Option<&dyn Linear> {
        Some(self)
    }

    fn sensitivity(&self) -> Option<Sensitivity> {
        Some(self.moments())
    }

    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        let Summary { solver, degrees, terms, candidates, constant } = &self.summary;
        let mut facts = vec![
            Fact::new("solver", solver.name()),
            Fact::new("degrees (least, median, largest)", spread(degrees)),
            Fact::new("terms of an output (least, median, largest)", spread(terms)),
            Fact::new("terms of all outputs together", self.basis.terms().len()),
            Fact::new("terms to choose from", candidates),
        ];
        if *constant > 0 {
            facts.push(Fact::new("outputs that do not vary over the runs", constant));
        }
        facts
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        let header = Header {
            coordinates: self.basis.coordinates().to_vec(),
            exponents: self.basis.terms().exponents().to_vec(),
            outputs: self.outputs(),
            runs: self.fit_error.residuals.rows(),
            summary: self.summary.clone(),
        };
        let numbers = [
            self.coefficients.as_slice(),
            &self.fit_error.relative,
            self.fit_error.residuals.as_slice(),
        ];
        bytes::write(&header, &numbers)
    }
}

impl Linear for Expansion {
    fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        self.basis.values(points)
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        self.basis.gradient(point)
    }

    fn sum_of_squares(&self, factor: &Matrix) -> Option<Box<dyn SumOfSquares>> {
        let squares = Squares::new(&self.basis, factor)?;
        Some(Box::new(squares))
    }
}

/// The least, the median and the largest of some numbers.
fn spread(numbers: &[usize]) -> String {
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable();
    match sorted[..] {
        [] => "none".to_owned(),
        [least, .., largest] => format!("{least}, {}, {largest}", sorted[sorted.len() / 2]),
        [one] => format!("{one}, {one}, {one}"),
    }
}
