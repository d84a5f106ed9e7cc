//! The remainder: what a candidate that is not exactly true leaves of the gap.
//!
//! Data are compared with `effect(model(theta)) + remainder + noise`. The remainder is a Gaussian process over sensors
//! and time, `tau^2 (K_sensors x K_time)` in units of the noise of the mean, whose size `tau` and length are learned:
//! they have a prior on a grid, and the evidence is summed over it. Without a remainder every probability assumes that
//! one of the candidates is exactly true, and rich data then choose wrong partners for a candidate that is nearly true
//! (Kennedy and O'Hagan, Journal of the Royal Statistical Society B 63 (2001) 425; Brynjarsdottir and O'Hagan, Inverse
//! Problems 30 (2014) 114007).
//!
//! `K_sensors` mixes the correlation of the sensors' responses to the parameters with the identity: physics that is
//! missing acts on the sensors as the known physics does, or on one alone. `K_time` is the squared exponential in the
//! cosine basis of Solin and Särkkä (Statistics and Computing 30 (2020) 419), which needs no decomposition and no
//! regular grid. Where candidates act inside a companion, a further covariance is that of the companion's errors on the
//! simulation runs: what such a candidate leaves may have their form.

mod directions;
mod expansion;

use lacuna::math::moments::log_sum;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna_linalg::vector::dot;
use lacuna_linalg::{
    Cholesky, Matrix, multiply_transposed, multiply_vector, symmetric_eigen, transposed_multiply,
};

use super::System;
use super::fit::{Fit, fit};
use super::whitener::Whitener;
use directions::{groups, of_forms, of_group};
use expansion::Expansion;

use crate::gap::experiment::{Experiment, MeasuredCurve};
use crate::gap::noise::{Noise, ResponseTangents};

/// The lengths of the process, as shares of a curve.
const LENGTHS: [f64; 2] = [0.03, 0.1];

/// The sizes, in standard deviations of the noise of the mean.
const SIZES: [f64; 7] = [0.3, 0.55, 1.0, 1.8, 3.0, 5.5, 10.0];

/// The largest number of directions of one length.
const DIRECTIONS: usize = 500;

/// The largest number of fits under a remainder.
const REFITS: usize = 2;

/// The smallest energy of a direction, in units of the noise, in [`Remainder::common`].
const MATTERS: f64 = 0.3;

/// The smallest variance of a whitened direction at the largest size.
const NEGLIGIBLE: f64 = 1e-4;

/// The remainder of an experiment: one factor `directions x outputs` a length, and one of known forms if there are any, in
/// the response's unit at size one.
#[derive(Debug, Clone)]
pub struct Remainder {
    factors: Vec<Matrix>,
    /// The variance of each direction at size one, about in units of the noise, in decreasing order.
    variances: Vec<Vec<f64>>,
}

/// The remainder in the coordinates of a whitener.
#[derive(Debug, Clone)]
pub struct WhiteRemainder {
    spectra: Vec<Spectrum>,
}

/// The principal directions of a whitened remainder of one length at size one, and their variances.
#[derive(Debug, Clone)]
struct Spectrum {
    /// Orthonormal rows, `directions x outputs`.
    directions: Matrix,
    variances: Vec<f64>,
}

/// A remainder on the grid: the index of its factor, and its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// The index of its length; after the lengths comes that of known forms.
    pub length: usize,
    /// The size, in standard deviations of the noise of the mean.
    pub size: f64,
}

/// The log evidences of a system on the grid, by Laplace's method, up to the determinant of the noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidences {
    /// The log evidence without a remainder.
    pub exact: f64,
    /// Those with a remainder, in the order of [`Setting::all`].
    pub with: Vec<f64>,
}

impl Setting {
    /// The settings of a grid with so many lengths.
    pub fn all(lengths: usize) -> impl Iterator<Item = Self> {
        let sizes = |length| SIZES.into_iter().map(move |size| Self { length, size });
        (0..lengths).flat_map(sizes)
    }
}

impl Evidences {
    /// The larger of two evidences for each setting: each is that of one mode.
    pub fn or(&self, other: &Self) -> Self {
        let with = self.with.iter().zip(&other.with).map(|(a, b)| a.max(*b)).collect();
        Self { exact: self.exact.max(other.exact), with }
    }

    /// The log evidence summed over the grid: one half of the prior mass is that of no remainder, the other half is
    /// shared by the settings.
    pub fn sum(&self) -> f64 {
        let half = 0.5_f64.ln();
        log_sum([self.exact + half, self.remainder() + half].into_iter())
    }

    /// The log evidence with some remainder.
    fn remainder(&self) -> f64 {
        log_sum(self.with.iter().copied()) - (self.with.len().max(1) as f64).ln()
    }

    /// The log Bayes factor of a remainder against none.
    pub fn inexact(&self) -> f64 {
        self.remainder() - self.exact
    }

    /// The setting of largest evidence; `None` for no remainder.
    pub fn best(&self) -> Option<Setting> {
        let each = Setting::all(self.with.len() / SIZES.len()).zip(&self.with);
        let (setting, value) = each.max_by(|a, b| a.1.total_cmp(b.1))?;
        (*value > self.exact).then_some(setting)
    }
}

impl Remainder {
    /// The remainder of an experiment with this noise around a response and its changes by the unknowns.
    pub fn of(experiment: &Experiment<'_>, noise: &Noise, around: &ResponseTangents) -> Self {
        let scale = noise_of_mean(experiment, noise, &around.response);
        Self::of_scale(experiment, &scale, &around.slopes, &LENGTHS)
    }

    /// The same in these units, one a curve, in place of the noise of its mean; `slopes` are the changes of the response by
    /// the unknowns, `unknowns x outputs`, and `lengths` are those of the process, as shares of a curve.
    pub fn of_scale(
        experiment: &Experiment<'_>,
        scale: &[f64],
        slopes: &Matrix,
        lengths: &[f64],
    ) -> Self {
        let ordered = |mut columns: Vec<(f64, Vec<f64>)>| {
            columns.sort_by(|a, b| b.0.total_cmp(&a.0));
            columns.truncate(DIRECTIONS);
            let (variances, columns): (Vec<f64>, Vec<Vec<f64>>) = columns.into_iter().unzip();
            (variances, Matrix::from_rows(experiment.outputs(), columns))
        };
        let of_length = |share: &f64| {
            let groups = groups(experiment);
            let each =
                groups.iter().flat_map(|group| of_group(experiment, group, scale, slopes, *share));
            ordered(each.collect())
        };
        let forms = (experiment.forms.rows() > 0).then(|| ordered(of_forms(experiment, scale)));
        let (variances, factors) = lengths.iter().map(of_length).chain(forms).unzip();
        Self { factors, variances }
    }

    /// The remainder with the values at each output multiplied by a factor.
    #[must_use]
    pub fn grown(mut self, by: &[f64]) -> Self {
        for factor in &mut self.factors {
            for k in 0..factor.rows() {
                factor.row_mut(k).iter_mut().zip(by).for_each(|(x, by)| *x *= by);
            }
        }
        self
    }

    /// The directions of a setting that matter beside noise, as a covariance of the mean.
    pub fn common(&self, setting: Setting, outputs: f64) -> CommonError {
        let Setting { length, size } = setting;
        let matters = |v: &&f64| **v * size * size * outputs > MATTERS;
        let count = self.variances[length].iter().take_while(matters).count();
        let rows = &self.factors[length];
        let factor = Matrix::from_fn(rows.columns(), count, |i, k| size * rows[(k, i)]);
        CommonError {
            origin: ErrorOrigin::from("remainder".to_owned()),
            factor: factor.into(),
            predictive: true,
        }
    }

    /// The posterior mean of the remainder of a setting at each output, in the response's unit, for the fit of a
    /// whitener.
    pub fn estimate(&self, whitener: &Whitener, fit: &Fit, setting: Setting) -> Vec<f64> {
        let Setting { length, size } = setting;
        let factor = &self.factors[length];
        let white = whitener.whiten_rows(factor);
        let mut inner = multiply_transposed(&white, &white);
        inner.as_mut_slice().iter_mut().for_each(|x| *x *= size * size);
        (0..inner.rows()).for_each(|k| inner[(k, k)] += 1.0);
        let mut weights = multiply_vector(&white, &fit.residual);
        let Ok(cholesky) = Cholesky::new(&inner) else { return vec![0.0; factor.columns()] };
        cholesky.solve(&mut weights);
        let mut estimate = vec![0.0; factor.columns()];
        for (w, row) in weights.iter().zip(factor.iter_rows()) {
            estimate.iter_mut().zip(row).for_each(|(e, x)| *e += size * size * w * x);
        }
        estimate
    }

    /// The remainder in the coordinates of a whitener.
    pub fn white(&self, whitener: &Whitener) -> WhiteRemainder {
        let spectrum = |factor: &Matrix| {
            let white = whitener.whiten_rows(factor);
            let none = || Spectrum {
                directions: Matrix::zeros(0, white.columns()),
                variances: Vec::new(),
            };
            let Ok(eigen) = symmetric_eigen(&multiply_transposed(&white, &white)) else {
                return none();
            };
            let most = SIZES[SIZES.len() - 1].powi(2);
            let kept: Vec<usize> =
                (0..eigen.values.len()).filter(|&k| most * eigen.values[k] > NEGLIGIBLE).collect();
            if kept.is_empty() {
                return none();
            }
            let vectors = eigen.vectors.select_columns(&kept);
            let mut directions = transposed_multiply(&vectors, &white);
            let variances: Vec<f64> = kept.iter().map(|&k| eigen.values[k]).collect();
            for (k, v) in variances.iter().enumerate() {
                directions.row_mut(k).iter_mut().for_each(|x| *x /= v.sqrt());
            }
            Spectrum { directions, variances }
        };
        WhiteRemainder { spectra: self.factors.iter().map(spectrum).collect() }
    }
}

impl WhiteRemainder {
    /// The evidences of a system on the grid at the point of a fit, whose whitener is that of this remainder; `None` if
    /// the fit is singular.
    pub fn evidences(&self, fit: &Fit) -> Option<Evidences> {
        let expansion = Expansion::of(self, fit);
        let exact = expansion.log_evidence(None)?;
        let settings = Setting::all(self.spectra.len());
        let with = settings.map(|setting| expansion.log_evidence(Some(setting)));
        Some(Evidences { exact, with: with.collect::<Option<_>>()? })
    }

    /// The log evidence of a fit, summed over the grid, by Laplace's method at its point; `None` if the fit is singular.
    pub fn glance(&self, fit: &Fit) -> Option<f64> {
        self.evidences(fit).map(|all| all.sum())
    }

    /// The energy of the gap that a fit leaves: what the remainder of a setting takes out of its whitened residual, less
    /// what it would take out of noise.
    pub fn energy(&self, fit: &Fit, setting: Option<Setting>) -> f64 {
        let Some(Setting { length, size }) = setting else { return 0.0 };
        let Spectrum { directions, variances } = &self.spectra[length];
        let along = multiply_vector(directions, &fit.residual);
        let taken = |(r, v): (&f64, &f64)| {
            let left = 1.0 / (1.0 + v * size * size);
            (1.0 - left * left) * (r * r - 1.0)
        };
        along.iter().zip(variances).map(taken).sum::<f64>().max(0.0)
    }

    /// The [energy](Self::energy) on the outputs where `acts` is true.
    pub fn energy_on(&self, fit: &Fit, setting: Option<Setting>, acts: &[bool]) -> f64 {
        let Some(Setting { length, size }) = setting else { return 0.0 };
        let Spectrum { directions, variances } = &self.spectra[length];
        let along = multiply_vector(directions, &fit.residual);
        let mut mean = vec![0.0; fit.residual.len()];
        let mut noise = vec![0.0; fit.residual.len()];
        for ((row, r), v) in directions.iter_rows().zip(along).zip(variances) {
            let share = v * size * size / (1.0 + v * size * size);
            for (i, d) in row.iter().enumerate() {
                mean[i] += share * r * d;
                noise[i] += (1.0 - (1.0 - share).powi(2)) * d * d;
            }
        }
        let taken = |i: usize| fit.residual[i].powi(2) - (fit.residual[i] - mean[i]).powi(2);
        let own = (0..mean.len()).filter(|&i| acts[i]);
        own.map(|i| taken(i) - noise[i]).sum::<f64>().max(0.0)
    }

    /// The evidences of a system on the grid, from its best fit without a remainder; it is fitted again with the
    /// remainder of largest evidence.
    pub fn weigh(
        &self,
        system: &System<'_>,
        whitener: &Whitener,
        means: &[f64],
        fit: &Fit,
    ) -> Option<Evidences> {
        let mut all = self.evidences(fit)?;
        let mut tried = None;
        for _ in 0..REFITS {
            let best = all.best();
            let Some(setting) = best.filter(|_| best != tried) else { break };
            tried = best;
            let again = self.fit(system, whitener, means, &fit.at.point, setting);
            let again = expressed(system, whitener, means, &again);
            if let Some(next) = self.evidences(&again) {
                all = all.or(&next);
            }
        }
        Some(all)
    }

    /// The best fit under a remainder.
    pub fn fit(
        &self,
        system: &System<'_>,
        whitener: &Whitener,
        means: &[f64],
        start: &[f64],
        setting: Setting,
    ) -> Fit {
        let Spectrum { directions, variances } = &self.spectra[setting.length];
        let variances: Vec<f64> = variances.iter().map(|v| v * setting.size.powi(2)).collect();
        fit(system, &whitener.with(directions, &variances), means, start)
    }
}

/// The root mean square of the noise of the mean along each curve, around a response, in its unit; zero for a curve without
/// data.
pub fn noise_of_mean(experiment: &Experiment<'_>, noise: &Noise, response: &[f64]) -> Vec<f64> {
    let (counts, _) = experiment.means();
    let sd = noise.sd(experiment, response);
    let square = |&i: &usize| if counts[i] > 0.0 { sd[i] * sd[i] / counts[i] } else { 0.0 };
    let of_curve = |curve: &MeasuredCurve| {
        let n = curve.measured.len().max(1) as f64;
        (curve.measured.iter().map(square).sum::<f64>() / n).sqrt()
    };
    experiment.curves.iter().map(of_curve).collect()
}

/// A fit under a remainder in the coordinates of a whitener without it.
fn expressed(system: &System<'_>, whitener: &Whitener, means: &[f64], fit: &Fit) -> Fit {
    let misfit: Vec<f64> = means.iter().zip(&fit.at.response).map(|(y, m)| y - m).collect();
    let residual = whitener.whiten(&misfit);
    let slopes = whitener.whiten_rows(&fit.at.tangents);
    let log_prior = system.log_prior(&fit.at.point);
    let log_density = log_prior - 0.5 * dot(&residual, &residual);
    Fit { residual, slopes, log_density, log_prior, ..fit.clone() }
}
