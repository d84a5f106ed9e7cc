//! Variances of the gain, timing and offset of replicates, by moments.
//!
//! The coefficient of curve `k` in replicate `r` is `a_rk = c_r + o_rk + e_rk`, where `e_rk` is what white noise makes of it,
//! with the variance `W_k`. With weights `w_k = 1 / (W_k + v)` about the weighted mean of a replicate, `v` the variance of `o`,
//!
//! ```text
//! E[sum_rk w_k (a_rk - a_r)^2] = sum_rk f_k w_k (1 - w_k / w) (W_k + v),   w = sum_k w_k,   f_k = 1 - 1 / R_k,
//! ```
//!
//! because deviations are from the mean of `R_k` replicates. It is solved for `v` with the weights of the solution before
//! (`DerSimonian` and Laird, Controlled Clinical Trials 7 (1986) 177; Paule and Mandel, J. Res. NBS 87 (1982) 377). The
//! variance of `c` is what the means of the replicates have beyond that. A variance known from few replicates is first enlarged
//! by the square of Student's 97.5 % quantile over the normal one, so that a 95 % interval that it dominates has its level.

use lacuna::math::special::{normal_quantile, student_t_quantile};
use lacuna_linalg::{Cholesky, Matrix};

use super::basis::{Curve, KINDS, POINTS};

/// Coefficients of all curves in all replicates.
pub(super) struct Fits {
    /// Coefficient by kind, then by replicate and curve; `None` where it was not measured.
    coefficients: Vec<Vec<Option<f64>>>,
    /// Variance of a coefficient by white noise, by kind and curve.
    white: Vec<Vec<f64>>,
    /// Number of replicates of each curve.
    replicates: Vec<usize>,
}

/// Variances of a kind of deviation, in its squared unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Components {
    /// Variance of the part that all curves of a replicate share.
    pub common: f64,
    /// Variance of the part of each curve.
    pub own: f64,
    /// True for each curve whose own part is not negligible against its noise.
    pub relevant: Vec<bool>,
}

/// Number of solutions for the variance of the own part.
const ROUNDS: usize = 8;

/// Ratio of a variance to that by white noise below which it is negligible.
const NEGLIGIBLE: f64 = 0.01;

/// Sums over the points of a curve in the replicates.
#[derive(Default)]
struct Noise {
    squares: f64,
    freedom: f64,
}

impl Fits {
    /// Fits the functions of each curve to the deviations of each replicate, subtracts them, and gives what is left to
    /// `rest`, replicate by replicate.
    pub fn of(
        curves: &[Curve],
        deviations: impl Iterator<Item = Vec<Option<f64>>>,
        mut rest: impl FnMut(Vec<Option<f64>>),
    ) -> Self {
        let mut fits = Self {
            coefficients: vec![Vec::new(); KINDS],
            white: vec![vec![0.0; curves.len()]; KINDS],
            replicates: vec![0; curves.len()],
        };
        let kinds: Vec<Vec<usize>> = curves.iter().map(|curve| curve.kinds().collect()).collect();
        let mut noise: Vec<Noise> = curves.iter().map(|_| Noise::default()).collect();
        for mut deviations in deviations {
            for all in &mut fits.coefficients {
                all.resize(all.len() + curves.len(), None);
            }
            for (k, curve) in curves.iter().enumerate() {
                let found = fitted(curve, &kinds[k], &mut deviations, &mut noise[k]);
                let Some(found) = found else { continue };
                fits.replicates[k] += 1;
                for (&kind, value) in kinds[k].iter().zip(found) {
                    let first = fits.coefficients[kind].len() - curves.len();
                    fits.coefficients[kind][first + k] = Some(value);
                }
            }
            rest(deviations);
        }
        for (k, (curve, noise)) in curves.iter().zip(&noise).enumerate() {
            fits.add_white(k, curve, noise);
        }
        fits
    }

    /// Sets the variances of the coefficients of a curve by white noise.
    fn add_white(&mut self, k: usize, curve: &Curve, noise: &Noise) {
        let kinds: Vec<usize> = curve.kinds().collect();
        let share = 1.0 - 1.0 / self.replicates[k].max(1) as f64;
        let variance = noise.squares / (noise.freedom * share).max(f64::MIN_POSITIVE);
        let all: Vec<usize> = (0..curve.outputs.len()).collect();
        let Ok(cholesky) = Cholesky::new(&gram(curve, &kinds, &all)) else { return };
        for (place, &kind) in kinds.iter().enumerate() {
            let mut inverse = vec![0.0; kinds.len()];
            inverse[place] = 1.0;
            cholesky.solve(&mut inverse);
            self.white[kind][k] = variance * inverse[place] / size(curve, kind, &all).powi(2);
        }
    }

    /// Coefficients of this kind, for each replicate by curve; none without curves.
    fn rows(&self, kind: usize) -> impl Iterator<Item = &[Option<f64>]> {
        self.coefficients[kind].chunks(self.replicates.len().max(1))
    }

    /// Curves with a deviation of this kind, for each replicate.
    pub fn measured(&self, kind: usize) -> impl Iterator<Item = Vec<usize>> + '_ {
        self.rows(kind).map(|row| present(row).map(|(k, _)| k).collect())
    }

    /// Variances of a kind of deviation; `None` if no curve has it in two replicates.
    pub fn components(&self, kind: usize) -> Option<Components> {
        let white = &self.white[kind];
        let own = self.own(kind);
        let weight: Vec<f64> = white.iter().map(|w| 1.0 / (w + own)).collect();
        if weight.iter().any(|w| !w.is_finite()) {
            return self.without_noise(kind);
        }
        let (mut squares, mut expected, mut share) = (0.0, 0.0, 0.0);
        let mut freedom = [0.0; 2];
        for row in self.rows(kind) {
            let total: f64 = present(row).map(|(k, _)| weight[k]).sum();
            let curves = present(row).count() as f64;
            if curves == 0.0 {
                continue;
            }
            let mean = present(row).map(|(k, a)| weight[k] * a).sum::<f64>() / total;
            let part = present(row).map(|(k, _)| self.share(k)).sum::<f64>() / curves;
            squares += mean * mean;
            expected += part / total;
            share += part;
            freedom[0] += part;
            freedom[1] += part * (curves - 1.0);
        }
        if share <= 0.0 {
            return None;
        }
        let common = ((enlarged(freedom[0]) * squares - expected) / share).max(0.0);
        let own = own * enlarged(freedom[1]);
        let relevant = white.iter().map(|w| own > NEGLIGIBLE * w).collect();
        Some(Components { common, own, relevant })
    }

    /// Share of the variance of a coefficient that its deviation from the mean of the replicates keeps.
    fn share(&self, curve: usize) -> f64 {
        1.0 - 1.0 / self.replicates[curve].max(1) as f64
    }

    /// Variance of the own part.
    fn own(&self, kind: usize) -> f64 {
        let white = &self.white[kind];
        let squares = self.rows(kind).flat_map(present);
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), (_, a)| (sum + a * a, n + 1.0));
        let mut own = if count > 0.0 { sum / count } else { 0.0 };
        for _ in 0..ROUNDS {
            let weight = |k: usize| 1.0 / (white[k] + own);
            let (mut squares, mut known, mut slope) = (0.0, 0.0, 0.0);
            for row in self.rows(kind) {
                let total: f64 = present(row).map(|(k, _)| weight(k)).sum();
                let mean = present(row).map(|(k, a)| weight(k) * a).sum::<f64>() / total;
                for (k, a) in present(row) {
                    let part = self.share(k) * weight(k) * (1.0 - weight(k) / total);
                    squares += weight(k) * (a - mean).powi(2);
                    known += part * white[k];
                    slope += part;
                }
            }
            let solved = (squares - known) / slope;
            if !solved.is_finite() {
                return 0.0;
            }
            own = solved.max(0.0);
            if own == 0.0 {
                break;
            }
        }
        own
    }

    /// Variances of coefficients without noise: that of all of them, as if the curves shared nothing and everything.
    fn without_noise(&self, kind: usize) -> Option<Components> {
        let all = self.rows(kind).flat_map(present);
        let (sum, share) = all.fold((0.0, 0.0), |(s, f), (k, a)| (s + a * a, f + self.share(k)));
        let variance = sum / share * enlarged(share);
        let components = |variance| Components {
            common: variance,
            own: 0.0,
            relevant: vec![false; self.replicates.len()],
        };
        (share > 0.0).then(|| components(variance))
    }
}

/// Curves that a replicate has, with their coefficients.
fn present(row: &[Option<f64>]) -> impl Iterator<Item = (usize, f64)> + '_ {
    row.iter().enumerate().filter_map(|(k, value)| value.map(|a| (k, a)))
}

/// Ratio of the squares of Student's and the normal 97.5 % quantile.
fn enlarged(freedom: f64) -> f64 {
    const LEVEL: f64 = 0.975;
    let student = student_t_quantile(freedom, LEVEL).unwrap_or(0.0);
    (student / normal_quantile(LEVEL)).powi(2).max(1.0)
}

/// Coefficients of one curve in one replicate, which are subtracted from its deviations; `None` with too few points.
fn fitted(
    curve: &Curve,
    kinds: &[usize],
    deviations: &mut [Option<f64>],
    noise: &mut Noise,
) -> Option<Vec<f64>> {
    let places: Vec<usize> =
        (0..curve.outputs.len()).filter(|&p| deviations[curve.outputs[p]].is_some()).collect();
    if places.len() < POINTS {
        return None;
    }
    let cholesky = Cholesky::new(&gram(curve, kinds, &places)).ok()?;
    let deviation = |p: usize| deviations[curve.outputs[p]].unwrap_or(0.0);
    let product = |&kind: &usize| places.iter().map(|&p| curve.at(kind, p) * deviation(p)).sum();
    let scale: Vec<f64> = kinds.iter().map(|&kind| size(curve, kind, &places)).collect();
    let mut found: Vec<f64> = kinds.iter().map(product).collect();
    found.iter_mut().zip(&scale).for_each(|(b, s)| *b /= s);
    cholesky.solve(&mut found);
    found.iter_mut().zip(&scale).for_each(|(a, s)| *a /= s);
    for &p in &places {
        let explained: f64 = kinds.iter().zip(&found).map(|(&j, a)| a * curve.at(j, p)).sum();
        if let Some(value) = &mut deviations[curve.outputs[p]] {
            *value -= explained;
            noise.squares += *value * *value;
        }
    }
    noise.freedom += (places.len() - kinds.len()) as f64;
    Some(found)
}

/// Norm of a function over some places of a curve.
fn size(curve: &Curve, kind: usize, places: &[usize]) -> f64 {
    places.iter().map(|&p| curve.at(kind, p).powi(2)).sum::<f64>().sqrt()
}

/// Inner products of the functions of a curve, each divided by its norm.
fn gram(curve: &Curve, kinds: &[usize], places: &[usize]) -> Matrix {
    let scale: Vec<f64> = kinds.iter().map(|&kind| size(curve, kind, places)).collect();
    let product = |i: usize, j: usize| -> f64 {
        places.iter().map(|&p| curve.at(kinds[i], p) * curve.at(kinds[j], p)).sum()
    };
    Matrix::from_fn(kinds.len(), kinds.len(), |i, j| product(i, j) / (scale[i] * scale[j]))
}
