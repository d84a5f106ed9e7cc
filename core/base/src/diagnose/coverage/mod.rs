//! Coverage of credible intervals, counted over calibrations of data whose truth is known.
//!
//! If truths are drawn from the prior and data from the model, an interval of probability p contains the truth in a
//! fraction p of all cases, and the rank of the truth among independent draws is uniform: simulation-based calibration
//! (Talts, Betancourt, Simpson, Vehtari and Gelman, arXiv 1804.06788).

pub mod binomial;
mod case;
mod found;
pub mod ranks;
mod tally;
mod verdict;

use serde::{Deserialize, Serialize};

use crate::data::Unit;
use crate::math::distribution::Distribution;

pub use case::{Calibration, Case, Ended, Judged, judge};
pub use found::{Coverage, Noise, Source};
pub use tally::{Rate, Row, Side, Tally, rank_points, tally};
pub use verdict::{Verdict, Word};

/// Probabilities of the central intervals that are counted.
pub const LEVELS: [f64; 3] = [0.5, 0.9, 0.95];

/// Number of draws among which a truth is ranked, so that there are a hundred possible ranks.
pub const RANKS: usize = 99;

/// Prior probability below or above which a truth counts as near an edge: for a uniform prior, within a tenth of its
/// width of either end.
pub const EDGE: f64 = 0.1;

/// An unknown whose truth is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    /// Name of the unknown.
    pub name: String,
    /// Unit of the unknown.
    pub unit: Unit,
    /// Prior of the unknown.
    pub prior: Distribution,
    /// True if the truths were drawn from the prior, so that the intervals must have their nominal coverage.
    pub of_prior: bool,
}

impl Coordinate {
    /// Standard deviation of the prior, or a quarter of its central 95 % range if the standard deviation does not
    /// exist.
    fn scale(&self) -> f64 {
        let sd = self.prior.variance().sqrt();
        let range = || 0.25 * (self.prior.quantile(0.975) - self.prior.quantile(0.025));
        if sd.is_finite() { sd } else { range() }
    }
}
