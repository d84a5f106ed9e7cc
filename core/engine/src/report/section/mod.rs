//! The sections of the report, one per file; a section is left out if the run has no results for it.

pub mod banner;
mod drawn;
mod energy;
mod ensemble;
pub mod evidence;
mod fields;
mod forward;
pub mod headline;
mod intervals;
mod left_out;
mod main_effects;
mod measurements;
mod mixing;
mod overview;
mod populations;
mod posterior;
mod quantities;
mod reliability;
mod residuals;
mod sampling;
pub mod screening;
mod surrogate;
mod timing;
mod validation;

use lacuna::data::{Coordinates, Layouts};
use lacuna::plugin::Fact;

use super::findings::{CoordinateFindings, Findings};
use crate::gap::report;
use crate::gap::report::View;
use crate::page::scale::ShownUnit;
use crate::page::{Numbers, Section};

pub use fields::field_table;
pub use forward::share_table;
pub use intervals::bounds_table;
pub use populations::population_table;
pub use posterior::posterior_table;
pub use quantities::{quantity_table, without_table};
pub use reliability::reliability_table;
pub use validation::accuracy_table;

/// All sections with content, in order.
pub fn all(findings: &Findings, numbers: &mut Numbers) -> Vec<Section> {
    let sections = [
        Some(overview::section(findings, numbers)),
        ensemble::section(findings, numbers),
        measurements::section(findings, numbers),
        surrogate::section(findings, numbers),
        sampling::section(findings, numbers),
        posterior::section(findings, numbers),
        populations::section(findings.calibration.as_ref(), numbers),
        fields::section(findings, numbers),
        evidence::section(findings, numbers),
        validation::section(findings, numbers),
        quantities::section(findings, numbers),
        intervals::section(findings, numbers),
        forward::section(findings, numbers),
        reliability::section(findings, numbers),
        findings.gap.as_ref().map(|gap| report::section(&view(findings), gap, numbers)),
        timing::section(findings, numbers),
    ];
    sections.into_iter().flatten().collect()
}

/// View of the findings from which the sections on the gap are made.
pub fn view(findings: &Findings) -> View<'_> {
    View {
        layouts: &findings.layouts,
        parameters: &findings.parameters,
        response: response_unit(findings),
    }
}

/// Displayed unit of a coordinate in all figures and tables of the posterior.
pub fn coordinate_unit(coordinate: &CoordinateFindings) -> ShownUnit {
    ShownUnit::for_values(&coordinate.unit, [coordinate.mean, coordinate.q025, coordinate.q975])
}

/// Displayed unit of the response.
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

/// Label of an axis that shows the response.
pub fn response_label(findings: &Findings) -> String {
    response_unit(findings).label(findings.layouts.name())
}

/// The name, followed by the symbol if the study gives one.
pub fn titled(name: &str, symbol: &str) -> String {
    if symbol.is_empty() || symbol == name { name.to_owned() } else { format!("{name} ({symbol})") }
}

/// Name of the axis by which figures and tables group the response, such as `sensor`.
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

/// A sentence which states that a figure shows the first `most` of `all` coordinates; empty if it shows all.
pub fn first_of(all: usize, most: usize) -> String {
    if all <= most {
        return String::new();
    }
    format!(" Of {all} coordinates the first {most} are shown.")
}

/// A sentence which states that a figure shows the first `most` of `all` quantities; empty if it shows all.
pub fn first_of_quantities(all: usize, most: usize) -> String {
    if all <= most {
        String::new()
    } else {
        format!(" Of {all} quantities the first {most} are shown.")
    }
}

/// Facts as a definition list.
pub fn fact_list(facts: &[Fact]) -> maud::Markup {
    maud::html! {
        @if !facts.is_empty() {
            dl { @for fact in facts { div { dt { (fact.name) } dd { (fact.value) } } } }
        }
    }
}
