//! The fitted expansion.

use std::borrow::Cow;

use lacuna::plugin::forward::{Linear, SumOfSquares};
use lacuna::plugin::surrogate::{FitError, Sensitivity, Tables};
use lacuna::plugin::{Emulator, Fact, Forward};
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply, transposed_multiply};
use serde::{Deserialize, Serialize};

use super::coordinate::Coordinate;
use super::errors::{Errors, OfComponents};
use super::functions::Functions;
use super::options::{Selection, Solver};
use super::sparse::Sparse;
use super::squares::Squares;
use super::terms::{Basis, Terms};
use super::{bytes, sensitivity, tables};

/// A polynomial chaos expansion of all outputs over the union of their terms, or over few components.
#[derive(Debug, Clone, PartialEq)]
pub struct Expansion {
    functions: Functions,
    /// Coefficients (`functions x outputs`).
    coefficients: Matrix,
    /// Sparse form of the coefficients, if most of them are zero.
    sparse: Option<Sparse>,
    errors: Errors,
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
    /// Number of functions that combine the basis functions, if there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    combined: Option<usize>,
    outputs: usize,
    runs: usize,
    /// True if the errors are those of the components.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    errors_of_components: bool,
    summary: Summary,
}

impl Header {
    /// Returns the sizes of the arrays: combinations, coefficients, relative errors, residuals and the factors on those of
    /// components; `None` if they make no sense.
    fn sizes(&self) -> Option<[(usize, usize); 5]> {
        let (dimension, outputs) = (self.coordinates.len(), self.outputs);
        if dimension == 0 || !self.exponents.len().is_multiple_of(dimension) {
            return None;
        }
        let terms = self.exponents.len() / dimension;
        let functions = self.combined.unwrap_or(terms);
        let combined = self.combined.map_or((0, 0), |functions| (terms, functions));
        let (residuals, factors) = if self.errors_of_components {
            (self.combined?.checked_sub(1)?, outputs)
        } else {
            (outputs, 0)
        };
        Some([combined, (functions, outputs), (1, outputs), (self.runs, residuals), (1, factors)])
    }

    /// Returns the number of values of arrays of these sizes.
    fn count(sizes: [(usize, usize); 5]) -> Option<usize> {
        sizes
            .iter()
            .try_fold(0, |sum: usize, &(rows, columns)| sum.checked_add(rows.checked_mul(columns)?))
    }
}

/// Number of outputs whose coefficients of all terms are in memory at a time.
const BLOCK: usize = 4096;

impl Expansion {
    pub(super) fn new(
        functions: Functions,
        coefficients: Matrix,
        errors: Errors,
        summary: Summary,
    ) -> Self {
        let of_outputs = functions.combined.is_none();
        let sparse = of_outputs.then(|| Sparse::of(&coefficients)).flatten();
        Self { functions, coefficients, sparse, errors, summary }
    }

    /// Replaces terms and coefficients; errors and summary are kept.
    pub(super) fn with(self, basis: Basis, coefficients: Matrix) -> Self {
        let errors = Errors::OfOutputs(self.errors.whole(&self.coefficients).clone());
        Self::new(Functions::of(basis), coefficients, errors, self.summary)
    }

    /// Returns the coefficients of all terms (`terms x outputs`).
    pub fn of_terms(&self) -> Cow<'_, Matrix> {
        self.functions.of_terms(&self.coefficients)
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
        self.functions.basis.terms()
    }

    /// Returns the standard variables and polynomials of the parameters.
    pub fn basis_coordinates(&self) -> Vec<Coordinate> {
        self.functions.basis.coordinates().to_vec()
    }

    fn moments(&self) -> Sensitivity {
        let coefficients = |outputs: &[usize]| {
            let own = self.coefficients.select_columns(outputs);
            self.functions.of_terms(&own).into_owned()
        };
        if self.functions.combined.is_none() {
            return sensitivity::sensitivity(self.terms(), &self.coefficients, self.dimension());
        }
        let outputs: Vec<usize> = (0..self.outputs()).collect();
        let blocks = outputs.chunks(BLOCK).map(coefficients);
        sensitivity::of_blocks(self.terms(), blocks, self.dimension())
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, Stop> {
        let (header, mut numbers) = bytes::read::<Header>(bytes)?;
        let sizes = header.sizes().ok_or_else(bytes::damaged)?;
        if Header::count(sizes) != Some(numbers.len()) {
            return Err(bytes::damaged());
        }
        let mut next = |(rows, columns): (usize, usize)| {
            Matrix::from_vec(rows, columns, numbers.next(rows * columns))
        };
        let [combined, coefficients, relative, residuals, factors] = sizes.map(&mut next);
        let dimension = header.coordinates.len();
        let mut degrees = header.exponents.iter().enumerate();
        if !degrees.all(|(k, &e)| header.coordinates[k % dimension].reaches(usize::from(e))) {
            return Err(bytes::damaged());
        }
        let terms_of = Terms::from_exponents(dimension, header.exponents);
        let basis = Basis::new(header.coordinates, terms_of);
        let combined = header.combined.map(|_| combined);
        let relative = relative.into_vec();
        let errors = if header.errors_of_components {
            let factors = factors.into_vec();
            Errors::OfComponents(OfComponents::new(relative, residuals, factors))
        } else {
            Errors::OfOutputs(FitError { relative, residuals })
        };
        Ok(Self::new(Functions { basis, combined }, coefficients, errors, header.summary))
    }
}

impl Forward for Expansion {
    fn dimension(&self) -> usize {
        self.functions.basis.coordinates().len()
    }

    fn outputs(&self) -> usize {
        self.coefficients.columns()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        match &self.sparse {
            Some(sparse) => sparse.mean(&self.functions.basis, points),
            None => multiply(&self.functions.values(points), &self.coefficients),
        }
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let gradient = self.functions.gradient(point);
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
        self.errors.whole(&self.coefficients)
    }

    fn relative_error(&self) -> &[f64] {
        self.errors.relative()
    }

    fn left_out(&self, runs: &[usize], outputs: &[usize]) -> Matrix {
        self.errors.at(&self.coefficients, runs, outputs)
    }

    fn facts(&self) -> Vec<Fact> {
        self.summary.facts(self.terms().len())
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        let header = Header {
            coordinates: self.basis_coordinates(),
            exponents: self.terms().exponents().to_vec(),
            combined: self.functions.combined.as_ref().map(Matrix::columns),
            outputs: self.outputs(),
            runs: self.errors.residuals().rows(),
            errors_of_components: matches!(self.errors, Errors::OfComponents(_)),
            summary: self.summary.clone(),
        };
        let numbers = [
            self.functions.combined.as_ref().map_or(&[][..], Matrix::as_slice),
            self.coefficients.as_slice(),
            self.errors.relative(),
            self.errors.residuals().as_slice(),
            match &self.errors {
                Errors::OfOutputs(_) => &[],
                Errors::OfComponents(errors) => &errors.factors,
            },
        ];
        bytes::write(&header, &numbers)
    }

    fn tables(&self) -> Result<Tables, String> {
        let mut all = Tables::default();
        tables::add_basis(&self.functions.basis, &mut all)?;
        all.matrix("coefficient", "term", "output", &self.of_terms());
        Ok(all)
    }
}

impl Linear for Expansion {
    fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        self.functions.values(points)
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        self.functions.gradient(point)
    }

    fn sum_of_squares(&self, factor: &Matrix) -> Option<Box<dyn SumOfSquares>> {
        let factor = self.functions.factor_of_terms(factor);
        let squares = Squares::new(&self.functions.basis, &factor)?;
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
