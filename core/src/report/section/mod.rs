//! The sections of the report, one a file; each is left out when the run has nothing for it.

pub mod banner;
mod curves;
mod ensemble;
pub mod evidence;
mod gap;
pub mod headline;
mod measurements;
mod overview;
mod posterior;
mod sampling;
mod surrogate;
mod timing;
mod validation;

pub use curves::{CurvePanel, Curves};
pub use posterior::posterior_table;
pub use validation::accuracy_table;

use super::findings::{CoordinateFindings, Findings};
use super::page::{Numbers, Section};
use super::scale::ShownUnit;
use crate::data::{Coordinates, Layouts, Unit};
use crate::plugin::Fact;

/// All sections that have something to show, in order.
pub fn all(findings: &Findings, numbers: &mut Numbers) -> Vec<Section> {
    let sections = [
        Some(overview::section(findings, numbers)),
        ensemble::section(findings, numbers),
        measurements::section(findings, numbers),
        surrogate::section(findings, numbers),
        sampling::section(findings, numbers),
        posterior::section(findings, numbers),
        evidence::section(findings),
        validation::section(findings, numbers),
        gap::section(findings, numbers),
        timing::section(findings, numbers),
    ];
    sections.into_iter().flatten().collect()
}

/// The unit in which a coordinate is shown in every figure and table of the posterior.
pub fn coordinate_unit(coordinate: &CoordinateFindings) -> ShownUnit {
    ShownUnit::for_values(&coordinate.unit, [coordinate.mean, coordinate.q025, coordinate.q975])
}

/// The unit in which the response is shown everywhere.
pub fn response_unit(findings: &Findings) -> ShownUnit {
    let measured = findings.measured.iter().flat_map(|m| m.used.summaries());
    let simulated = findings.validation.iter().flat_map(|v| v.cases.iter());
    let pairs = findings.surrogate.iter().flat_map(|s| s.pairs.iter().map(|p| p.0));
    let values: Vec<f64> = measured
        .map(|summary| summary.mean)
        .chain(simulated.flat_map(|case| case.response.iter().copied()))
        .collect();
    if values.is_empty() {
        ShownUnit::for_values(findings.layouts.unit(), pairs)
    } else {
        ShownUnit::for_values(findings.layouts.unit(), values)
    }
}

/// The unit in which places along the last axis are shown.
pub fn axis_unit(findings: &Findings) -> ShownUnit {
    let Some((_, grid, unit)) = findings.layouts.blocks[0].abscissa() else {
        return ShownUnit::of(&Unit::dimensionless(), 1.0);
    };
    ShownUnit::for_values(unit, grid.iter().copied())
}

/// The unit in which frequencies along the last axis are shown.
pub fn frequency_unit(findings: &Findings) -> ShownUnit {
    let abscissa = findings.layouts.blocks[0].abscissa();
    let inverse = abscissa.and_then(|(_, _, unit)| unit.power(-1.0));
    let hertz = Unit::parse("Hz").ok().zip(Unit::parse("1/s").ok());
    let inverse = match (inverse, hertz) {
        (Some(inverse), Some((hertz, per_second))) if inverse == per_second => hertz,
        (inverse, _) => inverse.unwrap_or_default(),
    };
    let step = abscissa.map_or(1.0, |(_, grid, _)| match grid {
        [first, .., last] if grid.len() > 1 => (grid.len() - 1) as f64 / (last - first),
        _ => 1.0,
    });
    ShownUnit::for_values(&inverse, [0.1 * step])
}

/// The label of an axis that carries the response.
pub fn response_label(findings: &Findings) -> String {
    response_unit(findings).label(findings.layouts.name())
}

/// The name with the symbol behind it, where the study gives one.
pub fn titled(name: &str, symbol: &str) -> String {
    if symbol.is_empty() || symbol == name { name.to_owned() } else { format!("{name} ({symbol})") }
}

/// What the study calls the groups that figures and tables show one by one, such as `sensor`.
pub fn group_word(layouts: &Layouts) -> &str {
    let mut labels = layouts.blocks[0]
        .axes
        .iter()
        .filter(|axis| matches!(axis.coordinates, Coordinates::Labels(_)));
    match (labels.next(), labels.next()) {
        (Some(axis), None) => &axis.name,
        _ => "group",
    }
}

/// That a figure shows the first `most` of `all` coordinates, as a sentence; empty when it shows all.
pub fn first_of(all: usize, most: usize) -> String {
    if all <= most {
        return String::new();
    }
    format!(" Of {all} coordinates the first {most} are shown.")
}

/// Facts as a list of terms.
pub fn fact_list(facts: &[Fact]) -> maud::Markup {
    maud::html! {
        @if !facts.is_empty() {
            dl { @for fact in facts { div { dt { (fact.name) } dd { (fact.value) } } } }
        }
    }
}
