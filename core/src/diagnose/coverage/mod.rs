//! Whether intervals hold the truth as often as they say, counted over calibrations of data whose truth is known.
//!
//! Where truths are drawn from the prior and data from the model, an interval of probability p holds the truth
//! in a share p of all cases, and the rank of the truth among independent draws is uniform: simulation-based
//! calibration (Talts, Betancourt, Simpson, Vehtari and Gelman, arXiv 1804.06788).

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

/// The probabilities of the intervals that are counted: central ones, between quantiles.
pub const LEVELS: [f64; 3] = [0.5, 0.9, 0.95];

/// The number of draws among which a truth has its rank, so that there are a hundred ranks.
pub const RANKS: usize = 99;

/// What is nearer to an edge: the prior probability below or above which a truth counts as one at an edge. For a uniform
/// prior that is a tenth of its width at each end.
pub const EDGE: f64 = 0.1;

/// An unknown whose truth is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// Its prior.
    pub prior: Distribution,
    /// Whether its truths were drawn from its prior, so that its intervals have to hold them as often as they say.
    pub of_prior: bool,
}

impl Coordinate {
    /// The prior's standard deviation, or a quarter of the range of its middle 95 % where it has none.
    fn scale(&self) -> f64 {
        let sd = self.prior.variance().sqrt();
        let range = || 0.25 * (self.prior.quantile(0.975) - self.prior.quantile(0.025));
        if sd.is_finite() { sd } else { range() }
    }
}
