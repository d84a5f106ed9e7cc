//! The posterior of some parameters, given values of the others.

use std::sync::Arc;

use lacuna::data::Parameter;
use lacuna::plugin::forward::Numbers;
use lacuna::plugin::{Fact, Hyperparameter};
use lacuna_linalg::Matrix;

use super::{LogLikelihood, Posterior};

/// Places of the parameters whose values are given, among all, in ascending order, and the values in natural units.
#[derive(Debug, Clone, PartialEq)]
pub struct CutValues {
    /// Places.
    pub places: Vec<usize>,
    /// Values.
    pub values: Vec<f64>,
}

impl CutValues {
    /// All parameters, from those that are not given.
    pub fn whole(&self, rest: &[f64]) -> Vec<f64> {
        let mut whole = rest.to_vec();
        for (&place, &value) in self.places.iter().zip(&self.values) {
            whole.insert(place, value);
        }
        whole
    }

    /// Those elements that belong to parameters which are not given.
    pub fn rest<T: Clone>(&self, whole: &[T]) -> Vec<T> {
        let kept = whole.iter().enumerate().filter(|(place, _)| !self.places.contains(place));
        kept.map(|(_, value)| value.clone()).collect()
    }
}

impl<'a> Posterior<'a> {
    /// The posterior of the remaining parameters, which are independent of those that are given and of each other.
    pub fn given<'b>(&self, given: CutValues, remaining: &'b [Parameter]) -> Posterior<'b>
    where
        'a: 'b,
    {
        let region = self.region.as_ref().map(|region| given.rest(region));
        let likelihood = Conditional { likelihood: self.likelihood.clone(), given };
        let posterior = Posterior::new(remaining, likelihood).within(region);
        Posterior { numbers: self.numbers, ..posterior }
    }
}

/// A log-likelihood as a function of the remaining parameters.
struct Conditional<'a> {
    likelihood: Arc<dyn LogLikelihood + 'a>,
    given: CutValues,
}

impl Conditional<'_> {
    fn whole(&self, theta: &Matrix) -> Matrix {
        let columns = theta.columns() + self.given.places.len();
        Matrix::from_rows(columns, theta.iter_rows().map(|rest| self.given.whole(rest)))
    }
}

impl LogLikelihood for Conditional<'_> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        self.likelihood.hyperparameters()
    }

    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        self.likelihood.values(&self.whole(theta), hyper)
    }

    fn runs(&self) -> Option<usize> {
        self.likelihood.runs()
    }

    fn estimates(&self, theta: &Matrix, hyper: &Matrix, numbers: Numbers) -> Vec<f64> {
        self.likelihood.estimates(&self.whole(theta), hyper, numbers)
    }

    fn value_and_gradient(&self, theta: &[f64], hyper: &[f64]) -> (f64, Vec<f64>) {
        let (value, slopes) = self.likelihood.value_and_gradient(&self.given.whole(theta), hyper);
        (value, self.given.rest(&slopes))
    }

    fn facts(&self) -> Vec<Fact> {
        self.likelihood.facts()
    }

    fn failure(&self) -> Option<String> {
        self.likelihood.failure()
    }
}
