//! Probabilities of rare events.

use maud::{Markup, html};

use crate::page::number::significant;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section, paragraph};
use crate::report::findings::{Findings, RareEvent};

/// The probabilities; `None` if the study asks for none.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let all = &findings.reliability;
    if all.is_empty() {
        return None;
    }
    let content = html! {
        (probabilities(all, numbers))
        @if let Some(table) = design_table(all) { (points(&table, numbers)) }
        @for sentence in doubts(all) { p { (paragraph(&sentence)) } }
    };
    Some(Section { id: "reliability", title: "Probabilities of rare events", content })
}

/// Table of the probabilities.
pub fn reliability_table(all: &[RareEvent]) -> Table {
    let heads = ["probability", "2.5 %", "97.5 %", "variation", "index", "calls"];
    let mut table = Table::new(&["name", "event", "distribution", "method"], &heads);
    for event in all {
        let sign = if event.above { ">" } else { "<" };
        let limit = significant(event.limit, 6);
        let words = format!("{} {sign} {limit} {}", event.quantity, event.unit);
        let mut cells =
            vec![event.name.clone(), words, event.distribution.clone(), event.method.clone()];
        let optional = |value: Option<f64>| value.map_or_else(String::new, |v| significant(v, 3));
        cells.push(significant(event.probability, 3));
        cells.push(optional(event.interval.map(|interval| interval[0])));
        cells.push(optional(event.interval.map(|interval| interval[1])));
        cells.push(optional(event.variation));
        cells.push(significant(event.index(), 4));
        cells.push(event.calls.to_string());
        table.row(cells);
    }
    table
}

/// Table of the design points; `None` if no method has some.
fn design_table(all: &[RareEvent]) -> Option<Table> {
    let mut table = Table::new(&["name", "parameter"], &["distance", "value", "importance"]);
    let mut empty = true;
    for event in all {
        for point in &event.design_points {
            for ((name, value), (_, share)) in point.values.iter().zip(&point.importance) {
                empty = false;
                table.row(vec![
                    event.name.clone(),
                    name.clone(),
                    significant(point.distance, 4),
                    significant(*value, 4),
                    significant(*share, 3),
                ]);
            }
            if event.error_variables > 0 {
                table.row(vec![
                    event.name.clone(),
                    "errors of emulator and numerics".to_owned(),
                    significant(point.distance, 4),
                    String::new(),
                    significant(point.error_importance, 3),
                ]);
            }
        }
    }
    (!empty).then_some(table)
}

fn probabilities(all: &[RareEvent], numbers: &mut Numbers) -> Markup {
    let caption = Caption::new(
        "Probabilities that a quantity exceeds a limit. Interval and coefficient of variation are those of the estimate; the \
         index is minus the standard normal quantile of the probability. Calls are those of the model, or of the emulator if \
         the study has one.",
        "the distribution of the parameters, and the errors of emulator and numerics that the quantity includes. The error of \
         the model's form and the scatter of measurements are not in the probability.",
        "an interval that is wide on the scale of the decision. First- and second-order methods have no interval.",
    );
    numbers.table(&reliability_table(all), &caption)
}

fn points(table: &Table, numbers: &mut Numbers) -> Markup {
    let caption = Caption::new(
        "Design points: the most probable points of the failure region, with the parameters in their units, and the share of \
         each parameter in the variance of the linearised limit state.",
        "the distribution of the parameters and the errors of emulator and numerics.",
        "the parameter with the largest share: its uncertainty matters most for the event.",
    );
    numbers.table(table, &caption)
}

/// Sentences on what makes estimates doubtful.
fn doubts(all: &[RareEvent]) -> Vec<String> {
    let sentences = all.iter().flat_map(|event| {
        event.warnings.iter().map(move |warning| format!("`{}`: {warning}.", event.name))
    });
    sentences.collect()
}
