//! Parameters that the model does not use: the emulator leaves them out, so that their posteriors equal their priors.
//!
//! A surrogate trained on them would find chance correlations with the responses, and the posterior would be narrower
//! than the prior for no reason.

use lacuna::data::Parameter;
use lacuna::plugin::forward::{Linear, SumOfSquares};
use lacuna::plugin::surrogate::{FitError, Indices, Processes, Tables};
use lacuna::plugin::{Emulator, Fact, Forward, Sensitivity};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::simulator::Simulator;
use crate::study::Study;

/// Indices of the parameters on which no response of the study's model depends; empty if the runs are not those of the
/// model.
pub(super) fn parameters(study: &Study) -> Result<Vec<usize>, Stop> {
    let own = study.surrogate.is_none() || study.design.is_some();
    match Simulator::of(study)?.filter(|_| own) {
        Some(simulator) => {
            // Location and scale of a population act through its members.
            let mut idle = simulator.idle(study.parameters.len());
            idle.retain(|&i| !study.unknowns[i].of_population());
            Ok(idle)
        }
        None => Ok(Vec::new()),
    }
}

/// Parameters on which a surrogate is trained.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Used {
    indices: Vec<usize>,
    /// Number of all parameters.
    of: usize,
}

impl Used {
    /// All parameters except those that the model does not use; all of them if it uses none.
    pub fn of(study: &Study) -> Result<Self, Stop> {
        let (idle, of) = (parameters(study)?, study.parameters.len());
        let indices: Vec<usize> = (0..of).filter(|i| !idle.contains(i)).collect();
        Ok(Self { indices: if indices.is_empty() { (0..of).collect() } else { indices }, of })
    }

    /// Selects all of `of` parameters.
    pub fn all(of: usize) -> Self {
        Self { indices: (0..of).collect(), of }
    }

    /// Indices of the used parameters.
    pub fn indices(&self) -> &[usize] {
        &self.indices
    }

    /// Selects the used parameters.
    pub fn parameters(&self, all: &[Parameter]) -> Vec<Parameter> {
        self.indices.iter().map(|&i| all[i].clone()).collect()
    }

    /// Selects the columns of the used parameters.
    pub fn points(&self, all: &Matrix) -> Matrix {
        all.select_columns(&self.indices)
    }

    fn point(&self, all: &[f64]) -> Vec<f64> {
        self.indices.iter().map(|&i| all[i]).collect()
    }

    /// One column per parameter, zero for unused ones.
    fn spread(&self, matrix: &Matrix) -> Matrix {
        let mut whole = Matrix::zeros(matrix.rows(), self.of);
        for row in 0..matrix.rows() {
            for (column, &i) in self.indices.iter().enumerate() {
                whole[(row, i)] = matrix[(row, column)];
            }
        }
        whole
    }

    /// Converts an emulator of the used parameters to one of all parameters.
    pub fn widen(self, emulator: Box<dyn Emulator>) -> Box<dyn Emulator> {
        if self.indices.len() == self.of {
            return emulator;
        }
        Box::new(Widened { emulator, used: self, nothing: Matrix::default() })
    }
}

/// An emulator that does not depend on some of its parameters.
struct Widened {
    emulator: Box<dyn Emulator>,
    used: Used,
    /// Empty coefficients, for an emulator that is not linear.
    nothing: Matrix,
}

impl Forward for Widened {
    fn dimension(&self) -> usize {
        self.used.of
    }

    fn outputs(&self) -> usize {
        self.emulator.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.emulator.mean(&self.used.points(points))
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        self.emulator.variance(&self.used.points(points))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.used.spread(&self.emulator.jacobian(&self.used.point(point)))
    }

    fn linear(&self) -> Option<&dyn Linear> {
        self.emulator.linear().map(|_| self as &dyn Linear)
    }

    fn failure(&self) -> Option<String> {
        self.emulator.failure()
    }
}

impl Linear for Widened {
    fn coefficients(&self) -> &Matrix {
        self.emulator.linear().map_or(&self.nothing, Linear::coefficients)
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        let points = self.used.points(points);
        self.emulator.linear().map_or_else(Matrix::default, |linear| linear.basis(&points))
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        let gradient = |linear: &dyn Linear| linear.basis_gradient(&self.used.point(point));
        self.used.spread(&self.emulator.linear().map_or_else(Matrix::default, gradient))
    }

    fn sum_of_squares(&self, factor: &Matrix) -> Option<Box<dyn SumOfSquares>> {
        let sum = self.emulator.linear()?.sum_of_squares(factor)?;
        Some(Box::new(WidenedSum { sum, used: self.used.clone() }))
    }
}

impl Processes for Widened {
    fn directions(&self) -> Matrix {
        self.emulator.processes().map_or_else(Matrix::default, Processes::directions)
    }

    fn covariances(&self, points: &Matrix) -> Vec<Matrix> {
        let points = self.used.points(points);
        self.emulator.processes().map_or_else(Vec::new, |inner| inner.covariances(&points))
    }

    fn noise(&self) -> Vec<f64> {
        self.emulator.processes().map_or_else(Vec::new, Processes::noise)
    }
}

impl Emulator for Widened {
    fn processes(&self) -> Option<&dyn Processes> {
        self.emulator.processes().map(|_| self as &dyn Processes)
    }

    fn sensitivity(&self) -> Option<Sensitivity> {
        let known = self.emulator.sensitivity()?;
        let spread = |indices: Indices| Indices {
            first: self.used.spread(&indices.first),
            total: self.used.spread(&indices.total),
            pairs: indices.pairs,
        };
        let pair = |[i, j]: [usize; 2]| [self.used.indices[i], self.used.indices[j]];
        Some(Sensitivity {
            pairs: known.pairs.into_iter().map(pair).collect(),
            outputs: spread(known.outputs),
            aggregated: spread(known.aggregated),
            ..known
        })
    }

    fn fit_error(&self) -> &FitError {
        self.emulator.fit_error()
    }

    fn relative_error(&self) -> &[f64] {
        self.emulator.relative_error()
    }

    fn left_out(&self, runs: &[usize], outputs: &[usize]) -> Matrix {
        self.emulator.left_out(runs, outputs)
    }

    fn facts(&self) -> Vec<Fact> {
        self.emulator.facts()
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        self.emulator.save()
    }

    fn tables(&self) -> Result<Tables, String> {
        Ok(Tables { parameters: self.used.indices.clone(), ..self.emulator.tables()? })
    }
}

/// A sum of squares that does not depend on some of the parameters.
struct WidenedSum {
    sum: Box<dyn SumOfSquares>,
    used: Used,
}

impl SumOfSquares for WidenedSum {
    fn values(&self, points: &Matrix) -> Vec<f64> {
        self.sum.values(&self.used.points(points))
    }

    fn gradient(&self, point: &[f64]) -> Vec<f64> {
        let mut whole = vec![0.0; self.used.of];
        let gradient = self.sum.gradient(&self.used.point(point));
        for (&i, slope) in self.used.indices.iter().zip(gradient) {
            whole[i] = slope;
        }
        whole
    }

    fn covers(&self, point: &[f64]) -> bool {
        self.sum.covers(&self.used.point(point))
    }

    fn error(&self) -> f64 {
        self.sum.error()
    }
}
