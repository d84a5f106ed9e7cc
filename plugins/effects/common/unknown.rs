//! The unknowns of an effect, as its options give their priors.

use lacuna::data::{Coordinates, Layout, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Hyperparameter;
use lacuna::study::problem::Complaints;

/// An unknown of an effect with the prior that a study gives it.
pub struct Unknown<'a> {
    /// Its name, which is the key of its prior.
    pub name: &'a str,
    /// Its symbol.
    pub symbol: &'a str,
    /// What it is measured in.
    pub measure: Measure,
    /// Its prior; `None` where a study that needs one gives none.
    pub prior: Option<&'a Distribution>,
    /// Between what it lies for reasons of physics.
    pub limits: (f64, f64),
    /// A prior as an example of what a study writes.
    pub example: &'a str,
}

/// What an unknown is measured in.
#[derive(Debug, Clone, PartialEq)]
pub enum Measure {
    /// It has no dimension.
    Number,
    /// In the unit of the response.
    Response,
    /// In the unit of the last axis.
    Axis,
    /// In the inverse unit of the last axis.
    PerAxis,
    /// In the unit of the response by that of the last axis.
    Rate,
    /// In the inverse unit of the response.
    PerResponse,
    /// In this unit.
    In(Unit),
}

impl Measure {
    /// The unit for responses of this layout.
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
        }
    }
}

/// The unit of differences: the kelvin for degrees Celsius.
fn difference(unit: &Unit) -> Unit {
    let kelvin = || Unit::parse("K").unwrap_or_default();
    if unit.power(1.0).is_some() { unit.clone() } else { kelvin() }
}

/// The unknowns as a study samples them.
pub fn parameters(unknowns: &[Unknown<'_>], layout: &Layout) -> Vec<Hyperparameter> {
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

/// Complains of priors that are missing, and of those that allow what physics does not.
pub fn check(unknowns: &[Unknown<'_>], layout: &Layout, complaints: &mut Complaints<'_>) {
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
