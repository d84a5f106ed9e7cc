//! The best fit of a system to the replicates' means: largest posterior density under known noise.
//!
//! Levenberg and Marquardt's method on whitened residuals with rows for the prior (Nocedal and Wright, Numerical
//! Optimization, 2nd ed., section 10.3), inside the bounds of the priors: each step is the least value of the damped
//! quadratic inside the box that they form, in the coordinates in which the priors are about normal.

use lacuna::math::distribution::Distribution;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, gram};
use rayon::prelude::*;

use super::ascent::{Ascent, HOPE};
use super::noise_scale::NoiseScale;
use super::whitener::Whitener;
use super::window::Window;
use super::{Linearised, System};

/// Largest number of steps of a fit.
const STEPS: usize = 100;

/// Number of steps from each of several starts after which they are compared.
const FIRST: usize = 6;

/// Smallest gain in log density at which the fit continues.
pub(super) const GAIN: f64 = 1e-5;

/// The mean square of whitened residuals above which a start is also followed in a growing window.
const POOR: f64 = 4.0;

/// The shares of the record that a growing window covers.
const WINDOWS: [f64; 4] = [0.0625, 0.125, 0.25, 0.5];

/// The largest mean square in a window, as a share of that of the whole record, with which the window grows: a law that does
/// not hold over a few periods does not hold over many.
const PROMISING: f64 = 0.1;

/// The smallest number of values of a curve in the first window.
const SHORTEST: usize = 8;

/// The best fit from one start.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The unknowns, with the response and its derivatives there.
    pub at: Linearised,
    /// The whitened residual of the means, one value per output, before projection onto the complement of the slopes.
    pub residual: Vec<f64>,
    /// The whitened derivatives, `unknowns x outputs`, per unit of each unknown.
    pub slopes: Matrix,
    /// The curvature of minus the log density of each prior there, in its coordinate.
    pub prior_curvature: Vec<f64>,
    /// Lower bound of the precision that each prior adds: that of its width, so that an unknown which the data do not
    /// determine is not wider than its prior.
    pub prior_precision: Vec<f64>,
    /// `-|residual|^2 / 2` plus the log prior density: the log posterior density up to a constant that depends on the
    /// noise only.
    pub log_density: f64,
    /// The log prior density.
    pub log_prior: f64,
    /// The uncertainty of the size of the noise.
    pub noise_scale: NoiseScale,
}

impl Fit {
    /// Half the sum of squares: minus the log-likelihood.
    pub fn misfit(&self) -> f64 {
        self.log_prior - self.log_density
    }

    /// The matrix of second derivatives of minus the log density, in the Gauss-Newton approximation.
    pub(super) fn hessian(&self) -> Matrix {
        let mut hessian = gram(&self.slopes.transposed());
        for (j, p) in self.prior_curvature.iter().enumerate() {
            hessian[(j, j)] += p;
        }
        hessian
    }

    /// The precision matrix of the normal approximation to the posterior, `unknowns x unknowns`, in the inverse units
    /// of the unknowns.
    pub fn precision(&self) -> Matrix {
        self.precision_at(1.0)
    }

    /// The same with the precision that the residual leaves to the noise.
    pub fn precision_of_evidence(&self) -> Matrix {
        let square = dot(&self.residual, &self.residual);
        self.precision_at(self.noise_scale.precision(square))
    }

    /// The precision if that of the noise is this multiple of its estimate.
    fn precision_at(&self, multiple: f64) -> Matrix {
        let mut precision = gram(&self.slopes.transposed());
        precision.as_mut_slice().iter_mut().for_each(|x| *x *= multiple);
        for (j, p) in self.prior_curvature.iter().enumerate() {
            precision[(j, j)] += p;
        }
        let least = self.prior_precision.iter().zip(&self.prior_curvature);
        for (j, (least, curvature)) in least.enumerate() {
            precision[(j, j)] += (least - curvature).max(0.0);
        }
        precision
    }

    /// The standard deviation of each unknown by the normal approximation, in its unit.
    pub fn sd(&self) -> Vec<f64> {
        let (scaled, scale) = equilibrated(&self.precision());
        match Cholesky::new(&scaled) {
            Ok(factor) => {
                let inverse = factor.inverse();
                scale.iter().enumerate().map(|(j, s)| s * inverse[(j, j)].sqrt()).collect()
            }
            Err(_) => vec![f64::INFINITY; scale.len()],
        }
    }

    /// The log evidence by Laplace's method, up to the determinant of the noise, with the [uncertainty of its
    /// size](NoiseScale). The normal density is integrated over all values, also beyond a bound of the prior.
    pub fn log_evidence(&self) -> f64 {
        let square = dot(&self.residual, &self.residual);
        let (scaled, scale) = equilibrated(&self.precision_of_evidence());
        let Ok(factor) = Cholesky::new(&scaled) else { return f64::NEG_INFINITY };
        let log_scale: f64 = scale.iter().map(|s| s.ln()).sum();
        let half = 0.5 * scale.len() as f64 * std::f64::consts::TAU.ln();
        let log_density = self.log_prior + self.noise_scale.log_density(square);
        log_density + half + log_scale - 0.5 * factor.log_determinant()
    }
}

/// A matrix scaled to a unit diagonal, with the scale factors.
fn equilibrated(a: &Matrix) -> (Matrix, Vec<f64>) {
    let scale: Vec<f64> =
        (0..a.rows()).map(|j| 1.0 / a[(j, j)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = Matrix::from_fn(a.rows(), a.rows(), |i, j| scale[i] * a[(i, j)] * scale[j]);
    (scaled, scale)
}

/// The precision of a normal distribution with the standard deviation of a prior, in the inverse square of the
/// unknown's unit.
pub fn precision(prior: &Distribution) -> f64 {
    let sd = prior.sd();
    let sd = if sd.is_finite() && sd > 0.0 {
        sd
    } else {
        0.25 * (prior.quantile(0.975) - prior.quantile(0.025))
    };
    1.0 / (sd * sd)
}

/// The fit of largest posterior density to the means (one per output, in the response's unit), from a start in the
/// unknowns' units. The density is that of the searched coordinates: the logarithm for log-uniform and log-normal
/// priors.
pub fn fit(system: &System<'_>, whitener: &Whitener, means: &[f64], start: &[f64]) -> Fit {
    fit_above(f64::NEG_INFINITY, system, whitener, means, start)
}

/// Like [`fit`], but a fit that cannot come near to the log density `of_interest` is given up after some steps.
pub fn fit_above(
    of_interest: f64,
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    start: &[f64],
) -> Fit {
    let mut ascent = Ascent::from(system, whitener, means, start);
    // Far from a fit the first steps may gain little.
    ascent.climb(FIRST);
    ascent.of_interest = of_interest;
    ascent.climb(STEPS);
    ascent.best
}

/// The fit of largest log density from several starts; the first one if several are equal. A start that is far below
/// another one after some steps, and promises little, is given up.
pub fn fit_from(
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    starts: &[Vec<f64>],
) -> Option<Fit> {
    Begun::from(system, whitener, means, starts)?.finished(f64::NEG_INFINITY)
}

/// A fit from several starts after some steps, with the starts that may still be best.
pub struct Begun<'a, 'b> {
    ascents: Vec<Ascent<'a, 'b>>,
}

impl<'a, 'b> Begun<'a, 'b> {
    /// The first steps from several starts; `None` if the forward map has no response at any of them.
    pub fn from(
        system: &'b System<'a>,
        whitener: &'b Whitener,
        means: &'b [f64],
        starts: &[Vec<f64>],
    ) -> Option<Self> {
        let begun = starts.par_iter().map(|start| {
            let mut ascent = Ascent::from(system, whitener, means, start);
            ascent.climb(FIRST);
            ascent
        });
        let mut ascents: Vec<Ascent<'_, '_>> = begun.collect();
        ascents.extend(Self::grown(system, whitener, means, &ascents));
        ascents.retain(|ascent| ascent.best.log_density.is_finite());
        let ahead = ascents.iter().map(Ascent::height).fold(f64::NEG_INFINITY, f64::max);
        ascents.retain(|ascent| ascent.height() + HOPE * ascent.promised + GAIN >= ahead);
        (!ascents.is_empty()).then_some(Self { ascents })
    }

    /// The first steps from where a fit to a window that grows to the whole record ends, if no start has led near the
    /// data. Over many periods of an oscillation the misfit has a local minimum for each period by which the phase is
    /// wrong at the end; over a few periods it has one (A. Ribeiro, K. Tiels, J. Umenberger, T. Schön and L. Aguirre,
    /// Automatica 121 (2020) 109158).
    fn grown(
        system: &'b System<'a>,
        whitener: &'b Whitener,
        means: &'b [f64],
        begun: &[Ascent<'a, 'b>],
    ) -> Option<Ascent<'a, 'b>> {
        let nearest = begun.iter().max_by(|a, b| a.height().total_cmp(&b.height()))?;
        let curves = &system.experiment.curves;
        let values: usize = curves.iter().map(|curve| curve.measured.len()).sum();
        let is_poor = 2.0 * nearest.best.misfit() > POOR * values as f64;
        let longest = curves.iter().map(|curve| curve.measured.len()).max()?;
        if !is_poor || WINDOWS[0] * (longest as f64) < SHORTEST as f64 {
            return None;
        }
        let mut point = nearest.start.clone();
        for share in WINDOWS {
            let window = Window::of(system, share);
            let inside = (values - window.beyond()) as f64;
            let own = window.of_system(system);
            let mut ascent = Ascent::inside(&own, whitener, means, &point, Some(window));
            let largest = PROMISING * nearest.best.misfit() * inside / values as f64;
            if !ascent.climb_below(largest, FIRST) {
                return None;
            }
            point.clone_from(&ascent.best.at.point);
        }
        let mut ascent = Ascent::from(system, whitener, means, &point);
        ascent.climb(FIRST);
        Some(ascent)
    }

    /// The largest log density so far.
    pub fn log_density(&self) -> f64 {
        let each = self.ascents.iter().map(|ascent| ascent.best.log_density);
        each.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The best fit; one that stays below the log density `of_interest` need not be accurate.
    pub fn finished(self, of_interest: f64) -> Option<Fit> {
        let climbed = self.ascents.into_par_iter().map(|mut ascent| {
            ascent.of_interest = of_interest;
            ascent.climb(STEPS);
            ascent
        });
        let ends: Vec<Ascent<'_, '_>> = climbed.collect();
        let best = ends
            .into_iter()
            .reduce(|best, next| if next.height() > best.height() + GAIN { next } else { best });
        best.map(|ascent| ascent.best)
    }
}

/// Differences of the means from a response.
pub fn residual(means: &[f64], response: &[f64]) -> Vec<f64> {
    means.iter().zip(response).map(|(y, m)| y - m).collect()
}

/// The quantities of a fit at a given point, without any step.
pub fn at(system: &System<'_>, whitener: &Whitener, means: &[f64], point: &[f64]) -> Fit {
    let at = system.linearised(point);
    let residual = whitener.whiten(&residual(means, &at.response));
    let log_prior = system.log_prior(point);
    let finite = at.response.iter().all(|y| y.is_finite());
    let log_density =
        if finite { log_prior - 0.5 * dot(&residual, &residual) } else { f64::NEG_INFINITY };
    let coordinates = || system.coordinates().iter().zip(point);
    let prior_curvature = coordinates().map(|(own, &x)| own.curvature(x)).collect();
    let prior_precision = coordinates().map(|(own, &x)| own.unit(x).powi(-2)).collect();
    let slopes = whitener.whiten_rows(&at.tangents);
    let noise_scale = whitener.noise_scale;
    Fit {
        at,
        residual,
        slopes,
        prior_curvature,
        prior_precision,
        log_density,
        log_prior,
        noise_scale,
    }
}
