//! The coordinates in which a fit searches: the logarithm of an unknown whose prior is about normal or flat in it, else
//! the unknown itself; each in units of the width of its prior.
//!
//! In the unknown itself the density of a log-uniform prior grows as `1/x` toward the lower bound, and one step in units
//! of the prior's width ends at a bound.

use lacuna::math::distribution::Distribution;

use super::fit::precision;

/// The farthest that one step moves an unknown with two bounds or a logarithm, in widths of its prior: a linearised
/// response seldom holds over more, and a bound that is reached in one step may have no slope that leads back.
const FARTHEST: f64 = 1.0;

/// The distance from a bound, relative to the interval, at which densities are finite.
const INSIDE: f64 = 1e-9;

/// Returns true if an unknown is searched in its logarithm.
fn in_logarithm(prior: &Distribution) -> bool {
    matches!(prior, Distribution::LogUniform(_) | Distribution::LogNormal(_))
}

/// The coordinate in which an unknown is searched.
#[derive(Debug, Clone)]
pub(in crate::gap) struct Coordinate {
    prior: Distribution,
    /// The inverse of the standard deviation of the prior in the unknown itself.
    precision_root: f64,
    /// The standard deviation of the prior in the coordinate.
    width: f64,
}

impl Coordinate {
    /// The coordinate of an unknown with this prior.
    pub fn of(prior: &Distribution) -> Self {
        let precision_root = precision(prior).sqrt();
        let width = match *prior {
            Distribution::LogUniform([low, high]) => (high.ln() - low.ln()) / 12.0_f64.sqrt(),
            Distribution::LogNormal([_, sigma]) => sigma,
            _ => 1.0 / precision_root,
        };
        Self { prior: prior.clone(), precision_root, width }
    }

    /// The change of the unknown per width of its prior, at a value.
    pub fn unit(&self, x: f64) -> f64 {
        if in_logarithm(&self.prior) { self.width * x } else { self.width }
    }

    /// The slope of the log density of the prior in the coordinate, per unit of the unknown.
    pub fn slope(&self, x: f64) -> f64 {
        match self.prior {
            Distribution::LogUniform(_) => 0.0,
            Distribution::LogNormal([mu, sigma]) => (mu - x.ln()) / (sigma * sigma * x),
            _ => self.prior.log_density_derivative(x),
        }
    }

    /// The curvature of minus the log density of the prior in the coordinate, per squared unit of the unknown; zero if it
    /// is negative.
    pub fn curvature(&self, x: f64) -> f64 {
        let prior = &self.prior;
        if in_logarithm(prior) {
            let normal = matches!(prior, Distribution::LogNormal(_));
            return if normal { (self.width * x).powi(-2) } else { 0.0 };
        }
        let (low, high) = prior.support();
        let step = 1e-4 / self.precision_root;
        let (a, b) = ((x - step).max(low), (x + step).min(high));
        let (left, right) = (prior.log_density_derivative(a), prior.log_density_derivative(b));
        let curvature = (left - right) / (b - a);
        if curvature.is_finite() { curvature.max(0.0) } else { 0.0 }
    }

    /// The value of the unknown after so many widths of its prior.
    pub fn moved(&self, x: f64, widths: f64) -> f64 {
        let shift = widths * self.width;
        if in_logarithm(&self.prior) { x * shift.exp() } else { x + shift }
    }

    /// The lowest and the highest step that is allowed from a value inside its bounds, in widths of the prior.
    pub fn room(&self, x: f64, (low, high): (f64, f64)) -> (f64, f64) {
        let searched = in_logarithm(&self.prior);
        let [below, above] = [low, high].map(|bound| {
            if searched { (bound.max(0.0) / x).ln() / self.width } else { (bound - x) / self.width }
        });
        let limited = searched || (high - low).is_finite();
        let farthest = if limited { FARTHEST } else { f64::INFINITY };
        (below.max(-farthest).min(0.0), above.min(farthest).max(0.0))
    }
}

/// The log of the derivatives of the unknowns by their coordinates: a log density plus this is that of the coordinates.
pub(in crate::gap) fn log_slope(priors: &[Distribution], point: &[f64]) -> f64 {
    let searched = priors.iter().zip(point).filter(|(prior, _)| in_logarithm(prior));
    searched.map(|(_, x)| x.ln()).sum()
}

/// Bounds slightly inside those of a prior, where its density is finite.
pub(in crate::gap) fn inner(prior: &Distribution, (low, high): (f64, f64)) -> (f64, f64) {
    let width = high - low;
    if in_logarithm(prior) {
        // A share of the width would cut off decades of a log-uniform prior.
        (low.max(f64::MIN_POSITIVE) * (1.0 + INSIDE), high * (1.0 - INSIDE))
    } else if width.is_finite() {
        (low + INSIDE * width, high - INSIDE * width)
    } else {
        (low, high)
    }
}
