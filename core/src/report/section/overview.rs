//! What was studied: components, parameters, design and prior.

use maud::html;

use super::{fact_list, titled};
use crate::plugin::Fact;
use crate::report::findings::Findings;
use crate::report::number::{count, exact, rounded};
use crate::report::page::{Caption, Numbers, Section, paragraph};
use crate::report::table::Table;

/// The study.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Section {
    let mut parameters =
        Table::new(&["parameter", "unit", "design", "prior"], &["reference value"]);
    for p in &findings.parameters {
        parameters.row([
            titled(&p.name, &p.symbol),
            p.unit.to_string(),
            rounded(&p.design.to_string(), 6),
            rounded(&p.prior.to_string(), 6),
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
        },
    }
}

fn response(findings: &Findings) -> String {
    let layout = &findings.layout;
    let axes: Vec<String> =
        layout.axes.iter().map(|axis| format!("{} ({})", axis.name, count(axis.len()))).collect();
    let shape = if axes.is_empty() { String::from("one number") } else { axes.join(" × ") };
    let (name, unit, outputs) = (&layout.name, &layout.unit, count(layout.len()));
    format!("The model's response is `{name}` in the unit `{unit}`: {shape}, {outputs} outputs.")
}

/// What the study is made of, and what it takes to make it again.
fn facts(findings: &Findings) -> Vec<Fact> {
    let components = findings.components.iter().map(|(kind, plugin)| Fact::new(kind, plugin));
    let seed = Fact::new("seed", findings.seed);
    let version = Fact::new("version of Lacuna", &findings.version);
    components.chain([seed, version]).collect()
}
