//! Scales on which the coordinates of a posterior are.

use serde::{Deserialize, Serialize};

use super::Posterior;

/// Relation of a coordinate of the sampler to the value of its unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CoordinateScale {
    /// The value itself.
    Natural,
    /// The logarithm of the value.
    Logarithmic,
    /// The place of a member in its population, which depends on location and scale of the population.
    OfPopulation,
}

impl Posterior<'_> {
    /// Scale of each coordinate.
    pub fn scales(&self) -> Vec<CoordinateScale> {
        let parameters = self.parameters().iter().map(|_| CoordinateScale::Natural);
        let hyper = self
            .hyperparameters()
            .iter()
            .map(|h| if h.log { CoordinateScale::Logarithmic } else { CoordinateScale::Natural });
        let mut scales: Vec<CoordinateScale> = parameters.chain(hyper).collect();
        for population in self.populations() {
            scales[population.scale] = CoordinateScale::Logarithmic;
            for &place in &population.members {
                scales[place] = CoordinateScale::OfPopulation;
            }
        }
        scales
    }
}
