//! Statements of a study about a bias, and the places where they hold.

use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ConstrainedGaussianProcess;
use crate::discrepancies::common::{Functional, Series};

/// A known value or slope of the bias at a place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownPoint {
    /// Value of the axis, in its unit.
    pub at: f64,
    /// Value of the bias there, in the unit of the response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Slope of the bias there, in the unit of the response per unit of the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
}

/// Sign of a bias.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    /// The data lie above the model.
    Positive,
    /// The data lie below the model.
    Negative,
}

/// Direction in which a bias changes along the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Monotone {
    /// The bias does not decrease.
    Increasing,
    /// The bias does not increase.
    Decreasing,
}

/// Conditions on the bias of each series.
#[derive(Debug, Clone)]
pub(super) struct Knowledge {
    /// Functionals whose values are known, with these values.
    pub fixed: Vec<(Functional, f64)>,
    /// Functionals that are not negative.
    pub positive: Vec<Functional>,
}

impl Knowledge {
    /// Collects the conditions for series of this axis.
    pub fn of(options: &ConstrainedGaussianProcess, series: &Series) -> Self {
        let mut fixed = Vec::new();
        for point in &options.known {
            let value = Functional::value(point.at);
            fixed.extend(point.value.map(|v| (value, v)));
            fixed.extend(point.slope.map(|v| (Functional { slope: true, ..value }, v)));
        }
        let places = places(options, series);
        let mut positive = Vec::new();
        if let Some(sign) = options.sign {
            let sign = if sign == Sign::Positive { 1.0 } else { -1.0 };
            positive.extend(places.iter().map(|&at| Functional { at, slope: false, sign }));
        }
        if let Some(monotone) = options.monotone {
            let sign = if monotone == Monotone::Increasing { 1.0 } else { -1.0 };
            positive.extend(places.iter().map(|&at| Functional { at, slope: true, sign }));
        }
        Self { fixed, positive }
    }
}

/// Returns the places at which sign and direction hold.
fn places(options: &ConstrainedGaussianProcess, series: &Series) -> Vec<f64> {
    let ends = series.grid.first().zip(series.grid.last()).map_or([0.0, 0.0], |(a, b)| [*a, *b]);
    let [first, last] = options.between.unwrap_or(ends);
    let step = (last - first) / (options.places.max(2) - 1) as f64;
    (0..options.places).map(|i| first + step * i as f64).collect()
}

/// Largest number of conditions on sign and direction, of all series together.
const MOST: usize = 100;

/// Reports knowledge that is contradictory, empty or too much.
pub(super) fn check(
    options: &ConstrainedGaussianProcess,
    series: &Series,
    complaints: &mut Complaints<'_>,
) {
    let number = |x: &Option<f64>| x.is_none_or(f64::is_finite);
    for (i, point) in options.known.iter().enumerate() {
        let at = format!("known.{i}");
        if !(point.at.is_finite() && number(&point.value) && number(&point.slope)) {
            complaints.at(&at).say("place, value and slope must be finite numbers");
        }
        if point.value.is_none() && point.slope.is_none() {
            complaints
                .at(&at)
                .say("nothing is known at this place")
                .expected("`value`, `slope`, or both")
                .found(format!("`at = {}` alone", point.at));
        }
        if options.known[..i].iter().any(|other| other.at == point.at) {
            complaints.at(&at).say("this place is listed twice").found(point.at);
        }
    }
    let wanted = usize::from(options.sign.is_some()) + usize::from(options.monotone.is_some());
    if options.known.is_empty() && wanted == 0 {
        complaints
            .at("known")
            .say("nothing is known about the bias")
            .expected("`known`, `sign` or `monotone`, or the discrepancy `gaussian_process`");
    }
    if options.places < 2 {
        complaints
            .at("places")
            .say("conditions along an axis need two places")
            .expected("at least 2")
            .found(options.places);
    }
    if let Some([first, last]) = options.between
        && !(first < last && first.is_finite() && last.is_finite())
    {
        complaints
            .at("between")
            .say("the first place must be below the last")
            .found(format!("[{first}, {last}]"));
    }
    let all = wanted * options.places * series.outputs.len();
    if all > MOST {
        complaints
            .at("places")
            .say(format!("sign and direction of {} series", series.outputs.len()))
            .expected(format!("at most {MOST} conditions in total"))
            .found(all);
    }
}
