//! The keys of bounds over the intervals of parameters.

use schemars::JsonSchema;
use serde::Serialize;

use super::value::{ByName, Quantity};
use crate::report::findings::{Bounds, BoundsFindings, End, PROBABILITIES, Range};

/// Bounds of a quantity over the intervals of parameters of which no distribution is known: at each point of the intervals the
/// quantity has a distribution, and these are the smallest and the largest value of each of its figures.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct QuantityBounds {
    /// Bounds of the mean.
    pub mean: FigureBounds,
    /// Bounds of the standard deviation.
    pub sd: FigureBounds,
    /// Bounds of the 2.5 % quantile.
    pub q025: FigureBounds,
    /// Bounds of the median.
    pub median: FigureBounds,
    /// Bounds of the 97.5 % quantile.
    pub q975: FigureBounds,
    /// Bounds of the whole distribution: the probability box.
    pub distribution: ProbabilityBox,
    /// Number of draws at each point of the intervals.
    pub draws: usize,
    /// Number of these draws that the search over the intervals used.
    pub searched_draws: usize,
    /// Number of points of the intervals that the search evaluated.
    pub points: usize,
    /// True if the search ended because it had no points left; `difference` tells whether that matters.
    pub exhausted: bool,
    /// Largest number of draws at which the quantity is undefined, over the points with all draws; all numbers are those of
    /// the others.
    pub undefined: usize,
}

/// Smallest and largest value of one figure over the intervals.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FigureBounds {
    /// Smallest value.
    pub lower: Quantity,
    /// Monte Carlo standard error of `lower`.
    pub lower_error: f64,
    /// Values of the interval parameters at which `lower` is reached.
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub lower_at: ByName<Quantity>,
    /// Largest value.
    pub upper: Quantity,
    /// Monte Carlo standard error of `upper`.
    pub upper_error: f64,
    /// Values of the interval parameters at which `upper` is reached.
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub upper_at: ByName<Quantity>,
    /// Distance of the results of two independent searches over the intervals, the larger one of both bounds. If it is not
    /// small beside `upper - lower`, the true bounds may lie farther apart.
    pub difference: f64,
}

/// Bounds of the quantiles of a quantity. The cumulative distribution is at most `probabilities[k]` below `lower[k]` and at
/// least that above `upper[k]`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ProbabilityBox {
    /// Probabilities, in ascending order.
    pub probabilities: Vec<Quantity>,
    /// Smallest quantile at each of them.
    pub lower: Vec<Quantity>,
    /// Largest quantile at each of them.
    pub upper: Vec<Quantity>,
}

impl QuantityBounds {
    /// Keys of the bounds of one quantity.
    pub fn of(found: &Bounds, all: &BoundsFindings) -> Self {
        let range = |range: &Range| FigureBounds::of(range, all);
        let quantiles = |end: usize| found.quantiles.iter().map(|q| q[end].into()).collect();
        Self {
            mean: range(&found.mean),
            sd: range(&found.sd),
            q025: range(&found.q025),
            median: range(&found.median),
            q975: range(&found.q975),
            distribution: ProbabilityBox {
                probabilities: PROBABILITIES.into_iter().map(Quantity).collect(),
                lower: quantiles(0),
                upper: quantiles(1),
            },
            draws: all.draws,
            searched_draws: all.searched_draws,
            points: all.points,
            exhausted: all.exhausted,
            undefined: found.undefined,
        }
    }
}

impl FigureBounds {
    fn of(range: &Range, all: &BoundsFindings) -> Self {
        let at = |end: &End| {
            let each = all.intervals.iter().zip(&end.at);
            each.map(|(own, &value)| (own.name.clone(), value.into())).collect()
        };
        Self {
            lower: range.lower.value.into(),
            lower_error: range.lower.error,
            lower_at: at(&range.lower),
            upper: range.upper.value.into(),
            upper_error: range.upper.error,
            upper_at: at(&range.upper),
            difference: range.lower.difference.max(range.upper.difference),
        }
    }
}
