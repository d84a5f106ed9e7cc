//! A function that returns errors once a plugin behind it has a fault.

use std::sync::Arc;

use lacuna::plugin::model::EvalError;
use lacuna::run::Fault;
use lacuna_linalg::Matrix;

use super::{Derivatives, Function, Part, Variable};

/// A function of plugins that may have a fault: afterwards it returns errors, because its values would be meaningless.
pub(super) struct Watched<'a> {
    function: &'a dyn Function,
    faults: &'a [Arc<Fault>],
}

impl<'a> Watched<'a> {
    /// Watches a function.
    pub(super) fn new(function: &'a dyn Function, faults: &'a [Arc<Fault>]) -> Self {
        Self { function, faults }
    }

    /// The result, unless a fault occurred that the result has no room for.
    fn sound<T>(&self, answered: Result<T, EvalError>) -> Result<T, EvalError> {
        match self.faults.iter().find_map(|fault| fault.said()) {
            Some(said) => Err(EvalError::Fatal(said.to_owned())),
            None => answered,
        }
    }
}

impl Function for Watched<'_> {
    fn name(&self) -> &'static str {
        self.function.name()
    }

    fn variables(&self) -> Vec<Variable> {
        self.function.variables()
    }

    fn outputs(&self) -> usize {
        self.function.outputs()
    }

    fn scenarios(&self) -> &[Part] {
        self.function.scenarios()
    }

    fn values(&self, point: &[f64], scenario: Option<usize>) -> Result<Vec<f64>, EvalError> {
        self.sound(self.function.values(point, scenario))
    }

    fn batch(&self, points: &Matrix) -> Result<Matrix, EvalError> {
        self.sound(self.function.batch(points))
    }

    fn deviations(&self, points: &Matrix) -> Option<Matrix> {
        self.function.deviations(points)
    }

    fn replicates(&self, points: &Matrix, seed: u64) -> Result<Option<Matrix>, EvalError> {
        self.sound(self.function.replicates(points, seed))
    }

    fn is_local(&self) -> bool {
        self.function.is_local()
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        self.function.derivatives().map(|_| self as &dyn Derivatives)
    }
}

impl Derivatives for Watched<'_> {
    fn jacobian(&self, point: &[f64], scenario: Option<usize>) -> Result<Matrix, EvalError> {
        let derivatives = self.function.derivatives();
        let none = || EvalError::Fatal("this function has no derivatives".to_owned());
        self.sound(derivatives.ok_or_else(none)?.jacobian(point, scenario))
    }

    fn scales(&self) -> Option<Vec<f64>> {
        self.function.derivatives()?.scales()
    }
}
