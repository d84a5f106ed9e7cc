//! Populations: the values that one parameter has in several groups, as draws from one distribution whose location and
//! scale are unknown too.

use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::math::distribution::Distribution;

/// Form of the distribution of a population.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// Normal with unknown mean and standard deviation.
    Normal,
    /// The logarithm is normal: unknown median, and unknown standard deviation of the logarithm.
    LogNormal,
    /// Student's t with these degrees of freedom, unknown location and scale.
    StudentT(f64),
}

/// A population: the places of its members and of its two unknowns among all parameters, or among the unknowns besides them.
///
/// ```text
/// p(members, location, scale) = p(location) p(scale) prod_g f(member_g | location, scale)
/// ```
///
/// The members are exchangeable given location and scale (Gelman and others, Bayesian Data Analysis, 3rd edition, chapter 5).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Population {
    /// Name of the parameter, without its groups.
    pub name: String,
    /// Form of the distribution.
    pub form: Form,
    /// Places of the members.
    pub members: Vec<usize>,
    /// Group to which each member belongs, such as `target=T24`.
    #[serde(skip)]
    pub groups: Vec<String>,
    /// Place of the mean, median or location.
    pub location: usize,
    /// Place of the standard deviation or scale.
    pub scale: usize,
    /// Typical scale: the median of its prior.
    pub typical: f64,
    /// Degree to which the coordinates of the members are centred, from 0 (standardised) to 1 (the values themselves); `None`
    /// if the data decide.
    pub centred: Option<f64>,
}

impl Population {
    /// Log density of a member's value.
    pub fn log_density(&self, value: f64, location: f64, scale: f64) -> f64 {
        match self.law(location, scale) {
            Some(law) => law.log_density(value),
            None => f64::NEG_INFINITY,
        }
    }

    /// Derivatives of [`Self::log_density`] by value, location and scale; zero where the density is.
    pub fn derivatives(&self, value: f64, location: f64, scale: f64) -> [f64; 3] {
        if self.log_density(value, location, scale) == f64::NEG_INFINITY {
            return [0.0; 3];
        }
        let z = self.standard(value, location, scale);
        // Minus the derivative of the standard log density.
        let pull = match self.form {
            Form::StudentT(dof) => (dof + 1.0) * z / (dof + z * z),
            Form::Normal | Form::LogNormal => z,
        };
        let by_scale = (pull * z - 1.0) / scale;
        match self.form {
            Form::LogNormal => [-(pull / scale + 1.0) / value, pull / (scale * location), by_scale],
            Form::Normal | Form::StudentT(_) => [-pull / scale, pull / scale, by_scale],
        }
    }

    /// Log density of all members at a point of all unknowns.
    pub fn log_density_of_members(&self, point: &[f64]) -> f64 {
        let (location, scale) = (point[self.location], point[self.scale]);
        self.members.iter().map(|&j| self.log_density(point[j], location, scale)).sum()
    }

    /// Adds the derivatives of [`Self::log_density_of_members`].
    pub fn add_gradient(&self, point: &[f64], gradient: &mut [f64]) {
        for &j in &self.members {
            let [own, by_location, by_scale] =
                self.derivatives(point[j], point[self.location], point[self.scale]);
            gradient[j] += own;
            gradient[self.location] += by_location;
            gradient[self.scale] += by_scale;
        }
    }

    /// Draws all members, given location and scale at the point.
    pub fn draw_members(&self, point: &mut [f64], rng: &mut impl Rng) {
        for &j in &self.members {
            point[j] = self.sample(point[self.location], point[self.scale], rng);
        }
    }

    /// The same population where all unknowns come this many places later.
    #[must_use]
    pub fn behind(&self, places: usize) -> Self {
        Self {
            members: self.members.iter().map(|j| j + places).collect(),
            location: self.location + places,
            scale: self.scale + places,
            ..self.clone()
        }
    }

    /// The standardised value: its distance from the location in units of the scale, on the scale of logarithms for
    /// [`Form::LogNormal`].
    pub fn standard(&self, value: f64, location: f64, scale: f64) -> f64 {
        (self.linear(value) - self.linear(location)) / scale
    }

    /// The value on the scale on which the population has a location and a scale: itself or its logarithm.
    pub fn linear(&self, value: f64) -> f64 {
        if self.form == Form::LogNormal { value.ln() } else { value }
    }

    /// A draw of a further member.
    pub fn sample(&self, location: f64, scale: f64, rng: &mut impl Rng) -> f64 {
        self.law(location, scale).map_or(location, |law| law.sample(rng))
    }

    /// Bounds of the values of members.
    pub fn support(&self) -> (f64, f64) {
        match self.form {
            Form::LogNormal => (0.0, f64::INFINITY),
            Form::Normal | Form::StudentT(_) => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// The distribution of a member with known location and scale; `None` if there is none.
    fn law(&self, location: f64, scale: f64) -> Option<Distribution> {
        let law = match self.form {
            Form::Normal => Distribution::Normal([location, scale]),
            Form::LogNormal => Distribution::LogNormal([location.ln(), scale]),
            Form::StudentT(dof) => Distribution::StudentT([dof, location, scale]),
        };
        law.check().is_ok().then_some(law)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn population(form: Form) -> Population {
        Population {
            name: "x".into(),
            form,
            members: vec![0, 1],
            groups: vec!["a".into(), "b".into()],
            location: 2,
            scale: 3,
            typical: 1.0,
            centred: None,
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for form in [Form::Normal, Form::LogNormal, Form::StudentT(4.0)] {
            let of = population(form);
            for [value, location, scale] in [[1.3, 2.1, 0.4], [5.0, 0.7, 2.5]] {
                let found = of.derivatives(value, location, scale);
                for (k, found) in found.into_iter().enumerate() {
                    let at = |h: f64| {
                        let mut x = [value, location, scale];
                        x[k] += h;
                        of.log_density(x[0], x[1], x[2])
                    };
                    let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                    assert!(
                        (found - difference).abs() < 1e-7 * (1.0 + found.abs()),
                        "{form:?} {k}"
                    );
                }
            }
        }
    }
}
