//! The Gaussian copula and that of Student's t distribution (`McNeil`, Frey, Embrechts, Quantitative Risk Management (2015),
//! section 7.3), as functions of normal scores.

use rand::Rng;

use super::Correlation;
use crate::math::distribution::Distribution;
use crate::math::random::normal;
use crate::math::special::{HALF_LN_TWO_PI, ln_gamma};

pub(super) fn gaussian(correlation: &Correlation, z: &[f64]) -> f64 {
    let white = correlation.whiten(z);
    let excess: f64 =
        white.iter().map(|w| w * w).sum::<f64>() - z.iter().map(|z| z * z).sum::<f64>();
    -0.5 * (excess + correlation.log_determinant())
}

pub(super) fn gaussian_slopes(correlation: &Correlation, z: &[f64]) -> Vec<f64> {
    correlation.solve(z).iter().zip(z).map(|(solved, z)| z - solved).collect()
}

pub(super) fn draw_gaussian(correlation: &Correlation, rng: &mut impl Rng) -> Vec<f64> {
    let white: Vec<f64> = correlation.rows().iter().map(|_| normal(rng)).collect();
    correlation.colour(&white)
}

pub(super) fn student(correlation: &Correlation, dof: f64, z: &[f64]) -> f64 {
    let law = Distribution::StudentT([dof, 0.0, 1.0]);
    let t: Vec<f64> = z.iter().map(|&z| law.at_score(z)).collect();
    let (d, square) = (z.len() as f64, square(correlation, &t));
    let joint = ln_gamma(0.5 * (dof + d))
        - ln_gamma(0.5 * dof)
        - 0.5 * d * (dof * std::f64::consts::PI).ln()
        - 0.5 * correlation.log_determinant()
        - 0.5 * (dof + d) * (square / dof).ln_1p();
    joint - t.iter().map(|&t| law.log_density(t)).sum::<f64>()
}

pub(super) fn student_slopes(correlation: &Correlation, dof: f64, z: &[f64]) -> Vec<f64> {
    let law = Distribution::StudentT([dof, 0.0, 1.0]);
    let t: Vec<f64> = z.iter().map(|&z| law.at_score(z)).collect();
    let (d, square) = (z.len() as f64, square(correlation, &t));
    let solved = correlation.solve(&t);
    let slope = |j: usize| {
        let joint = -(dof + d) * solved[j] / (dof + square);
        let by_score = (-0.5 * z[j] * z[j] - HALF_LN_TWO_PI - law.log_density(t[j])).exp();
        (joint - law.log_density_derivative(t[j])) * by_score
    };
    (0..z.len()).map(slope).collect()
}

pub(super) fn draw_student(correlation: &Correlation, dof: f64, rng: &mut impl Rng) -> Vec<f64> {
    let z = draw_gaussian(correlation, rng);
    let chi_square = Distribution::Gamma([0.5 * dof, 2.0]).sample(rng);
    let law = Distribution::StudentT([dof, 0.0, 1.0]);
    z.iter().map(|z| law.score(-(z * (dof / chi_square).sqrt()).abs()) * -z.signum()).collect()
}

fn square(correlation: &Correlation, t: &[f64]) -> f64 {
    correlation.whiten(t).iter().map(|w| w * w).sum()
}
