//! The evidence of a fit with a remainder, by Laplace's method at its point.

use std::f64::consts::TAU;

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed, multiply_vector};

use super::{Setting, Spectrum, WhiteRemainder};
use crate::gap::system::fit::Fit;

/// A fit expanded about its point: its whitened residual and slopes, and their parts along the remainder.
pub(super) struct Expansion<'a> {
    fit: &'a Fit,
    remainder: &'a WhiteRemainder,
    /// The products of each length's directions with the residual, and with the slopes `directions x unknowns`.
    along: Vec<(Vec<f64>, Matrix)>,
    gram: Matrix,
    prior: Vec<f64>,
}

impl<'a> Expansion<'a> {
    pub fn of(remainder: &'a WhiteRemainder, fit: &'a Fit) -> Self {
        let each = |spectrum: &Spectrum| {
            let residual = multiply_vector(&spectrum.directions, &fit.residual);
            (residual, multiply_transposed(&spectrum.directions, &fit.slopes))
        };
        let along = remainder.spectra.iter().map(each).collect();
        let gram = multiply_transposed(&fit.slopes, &fit.slopes);
        let least = fit.prior_precision.iter().zip(&fit.prior_curvature);
        let prior = least.map(|(least, curvature)| least.max(*curvature)).collect();
        Self { fit, remainder, along, gram, prior }
    }

    /// The shares of the directions that the remainder of a setting takes, `v / (1 + v)`.
    fn shares(&self, setting: Setting) -> Vec<f64> {
        let v = self.remainder.spectra[setting.length].variances.iter();
        v.map(|v| v * setting.size.powi(2)).map(|v| v / (1.0 + v)).collect()
    }

    /// The log evidence by Laplace's method at the point of the fit. The unknowns are not moved along the slopes to
    /// their best values under another remainder: far from linear, that would promise what no point keeps.
    pub fn log_evidence(&self, setting: Option<Setting>) -> Option<f64> {
        let d = self.gram.rows();
        let (z, noise) = (&self.fit.residual, self.fit.noise_scale);
        let (mut square, mut hessian, mut log_determinant) = (dot(z, z), self.gram.clone(), 0.0);
        if let Some(setting) = setting {
            let (residual, slopes) = &self.along[setting.length];
            for (k, share) in self.shares(setting).iter().enumerate() {
                square -= share * residual[k].powi(2);
                log_determinant -= (-share).ln_1p();
                let row = slopes.row(k);
                for i in 0..d {
                    for j in 0..d {
                        hessian[(i, j)] -= share * row[i] * row[j];
                    }
                }
            }
        }
        let precision = noise.precision(square);
        hessian.as_mut_slice().iter_mut().for_each(|x| *x *= precision);
        for (j, p) in self.prior.iter().enumerate() {
            hessian[(j, j)] += p;
        }
        let scale: Vec<f64> =
            (0..d).map(|j| 1.0 / hessian[(j, j)].max(f64::MIN_POSITIVE).sqrt()).collect();
        let scaled = Matrix::from_fn(d, d, |i, j| scale[i] * hessian[(i, j)] * scale[j]);
        let factor = Cholesky::new(&scaled).ok()?;
        let widths = scale.iter().map(|s| s.ln()).sum::<f64>() - 0.5 * factor.log_determinant();
        let half = 0.5 * d as f64 * TAU.ln();
        let log_density = noise.log_density(square) - 0.5 * log_determinant;
        Some(self.fit.log_prior + log_density + half + widths)
    }
}
