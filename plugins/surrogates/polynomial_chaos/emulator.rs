//! The fitted expansion.

use lacuna::plugin::forward::{Linear, SumOfSquares};
use lacuna::plugin::surrogate::{FitError, Sensitivity, Tables};
use lacuna::plugin::{Emulator, Fact, Forward};
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply, transposed_multiply};
use serde::{Deserialize, Serialize};

use super::coordinate::Coordinate;
use super::options::{Selection, Solver};
use super::sparse::Sparse;
use super::squares::Squares;
use super::terms::{Basis, Terms};
use super::{bytes, sensitivity, tables};

/// A polynomial chaos expansion of all outputs over the union of their terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Expansion {
    basis: Basis,
    /// Coefficients (`terms x outputs`).
    coefficients: Matrix,
    /// Sparse form of the coefficients, if most of them are zero.
    sparse: Option<Sparse>,
    fit_error: FitError,
    summary: Summary,
}

/// Properties of the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Solver that chose the terms.
    pub solver: Solver,
    /// Error by which the terms were chosen.
    pub selection: Selection,
    /// Quadrature rule that the runs form, in words.
    pub rule: Option<String>,
    /// Degree chosen for each output (or component); zero for those that do not vary.
    pub degrees: Vec<usize>,
    /// Norm chosen for each output (or component) that varies.
    pub q_norms: Vec<f64>,
    /// Number of terms of each output (or component), including the constant.
    pub terms: Vec<usize>,
    /// Number of terms to choose from.
    pub candidates: usize,
    /// Number of outputs that do not vary over the runs.
    pub constant: usize,
    /// Number of outputs whose error is not below that of their mean.
    pub poor: usize,
    /// Number of outputs (or components) with fewer than three runs per term.
    pub optimistic: usize,
    /// Principal components, if they were fitted in place of the outputs.
    pub reduction: Option<Reduction>,
    /// Number of runs on which the terms were chosen, if these are not all, and whether all outputs were then fitted
    /// with the terms of all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<Part>,
}

/// Choice of the terms on a part of the runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Number of these runs.
    pub runs: usize,
    /// True if each output has the terms of all outputs together.
    pub common: bool,
}

/// Reduction of the outputs to principal components.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reduction {
    /// Number of principal components.
    pub components: usize,
    /// Fraction of the outputs' variance over the runs that they leave out.
    pub left_out: f64,
}

/// All of an expansion except its large arrays.
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
        let sparse = Sparse::of(&coefficients);
        Self { basis, coefficients, sparse, fit_error, summary }
    }

    /// Replaces terms and coefficients; errors and summary are kept.
    pub(super) fn with(self, basis: Basis, coefficients: Matrix) -> Self {
        Self::new(basis, coefficients, self.fit_error, self.summary)
    }

    /// Returns mean and variance of each output under the design's distribution.
    pub fn mean_and_variance(&self) -> (Vec<f64>, Vec<f64>) {
        let Sensitivity { mean, variance, .. } = self.moments();
        (mean, variance)
    }

    /// Returns the properties of the fit.
    pub fn summary(&self) -> &Summary {
        &self.summary
    }

    /// Returns the terms over which all outputs are expanded.
    pub fn terms(&self) -> &Terms {
        self.basis.terms()
    }

    /// Returns the standard variables and polynomials of the parameters.
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
        let coefficients = Matrix::from_vec(terms, outputs, numbers.next(terms * outputs));
        let relative = numbers.next(outputs);
        let residuals = Matrix::from_vec(runs, outputs, numbers.next(runs * outputs));
        let mut degrees = header.exponents.iter().enumerate();
        if !degrees.all(|(k, &e)| header.coordinates[k % dimension].reaches(usize::from(e))) {
            return Err(bytes::damaged());
        }
        let terms_of = Terms::from_exponents(dimension, header.exponents);
        Ok(Self::new(
            Basis::new(header.coordinates, terms_of),
            coefficients,
            FitError { relative, residuals },
            header.summary,
        ))
    }
}

impl Forward for Expansion {
    fn dimension(&self) -> usize {
        self.basis.coordinates().len()
    }

    fn outputs(&self) -> usize {
        self.coefficients.columns()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        match &self.sparse {
            Some(sparse) => sparse.mean(&self.basis, points),
            None => multiply(&self.basis.values(points), &self.coefficients),
        }
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let gradient = self.basis.gradient(point);
        match &self.sparse {
            Some(sparse) => sparse.transposed_multiply(&gradient),
            None => transposed_multiply(&self.coefficients, &gradient),
        }
    }

    fn linear(&self) -> Option<&dyn Linear> {
        Some(self)
    }
}

impl Emulator for Expansion {
    fn sensitivity(&self) -> Option<Sensitivity> {
        Some(self.moments())
    }

    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        self.summary.facts(self.basis.terms().len())
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

    fn tables(&self) -> Result<Tables, String> {
        let mut all = Tables::default();
        tables::add_basis(&self.basis, &mut all)?;
        all.matrix("coefficient", "term", "output", &self.coefficients);
        Ok(all)
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

impl Summary {
    /// Returns the facts for the report; `union` is the number of terms of all outputs together.
    fn facts(&self, union: usize) -> Vec<Fact> {
        let one = if self.reduction.is_some() { "a component" } else { "an output" };
        let mut facts = vec![
            Fact::new("solver", self.solver.name()),
            Fact::new("degrees (least, median, largest)", spread(&self.degrees)),
            Fact::new(format!("terms of {one} (least, median, largest)"), spread(&self.terms)),
            Fact::new("terms of all outputs together", union),
            Fact::new("terms to choose from", self.candidates),
        ];
        let mut tell = |name: &str, value: String| facts.push(Fact::new(name, value));
        let range =
            |a: f64, b: f64| if a == b { format!("{a:.3}") } else { format!("{a:.3} to {b:.3}") };
        let least = self.q_norms.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = self.q_norms.iter().copied().fold(0.0, f64::max);
        if least < 1.0 {
            tell("q-norms", range(least, largest));
        }
        if let Selection::KFold(folds) = self.selection {
            tell("selection", format!("each of {folds} parts of the runs left out once"));
        }
        if let Some(rule) = &self.rule {
            tell("quadrature rule", rule.clone());
        }
        if let Some(Reduction { components, left_out }) = self.reduction {
            tell("principal components", components.to_string());
            tell("share of the variance that they leave out", format!("{left_out:.2e}"));
        }
        if let Some(Part { runs, common }) = self.part {
            let of = if common { "; each output has the terms of all" } else { "" };
            tell("runs on which the terms were chosen", format!("{runs}{of}"));
        }
        if self.constant > 0 {
            tell("outputs that do not vary over the runs", self.constant.to_string());
        }
        if self.poor > 0 {
            tell("outputs emulated no better than by their mean", self.poor.to_string());
        }
        if self.optimistic > 0 {
            let name = if self.reduction.is_some() { "components" } else { "outputs" };
            let name =
                format!("{name} with fewer than 3 runs per term, whose error is likely too small");
            tell(&name, self.optimistic.to_string());
        }
        facts
    }
}

/// Formats the least, the median and the largest of some numbers.
fn spread(numbers: &[usize]) -> String {
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable();
    match sorted[..] {
        [] => "none".to_owned(),
        [least, .., largest] => format!("{least}, {}, {largest}", sorted[sorted.len() / 2]),
        [one] => format!("{one}, {one}, {one}"),
    }
}
