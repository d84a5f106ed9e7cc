//! Bounds of quantities over the intervals of parameters of which nothing else is known: a probability box whose
//! distributions are those at the points of the intervals' box (Ferson and Ginzburg, Reliability Engineering and System
//! Safety 54 (1996) 133; Faes et al., Structural Safety 93 (2021) 102092).
//!
//! At each point the distribution of a quantity is that of the same draws of all other inputs and errors. The search over
//! the box ([`crate::extremes`]) may use fewer draws than the bounds, which are computed anew at the points that it found.

mod figures;
mod search;
mod warnings;

use serde::{Deserialize, Serialize};

use crate::assess::intervals::AGREES;

pub use self::figures::PROBABILITIES;
pub(super) use self::search::{bounds, evaluations, identity};
pub(super) use self::warnings::warn;

/// Bounds of all quantities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoundsFindings {
    /// The parameters of which intervals are known.
    pub intervals: Vec<Interval>,
    /// Number of draws of the bounds.
    pub draws: usize,
    /// Number of draws in the search.
    pub searched_draws: usize,
    /// Number of points of the box at which the distributions were computed.
    pub points: usize,
    /// True if the search ended because it had no points left.
    pub exhausted: bool,
    /// Bounds of each quantity; `None` if it is defined nowhere.
    pub quantities: Vec<Option<Bounds>>,
}

/// A parameter of which an interval is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Name.
    pub name: String,
    /// Unit of the bounds.
    pub unit: String,
    /// Lower and upper bound.
    pub ends: [f64; 2],
}

/// Bounds of one quantity, in its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Mean.
    pub mean: Range,
    /// Standard deviation.
    pub sd: Range,
    /// 2.5 % quantile.
    pub q025: Range,
    /// Median.
    pub median: Range,
    /// 97.5 % quantile.
    pub q975: Range,
    /// Lower and upper bound of the quantile at each of [`PROBABILITIES`].
    pub quantiles: Vec<[f64; 2]>,
    /// Largest number of draws at which the quantity is undefined, over the points with all draws.
    pub undefined: usize,
}

impl Bounds {
    /// The figures with their names.
    pub fn named(&self) -> [(&'static str, &Range); 5] {
        let Self { mean, sd, q025, median, q975, .. } = self;
        [("mean", mean), ("sd", sd), ("2.5 %", q025), ("median", median), ("97.5 %", q975)]
    }

    /// Bounds of the probability that the quantity is at most `value`, as far as the quantiles tell: the probability box
    /// widened to the next of [`PROBABILITIES`].
    pub fn probability(&self, value: f64) -> [f64; 2] {
        let count = |end: usize| self.quantiles.iter().filter(|q| q[end] <= value).count();
        let (above, below) = (count(1), count(0));
        let lower = above.checked_sub(1).map_or(0.0, |k| PROBABILITIES[k]);
        [lower, PROBABILITIES.get(below).copied().unwrap_or(1.0)]
    }
}

/// Smallest and largest value of a figure over the box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Smallest value.
    pub lower: End,
    /// Largest value.
    pub upper: End,
}

/// An end of a range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct End {
    /// Value of the figure.
    pub value: f64,
    /// Monte Carlo standard error of the value.
    pub error: f64,
    /// Values of the interval parameters at which it is reached.
    pub at: Vec<f64>,
    /// Distance of the results of two independent searches, with the draws of the search.
    pub difference: f64,
}

impl Range {
    /// Returns true if two independent searches found the same ends: to 2 % of the width, or within the standard error.
    pub fn is_agreed(&self) -> bool {
        let width = self.upper.value - self.lower.value;
        let agreed = |end: &End| end.difference <= (AGREES * width).max(end.error);
        agreed(&self.lower) && agreed(&self.upper)
    }
}
