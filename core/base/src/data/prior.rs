//! The joint prior of all parameters of a model.

use std::fmt;
use std::sync::Arc;

use rand::Rng;
use rand::rngs::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Serialize, Serializer};

use super::{Parameter, Population};
use crate::math::dependence::Copula;
use crate::math::distribution::Distribution;
use crate::math::random::Stream;

/// A condition on a point of the parameters.
type Holds = dyn Fn(&[f64]) -> bool + Send + Sync;

/// A condition that the parameters fulfil; the prior is zero elsewhere.
#[derive(Clone)]
pub struct Constraint {
    /// The condition as the study writes it, such as `k1 < k2`.
    pub formula: String,
    holds: Arc<Holds>,
}

impl Constraint {
    /// A condition and its test at a point of all parameters.
    pub fn new(formula: &str, holds: impl Fn(&[f64]) -> bool + Send + Sync + 'static) -> Self {
        Self { formula: formula.to_owned(), holds: Arc::new(holds) }
    }
}

impl fmt::Debug for Constraint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Constraint({:?})", self.formula)
    }
}

impl Serialize for Constraint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.formula.serialize(serializer)
    }
}

/// Parameters that depend on each other, by their places among all parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Group {
    /// Places of the parameters.
    pub members: Vec<usize>,
    /// Their dependence.
    pub copula: Copula,
}

/// Probability of the constraints under the prior without them, estimated by draws.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Share {
    /// Draws that fulfil all constraints.
    pub inside: usize,
    /// All draws.
    pub draws: usize,
}

impl Share {
    /// Logarithm of the probability.
    pub fn log(self) -> f64 {
        (self.inside as f64 / self.draws as f64).ln()
    }

    /// Standard error of the logarithm: that of a binomial proportion.
    pub fn log_error(self) -> f64 {
        let (inside, draws) = (self.inside as f64, self.draws as f64);
        ((1.0 - inside / draws) / inside).sqrt()
    }
}

/// Dependence and constraints: all that the joint prior has besides the parameters' own distributions.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Dependence {
    /// Groups of dependent parameters; no parameter is in two.
    pub groups: Vec<Group>,
    /// Populations from which parameters of groups are drawn; no parameter is in two.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub populations: Vec<Population>,
    /// Conditions that all hold.
    pub constraints: Vec<Constraint>,
    /// Probability of the constraints; `None` without constraints.
    pub share: Option<Share>,
}

static INDEPENDENT: Dependence = Dependence {
    groups: Vec::new(),
    populations: Vec::new(),
    constraints: Vec::new(),
    share: None,
};

impl Dependence {
    /// True if the parameters are independent of each other.
    pub fn is_none(&self) -> bool {
        self.groups.is_empty() && self.constraints.is_empty() && self.populations.is_empty()
    }

    /// The population to which a parameter belongs as a member.
    pub fn population_of(&self, place: usize) -> Option<&Population> {
        self.populations.iter().find(|population| population.members.contains(&place))
    }
}

/// Number of draws from which the probability of the constraints is estimated, and the most if few of them are inside.
const DRAWS: usize = 1 << 17;
const MOST: usize = 1 << 20;
/// Number of streams over which the draws are divided.
const PIECES: usize = 32;
/// Number of draws inside the constraints that suffices.
const ENOUGH: usize = 2000;
/// Number of rejected draws after which a draw is given up. With the smallest probability that a study may have, 1e-4, that
/// happens with a probability of e^-100.
const TRIES: usize = 1_000_000;

/// The joint prior of all parameters: their own distributions, what makes them dependent, and constraints.
///
/// ```text
/// p(x) = prod_j p_j(x_j) · prod_groups c(x) · [constraints hold] / P(constraints hold)
/// ```
///
/// For the members of a [`Population`], its density given its unknowns takes the place of `p_j`; their `prior` describes
/// their distribution alone.
#[derive(Debug, Clone, Copy)]
pub struct JointPrior<'a> {
    parameters: &'a [Parameter],
    dependence: &'a Dependence,
}

impl<'a> JointPrior<'a> {
    /// The prior of parameters with this dependence.
    pub fn new(parameters: &'a [Parameter], dependence: &'a Dependence) -> Self {
        Self { parameters, dependence }
    }

    /// The parameters.
    pub fn parameters(&self) -> &'a [Parameter] {
        self.parameters
    }

    /// Copulas and constraints, which the prior has besides the parameters' own distributions.
    pub fn dependence(&self) -> &'a Dependence {
        self.dependence
    }

    /// True if the parameters are independent of each other.
    pub fn is_independent(&self) -> bool {
        self.dependence.is_none()
    }

    /// Standard error of the log density, that of the probability of the constraints.
    pub fn log_error(&self) -> f64 {
        self.dependence.share.map_or(0.0, Share::log_error)
    }

    /// Log density at a point of all parameters; minus infinity outside the support.
    pub fn log_density(&self, point: &[f64]) -> f64 {
        let each = self.parameters.iter().zip(point).enumerate().filter(|(j, _)| self.has_own(*j));
        let own = each.map(|(_, (p, &x))| p.prior.log_density(x)).sum();
        if self.is_independent() || own == f64::NEG_INFINITY {
            own
        } else {
            own + self.joint(point)
        }
    }

    /// True if the density is above zero at a point.
    pub fn allows(&self, point: &[f64]) -> bool {
        let mut each =
            self.parameters.iter().zip(point).enumerate().filter(|(j, _)| self.has_own(*j));
        each.all(|(_, (p, &x))| p.prior.log_density(x).is_finite())
            && (self.is_independent() || self.joint(point).is_finite())
    }

    /// True if the prior of a parameter by itself is a factor of the joint density: unless it is a member of a population.
    pub fn has_own(&self, place: usize) -> bool {
        self.dependence.populations.is_empty() || self.dependence.population_of(place).is_none()
    }

    /// Log density at a point inside the support of every parameter, less the log densities of the parameters' own
    /// distributions; zero if they are independent.
    pub fn joint(&self, point: &[f64]) -> f64 {
        if !self.holds(point) {
            return f64::NEG_INFINITY;
        }
        let of = |group: &Group| {
            let (marginals, values) = self.of_group(group, point);
            group.copula.log_ratio(&marginals, &values)
        };
        let groups: f64 = self.dependence.groups.iter().map(of).sum();
        let populations = self.dependence.populations.iter();
        let members: f64 = populations.map(|own| own.log_density_of_members(point)).sum();
        groups + members - self.dependence.share.map_or(0.0, Share::log)
    }

    /// Adds the derivatives of [`Self::joint`] to those of the parameters' own distributions.
    pub fn add_joint_gradient(&self, point: &[f64], gradient: &mut [f64]) {
        for group in &self.dependence.groups {
            let (marginals, values) = self.of_group(group, point);
            for (&j, slope) in group.members.iter().zip(group.copula.gradient(&marginals, &values))
            {
                gradient[j] += slope;
            }
        }
        for population in &self.dependence.populations {
            population.add_gradient(point, gradient);
        }
    }

    /// A draw. Each number of independent parameters consumes one uniform number.
    pub fn sample(&self, rng: &mut impl Rng) -> Vec<f64> {
        self.sample_where(rng, |_| true)
    }

    /// A draw that also fulfils another condition, by rejection.
    pub fn sample_where(&self, rng: &mut impl Rng, fits: impl Fn(&[f64]) -> bool) -> Vec<f64> {
        let mut point = self.unconstrained(rng);
        for _ in 0..TRIES {
            if self.holds(&point) && fits(&point) {
                break;
            }
            point = self.unconstrained(rng);
        }
        point
    }

    /// Estimates the probability that a draw without the constraints fulfils them; `None` if there are none.
    pub fn share(&self, stream: &Stream) -> Option<Share> {
        let holds = |point: &[f64]| self.holds(point);
        (!self.dependence.constraints.is_empty())
            .then(|| counted(stream, |rng| self.unconstrained(rng), holds))
    }

    /// Estimates the probability that a draw lies in a region.
    pub fn share_of(&self, stream: &Stream, inside: impl Fn(&[f64]) -> bool + Sync) -> Share {
        counted(stream, |rng| self.sample(rng), inside)
    }

    fn holds(&self, point: &[f64]) -> bool {
        self.dependence.constraints.iter().all(|constraint| (constraint.holds)(point))
    }

    fn of_group(&self, group: &Group, point: &[f64]) -> (Vec<&'a Distribution>, Vec<f64>) {
        let parameters = self.parameters;
        let marginals = group.members.iter().map(|&j| &parameters[j].prior).collect();
        (marginals, group.members.iter().map(|&j| point[j]).collect())
    }

    fn unconstrained(&self, rng: &mut impl Rng) -> Vec<f64> {
        let grouped = |j: usize| {
            self.dependence.groups.iter().any(|g| g.members.contains(&j)) || !self.has_own(j)
        };
        let own = |(j, p): (usize, &Parameter)| if grouped(j) { 0.0 } else { p.prior.sample(rng) };
        let mut point: Vec<f64> = self.parameters.iter().enumerate().map(own).collect();
        for group in &self.dependence.groups {
            let (marginals, _) = self.of_group(group, &point);
            for (&j, x) in group.members.iter().zip(group.copula.sample(&marginals, rng)) {
                point[j] = x;
            }
        }
        for population in &self.dependence.populations {
            population.draw_members(&mut point, rng);
        }
        point
    }
}

impl<'a> From<&'a [Parameter]> for JointPrior<'a> {
    fn from(parameters: &'a [Parameter]) -> Self {
        Self { parameters, dependence: &INDEPENDENT }
    }
}

impl<'a> From<&'a Vec<Parameter>> for JointPrior<'a> {
    fn from(parameters: &'a Vec<Parameter>) -> Self {
        Self::from(parameters.as_slice())
    }
}

fn counted(
    stream: &Stream,
    draw: impl Fn(&mut ChaCha8Rng) -> Vec<f64> + Sync,
    inside: impl Fn(&[f64]) -> bool + Sync,
) -> Share {
    let piece = |k: usize| {
        let mut rng = stream.at(k as u64).generator();
        (0..DRAWS / PIECES).filter(|_| inside(&draw(&mut rng))).count()
    };
    let mut share = Share { inside: 0, draws: 0 };
    while share.draws < MOST && share.inside < ENOUGH {
        let first = share.draws / (DRAWS / PIECES);
        share.inside += (first..first + PIECES).into_par_iter().map(piece).sum::<usize>();
        share.draws += DRAWS;
    }
    share
}

#[cfg(test)]
mod tests;
