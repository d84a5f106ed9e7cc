//! Populations of a posterior: those of its parameters, and those of unknowns besides them.

use lacuna::data::Population;

use super::Posterior;

impl Posterior<'_> {
    /// The same density in coordinates whose members are centred to these degrees, from 0 to 1 and in the order of
    /// [`Self::centred`], where the study leaves that to the data. With the information of the data on each member its
    /// [`Self::mode`] is that with the members integrated out.
    #[must_use]
    pub fn with_centred(&self, centred: &[f64], information: &[f64]) -> Self {
        let mut members = self.members.clone();
        members.set(centred, information);
        self.with_members(members)
    }

    /// The same density in coordinates whose members are standardised, whatever the study says.
    #[must_use]
    pub fn standardised(&self) -> Self {
        let mut members = self.members.clone();
        members.standardise();
        self.with_members(members)
    }

    /// Populations of parameters, then those of unknowns besides them, by their places among all unknowns.
    pub fn populations(&self) -> &[Population] {
        self.members.populations()
    }

    /// Populations of unknowns besides the parameters.
    pub(super) fn besides(&self) -> &[Population] {
        &self.populations()[self.prior.dependence().populations.len()..]
    }

    /// Name of the unknown at a place.
    pub fn name(&self, place: usize) -> &str {
        match self.parameters().get(place) {
            Some(parameter) => &parameter.name,
            None => &self.hyperparameters()[place - self.parameters().len()].name,
        }
    }

    /// Degree to which the coordinate of each member of a population is centred: population after population.
    pub fn centred(&self) -> Vec<f64> {
        self.members.centred()
    }

    /// True if the prior of the unknown at a place is a factor of the joint density: unless it is a member of a population.
    pub(super) fn has_own(&self, place: usize) -> bool {
        self.members.is_empty() || !self.members.has(place)
    }
}
