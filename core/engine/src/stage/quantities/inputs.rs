//! Uncertain inputs of a study without data: those with distributions, and those of which intervals are known.

use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna_linalg::Matrix;

use crate::sensitivity::{Independent, Inputs as _};
use crate::study::Study;

/// Inputs of a propagation: the parameters, then the unknowns of effects. Those with intervals are held at the middle.
pub(super) struct PropagatedInputs {
    /// Names of the inputs with distributions.
    pub names: Vec<String>,
    /// Their distributions.
    pub laws: Vec<Distribution>,
    /// Medians of the distributions and middles of the intervals, for all inputs.
    pub middle: Vec<f64>,
    /// Places of the inputs with distributions among all.
    places: Vec<usize>,
}

/// Names of all inputs with their priors, which are no distributions for those with intervals.
pub(super) fn priors(study: &Study) -> Vec<(String, Distribution)> {
    let own = study.parameters.iter().map(|p| (p.name.clone(), p.prior.clone()));
    let of_effects = study.placed_effects().into_iter().flat_map(|e| e.hyperparameters());
    own.chain(of_effects.map(|unknown| (unknown.name, unknown.prior))).collect()
}

impl PropagatedInputs {
    /// The inputs of a study.
    pub fn of(study: &Study) -> Self {
        let all = priors(study);
        let middle = all.iter().map(|(_, law)| law.quantile(0.5)).collect();
        let intervals = study.intervals();
        let places: Vec<usize> = (0..all.len()).filter(|j| !intervals.contains(j)).collect();
        let (names, laws) = places.iter().map(|&j| all[j].clone()).unzip();
        Self { names, laws, middle, places }
    }

    /// The inputs with distributions.
    pub fn independent(&self) -> Independent {
        Independent(self.laws.clone())
    }

    /// A point of all inputs from one of those with distributions.
    pub fn full(&self, drawn: &[f64]) -> Vec<f64> {
        let mut point = self.middle.clone();
        self.places.iter().zip(drawn).for_each(|(&j, &value)| point[j] = value);
        point
    }

    /// Points of all inputs from those with distributions, one per row.
    pub fn full_rows(&self, drawn: &Matrix) -> Matrix {
        Matrix::from_rows(self.middle.len(), drawn.iter_rows().map(|row| self.full(row)))
    }

    /// A draw of all inputs.
    pub fn draw(&self, stream: &Stream) -> Vec<f64> {
        self.full(&self.independent().draw(stream))
    }
}
