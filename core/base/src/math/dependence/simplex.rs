//! The Dirichlet distribution of shares without the last one, relative to its beta marginals (Gelman et al., Bayesian Data
//! Analysis (2013), appendix A).

use rand::Rng;

use crate::math::distribution::Distribution;
use crate::math::special::ln_gamma;

/// Log density less the log densities of the marginals.
pub(super) fn log_ratio(concentrations: &[f64], x: &[f64]) -> f64 {
    let rest = 1.0 - x.iter().sum::<f64>();
    if rest <= 0.0 || x.iter().any(|&x| x <= 0.0) {
        return f64::NEG_INFINITY;
    }
    let sum: f64 = concentrations.iter().sum();
    let last = concentrations[x.len()];
    let own =
        |(&a, &x): (&f64, &f64)| ln_gamma(sum) - ln_gamma(sum - a) + (sum - a - 1.0) * (-x).ln_1p();
    let marginals: f64 = concentrations.iter().zip(x).map(own).sum();
    ln_gamma(sum) - ln_gamma(last) + (last - 1.0) * rest.ln() - marginals
}

pub(super) fn slopes(concentrations: &[f64], x: &[f64]) -> Vec<f64> {
    let rest = 1.0 - x.iter().sum::<f64>();
    let sum: f64 = concentrations.iter().sum();
    let last = concentrations[x.len()];
    let own = |(&a, &x): (&f64, &f64)| (sum - a - 1.0) / (1.0 - x) - (last - 1.0) / rest;
    concentrations.iter().zip(x).map(own).collect()
}

pub(super) fn draw(concentrations: &[f64], rng: &mut impl Rng) -> Vec<f64> {
    let sizes: Vec<f64> =
        concentrations.iter().map(|&a| Distribution::Gamma([a, 1.0]).sample(rng)).collect();
    let sum: f64 = sizes.iter().sum();
    sizes[..sizes.len() - 1].iter().map(|size| size / sum).collect()
}
