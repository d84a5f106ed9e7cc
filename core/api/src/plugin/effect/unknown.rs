//! Unknowns of an effect, with the priors that its options give.

use lacuna_base::data::{Coordinates, Layout, Unit};
use lacuna_base::math::distribution::Distribution;
use lacuna_base::text::problem::Complaints;

use crate::plugin::Hyperparameter;

/// An unknown of an effect with the prior that a study gives it.
#[derive(Debug, Clone)]
pub struct Unknown<'a> {
    /// Name of the unknown, which is also the key of its prior.
    pub name: &'a str,
    /// Symbol used in figures.
    pub symbol: &'a str,
    /// Quantity measured, which determines the unit.
    pub measure: Measure,
    /// Prior of the unknown; `None` if the study does not give it, which the check reports.
    pub prior: Option<&'a Distribution>,
    /// Smallest and largest physically possible value.
    pub limits: (f64, f64),
    /// Example of a prior, as a study would write it.
    pub example: &'a str,
}

impl<'a> Unknown<'a> {
    /// Creates an unknown without physical limits. The prior is an option of the effect, `Distribution` or
    /// `Option<Distribution>`; the example is what a study could write, such as `{ half_normal = 500 }`.
    pub fn new(
        name: &'a str,
        symbol: &'a str,
        measure: Measure,
        prior: impl Into<Option<&'a Distribution>>,
        example: &'a str,
    ) -> Self {
        let limits = (f64::NEG_INFINITY, f64::INFINITY);
        Self { name, symbol, measure, prior: prior.into(), limits, example }
    }

    /// Restricts the unknown to physically possible values from `low` to `high`.
    #[must_use]
    pub fn within(self, low: f64, high: f64) -> Self {
        Self { limits: (low, high), ..self }
    }

    /// Restricts the unknown to values of zero or more.
    #[must_use]
    pub fn not_negative(self) -> Self {
        self.within(0.0, f64::INFINITY)
    }
}

/// Quantity that an unknown measures, which determines its unit.
#[derive(Debug, Clone, PartialEq)]
pub enum Measure {
    /// Dimensionless.
    Number,
    /// In the unit of the response.
    Response,
    /// In the unit of the last axis.
    Axis,
    /// In the inverse unit of the last axis.
    PerAxis,
    /// In the unit of the response per unit of the last axis.
    Rate,
    /// In the inverse unit of the response.
    PerResponse,
    /// In this unit.
    In(Unit),
    /// In the unit of the axis of this name if it is a grid, else in the given unit.
    Along(String, Unit),
}

impl Measure {
    /// Returns the unit for responses of this layout.
    pub fn unit(&self, layout: &Layout) -> Unit {
        let axis = match layout.axes.last().map(|axis| &axis.coordinates) {
            Some(Coordinates::Grid { unit, .. }) => unit.clone(),
            _ => Unit::dimensionless(),
        };
        let inverse = |unit: &Unit| unit.power(-1.0).unwrap_or_default();
        let response = difference(&layout.unit);
        match self {
            Self::Number => Unit::dimensionless(),
            Self::Response => response,
            Self::Axis => axis,
            Self::PerAxis => inverse(&axis),
            Self::Rate => response.times(&inverse(&axis)).unwrap_or_default(),
            Self::PerResponse => inverse(&response),
            Self::In(unit) => unit.clone(),
            Self::Along(name, unit) => match layout.axis(name).map(|(_, axis)| &axis.coordinates) {
                Some(Coordinates::Grid { unit, .. }) => unit.clone(),
                _ => unit.clone(),
            },
        }
    }
}

/// Unit of differences of a quantity: the kelvin for degrees Celsius, whose zero is not absolute.
fn difference(unit: &Unit) -> Unit {
    let kelvin = || Unit::parse("K").unwrap_or_default();
    if unit.power(1.0).is_some() { unit.clone() } else { kelvin() }
}

/// Unknowns as hyperparameters that a study samples, in the same order; a fit starts from the prior's median.
pub(super) fn hyperparameters(unknowns: &[Unknown<'_>], layout: &Layout) -> Vec<Hyperparameter> {
    let parameter = |unknown: &Unknown<'_>| {
        // The check refuses a study without the prior; what is only asked for proposals needs none.
        let prior = unknown.prior.cloned().unwrap_or(Distribution::HalfNormal(1.0));
        Hyperparameter {
            name: unknown.name.to_owned(),
            symbol: unknown.symbol.to_owned(),
            unit: unknown.measure.unit(layout),
            log: matches!(prior, Distribution::LogNormal(_) | Distribution::LogUniform(_)),
            start: prior.quantile(0.5),
            prior,
        }
    };
    unknowns.iter().map(parameter).collect()
}

/// Reports priors that are missing or that allow physically impossible values.
pub(super) fn check_priors(
    unknowns: &[Unknown<'_>],
    layout: &Layout,
    complaints: &mut Complaints<'_>,
) {
    for unknown in unknowns {
        let Unknown { name, limits: (low, high), .. } = *unknown;
        let Some(prior) = unknown.prior else {
            let unit = unknown.measure.unit(layout);
            let unit = match unit.as_str() {
                "" | "1" => String::new(),
                unit => format!(" in `{unit}`"),
            };
            complaints
                .at(name)
                .say(format!("missing key `{name}`"))
                .expected(format!("a prior{unit}, such as `{name} = {}`", unknown.example));
            continue;
        };
        let (from, to) = prior.support();
        let expected = match (low, high) {
            (low, f64::INFINITY) => format!("no values below {low}"),
            (low, high) => format!("values from {low} to {high}"),
        };
        let expected = format!("{expected}, as in `{name} = {}`", unknown.example);
        if from < low || to > high {
            complaints
                .at(name)
                .say(format!("the prior of `{name}` allows what cannot be"))
                .expected(expected)
                .found(prior);
        }
    }
}
