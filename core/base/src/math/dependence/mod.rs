//! Dependence of several numbers whose own distributions are known: copulas, and the Dirichlet distribution.
//!
//! By Sklar's theorem a joint density is the product of the marginal densities and of a copula density, which is a function
//! of the marginals' probabilities (Joe, Dependence Modeling with Copulas (2014), chapter 1). Copulas are written here as
//! functions of the normal scores of the values, `z = Phi^-1(F(x))`: they keep their digits in both tails, and normal
//! marginals with a Gaussian copula are exactly the multivariate normal distribution.

mod archimedean;
mod correlation;
mod elliptical;
mod mixture;
mod simplex;

use rand::Rng;
use serde::Serialize;

pub use archimedean::Family;
pub use correlation::Correlation;
pub use mixture::Mixture;

use crate::math::distribution::Distribution;
use crate::math::special::HALF_LN_TWO_PI;

/// How several numbers depend on each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Copula {
    /// Gaussian copula: the normal scores have a multivariate normal distribution with this correlation.
    Gaussian(Correlation),
    /// Copula of the multivariate Student t distribution with this correlation and these degrees of freedom.
    StudentT(Correlation, f64),
    /// Archimedean copula of two numbers, with its parameter theta.
    Archimedean(Family, f64),
    /// Dirichlet distribution of shares with these concentrations, one more than there are numbers: the last share is what
    /// the others leave of 1. The marginals are its beta distributions, see [`Copula::marginals_of_shares`].
    Dirichlet(Vec<f64>),
    /// Mixture of normal distributions of the normal scores. The marginals are those of the mixture, about standard normal.
    Mixture(Mixture),
}

impl Copula {
    /// Beta distributions of the shares under a Dirichlet distribution, without the last share.
    pub fn marginals_of_shares(concentrations: &[f64]) -> Vec<Distribution> {
        let sum: f64 = concentrations.iter().sum();
        let own = &concentrations[..concentrations.len() - 1];
        own.iter().map(|&a| Distribution::Beta([a, sum - a, 0.0, 1.0])).collect()
    }

    /// Logarithm of the joint density at `x`, less that of the product of the marginal densities; minus infinity where the
    /// joint density is zero.
    pub fn log_ratio(&self, marginals: &[&Distribution], x: &[f64]) -> f64 {
        let value = match self {
            Self::Gaussian(correlation) => elliptical::gaussian(correlation, &scores(marginals, x)),
            Self::StudentT(correlation, dof) => {
                elliptical::student(correlation, *dof, &scores(marginals, x))
            }
            Self::Archimedean(family, theta) => {
                let z = scores(marginals, x);
                family.log_density(*theta, [z[0], z[1]])
            }
            Self::Dirichlet(concentrations) => simplex::log_ratio(concentrations, x),
            Self::Mixture(mixture) => {
                let z = scores(marginals, x);
                let normal: f64 = z.iter().map(|z| -0.5 * z * z - HALF_LN_TWO_PI).sum();
                mixture.log_density(&z) - normal
            }
        };
        if value.is_nan() || value == f64::INFINITY { f64::NEG_INFINITY } else { value }
    }

    /// Derivatives of [`Self::log_ratio`] by `x`.
    pub fn gradient(&self, marginals: &[&Distribution], x: &[f64]) -> Vec<f64> {
        let z = scores(marginals, x);
        let by_score = match self {
            Self::Gaussian(correlation) => elliptical::gaussian_slopes(correlation, &z),
            Self::StudentT(correlation, dof) => elliptical::student_slopes(correlation, *dof, &z),
            Self::Archimedean(family, theta) => family.slopes(*theta, [z[0], z[1]]).to_vec(),
            Self::Dirichlet(concentrations) => return simplex::slopes(concentrations, x),
            Self::Mixture(mixture) => {
                mixture.slopes(&z).iter().zip(&z).map(|(slope, z)| slope + z).collect()
            }
        };
        let chained = by_score.iter().zip(marginals).zip(x.iter().zip(&z));
        chained
            .map(|((slope, law), (&x, &z))| {
                let slope = slope * law.score_slope(x, z);
                if slope.is_finite() { slope } else { 0.0 }
            })
            .collect()
    }

    /// A draw of all numbers.
    pub fn sample(&self, marginals: &[&Distribution], rng: &mut impl Rng) -> Vec<f64> {
        let z = match self {
            Self::Gaussian(correlation) => elliptical::draw_gaussian(correlation, rng),
            Self::StudentT(correlation, dof) => elliptical::draw_student(correlation, *dof, rng),
            Self::Archimedean(family, theta) => family.draw(*theta, rng).to_vec(),
            Self::Dirichlet(concentrations) => return simplex::draw(concentrations, rng),
            Self::Mixture(mixture) => mixture.sample(rng),
        };
        marginals.iter().zip(z).map(|(law, z)| law.at_score(z)).collect()
    }
}

fn scores(marginals: &[&Distribution], x: &[f64]) -> Vec<f64> {
    marginals.iter().zip(x).map(|(law, &x)| law.score(x)).collect()
}

#[cfg(test)]
mod tests;
