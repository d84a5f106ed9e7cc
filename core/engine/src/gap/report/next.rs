//! The information that further measurements are expected to give, as a text for the terminal.

use super::sentences::on;
use crate::gap::next::{NextData, NextOption};
use crate::gap::search::FurtherData;
use crate::page::number::{fixed, percent};
use crate::page::table::Table;

/// The options as a table, the best first.
pub fn text(next: &NextData) -> String {
    let mut table =
        Table::new(&["measured further"], &["bits on the name", "error", "on the parameters", ""]);
    for option in &next.options {
        table.row([
            words(option),
            fixed(option.name, 3),
            fixed(option.name_error, 3),
            fixed(option.parameters, 3),
            if option.equal_to_best { "=".to_owned() } else { String::new() },
        ]);
    }
    let names = next.hypotheses.iter().map(|own| format!("{} {}", own.kind, percent(own.weight)));
    let names: Vec<String> = names.collect();
    let head = if names.is_empty() {
        "No choice of a name: ranked by the bits on the parameters.\n".to_owned()
    } else {
        format!("Possible names: {}. Ranked by the bits on the name.\n", names.join(", "))
    };
    let foot = "`=`: equal to the best within two standard errors of the Monte Carlo estimate.\n";
    format!("{head}\n{}\n{foot}", table.text())
}

fn words(option: &NextOption) -> String {
    let count = match option.replicates {
        1 => "1 replicate".to_owned(),
        n => format!("{n} replicates"),
    };
    match &option.what {
        None => format!("{count} of everything"),
        Some(FurtherData::Condition { scenario: Some(name) }) => format!("{count} under `{name}`"),
        Some(FurtherData::Sensor { on: place }) => format!("{count}{}", on(place)),
        Some(_) => count,
    }
}
