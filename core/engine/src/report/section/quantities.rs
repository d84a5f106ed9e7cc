//! Predicted quantities of interest.

use lacuna::data::Unit;
use maud::{Markup, html};

use crate::page::number::{decimals, fixed, significant};
use crate::page::scale::ShownUnit;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section, paragraph};
use crate::report::findings::{Findings, QuantityFindings};

/// The predicted quantities; `None` if the study asks for none.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let all = &findings.quantities;
    if all.is_empty() {
        return None;
    }
    let content = html! {
        (predictions(all, numbers))
        @if let Some(table) = without_table(all) { (sources(&table, numbers)) }
        @for sentence in left_out(all) { p { (paragraph(&sentence)) } }
    };
    Some(Section { id: "quantities", title: "Predicted quantities", content })
}

/// Displayed unit of a quantity.
fn unit(found: &QuantityFindings) -> ShownUnit {
    let own = Unit::parse(&found.unit).unwrap_or_default();
    ShownUnit::for_values(&own, [found.total.mean, found.total.q025, found.total.q975])
}

/// A number of a quantity: with the digits that the Monte Carlo error allows, or significant ones if it is far from one.
fn number(found: &QuantityFindings, value: f64) -> String {
    let unit = unit(found);
    let shown = unit.show(value);
    let places = decimals(unit.show(found.mcse_mean), unit.show(found.total.sd));
    let size = found.total.mean.abs().max(found.total.sd);
    if !shown.is_finite() || places > 6 || unit.show(size).abs() >= 1e6 {
        significant(shown, 4)
    } else {
        fixed(shown, places)
    }
}

/// Table of the predictions, with as many digits as the Monte Carlo error allows.
pub fn quantity_table(all: &[QuantityFindings]) -> Table {
    let heads =
        ["mean", "sd", "2.5 %", "median", "97.5 %", "MCSE", "mean, parameters only", "sd", "MAP"];
    let has_reference = all.iter().any(|found| found.reference.is_some());
    let heads: Vec<&str> = heads.into_iter().chain(has_reference.then_some("reference")).collect();
    let mut table = Table::new(&["quantity", "unit"], &heads);
    for found in all {
        let (total, alone) = (found.total, found.parameters);
        let cell = |value: f64| number(found, value);
        let mut cells = vec![found.name.clone(), unit(found).unit.clone()];
        cells.extend([total.mean, total.sd, total.q025, total.median, total.q975].map(cell));
        cells.push(significant(unit(found).show(found.mcse_mean), 2));
        cells.extend([alone.mean, alone.sd, found.map].map(cell));
        cells.extend(found.reference.map(cell));
        table.row(cells);
    }
    table
}

/// Table of the standard deviations without one source of uncertainty; `None` if there is only one source.
pub fn without_table(all: &[QuantityFindings]) -> Option<Table> {
    let mut sources: Vec<&str> = Vec::new();
    for (source, _) in all.iter().flat_map(|found| &found.without) {
        if !sources.contains(&source.as_str()) {
            sources.push(source);
        }
    }
    if sources.len() < 2 {
        return None;
    }
    let heads: Vec<String> =
        sources.iter().map(|source| format!("without {}", worded(source))).collect();
    let heads: Vec<&str> = std::iter::once("all").chain(heads.iter().map(String::as_str)).collect();
    let mut table = Table::new(&["quantity", "unit"], &heads);
    for found in all {
        let sd = |source: &&str| {
            let own = found.without.iter().find(|(other, _)| other == source);
            own.map_or_else(String::new, |(_, sd)| significant(unit(found).show(*sd), 3))
        };
        let mut cells = vec![found.name.clone(), unit(found).unit.clone()];
        cells.push(significant(unit(found).show(found.total.sd), 3));
        cells.extend(sources.iter().map(sd));
        table.row(cells);
    }
    Some(table)
}

/// Name of a source in words.
fn worded(source: &str) -> String {
    source.replace('_', " ")
}

fn predictions(all: &[QuantityFindings], numbers: &mut Numbers) -> Markup {
    let caption = Caption::new(
        "Quantities of interest. Mean, sd and quantiles contain the posterior of the parameters and the errors that the \
         study includes; the columns after them the posterior of the parameters alone, and the value at the MAP. \
         Numbers end at the first digit of the Monte Carlo standard error (MCSE) of the mean.",
        "posterior predictive: given this model and this discrepancy.",
        "an sd far above that of the parameters: the errors of the prediction matter more than the calibration.",
    );
    numbers.table(&quantity_table(all), &caption)
}

fn sources(table: &Table, numbers: &mut Numbers) -> Markup {
    let caption = Caption::new(
        "Standard deviation of each quantity with all sources of uncertainty, and with all but one. All columns use the same \
         random numbers.",
        "posterior predictive.",
        "the column with the smallest number: its source matters most. An empty cell is a source that the quantity does not depend on.",
    );
    numbers.table(table, &caption)
}

/// Sentences on errors that no prediction contains, and on draws at which a quantity is undefined.
fn left_out(all: &[QuantityFindings]) -> Vec<String> {
    let mut sentences = Vec::new();
    let mut origins: Vec<&str> = Vec::new();
    for origin in all.iter().flat_map(|found| &found.leaves_out) {
        if !origins.contains(&origin.as_str()) {
            origins.push(origin);
        }
    }
    for origin in origins {
        let names: Vec<String> = all
            .iter()
            .filter(|found| found.leaves_out.iter().any(|other| other == origin))
            .map(|found| format!("`{}`", found.name))
            .collect();
        let names = names.join(", ");
        sentences.push(match origin {
            "measurement" => {
                format!("The scatter of a new replicate (`measurement`) is not in {names}.")
            }
            "discrepancy" => format!(
                "The discrepancy is not in {names}: without replicates its model form cannot be separated from the scatter \
                 of a replicate. `include = [\"emulator\", \"numerics\", \"discrepancy\"]` adds both."
            ),
            _ => format!("The error `{origin}` is not in {names}."),
        });
    }
    for found in all.iter().filter(|found| found.undefined > 0) {
        let (name, undefined, draws) = (&found.name, found.undefined, found.draws);
        sentences.push(format!("`{name}` is undefined at {undefined} of {draws} draws."));
    }
    sentences
}
