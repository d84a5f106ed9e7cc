//! Overview of the study: components, parameters, design and prior.

use lacuna::data::{Axis, Layout};
use lacuna::plugin::Fact;
use maud::html;

use super::{fact_list, titled};
use crate::page::number::{count, exact, rounded};
use crate::page::scale::printed;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section, paragraph};
use crate::report::findings::{Findings, RunInput};

/// The study.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Section {
    let mut parameters =
        Table::new(&["parameter", "unit", "design", "prior"], &["reference value"]);
    for (j, p) in findings.parameters.iter().enumerate() {
        parameters.row([
            titled(&p.name, &p.symbol),
            printed(&p.unit),
            if is_varied(findings, j) {
                rounded(&p.design.to_string(), 6)
            } else {
                String::from("–")
            },
            if findings.intervals.contains(&j) {
                let (low, high) = p.prior.support();
                rounded(&format!("interval [{low}, {high}]"), 6)
            } else {
                rounded(&p.prior.to_string(), 6)
            },
            p.reference.map_or_else(|| String::from("–"), exact),
        ]);
    }
    let caption = Caption::new(
        "The unknowns of the model. All numbers are in the unit of their row.",
        "the design says where the surrogate was trained, the prior what was believed before \
         the measurements.",
        "priors that reach beyond the design, where the surrogate would extrapolate.",
    );
    Section {
        id: "overview",
        title: "Study",
        content: html! {
            p { (paragraph(&response(findings))) }
            (fact_list(&facts(findings)))
            @if !parameters.is_empty() { (numbers.table(&parameters, &caption)) }
            @if !findings.prior.is_empty() {
                p { "The priors depend on each other. Figures and tables show the prior of each parameter alone." }
                (fact_list(&findings.prior))
            }
        },
    }
}

/// True if runs may vary a parameter; they do not vary location and scale of a population.
fn is_varied(findings: &Findings, j: usize) -> bool {
    let varies = |input: &RunInput| input.places.contains(&j);
    findings.ensemble.as_ref().is_none_or(|ensemble| ensemble.inputs.iter().any(varies))
}

fn response(findings: &Findings) -> String {
    let layouts = &findings.layouts;
    let shape = |layout: &Layout| {
        let size = |axis: &Axis| format!("{} ({})", axis.name, count(axis.len()));
        let axes: Vec<String> = layout.axes.iter().map(size).collect();
        if axes.is_empty() { String::from("one number") } else { axes.join(" × ") }
    };
    let shapes: Vec<String> = layouts.blocks.iter().take(MOST_SHAPES).map(shape).collect();
    let more = match layouts.blocks.len().saturating_sub(MOST_SHAPES) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let (name, unit, outputs) = (layouts.name(), printed(layouts.unit()), count(layouts.len()));
    let shapes = shapes.join("; ");
    format!(
        "The model's response is `{name}` in the unit `{unit}`: {shapes}{more}, {outputs} outputs."
    )
}

/// Largest number of blocks of scenarios whose shapes are listed.
const MOST_SHAPES: usize = 3;

/// Components of the study, and the information needed to reproduce it.
fn facts(findings: &Findings) -> Vec<Fact> {
    let components = findings.components.iter().map(|(kind, plugin)| Fact::new(kind, plugin));
    let seed = Fact::new("seed", findings.seed);
    let version = Fact::new("version of Lacuna", &findings.version);
    components.chain([seed, version]).collect()
}
