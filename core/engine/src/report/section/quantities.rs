//! Predicted quantities of interest.

use lacuna::data::Unit;
use maud::{Markup, html};

use super::first_of_quantities;
use crate::page::chart::{Key, Marginal, Mark, marginals};
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
        (histograms(all, numbers))
        @if let Some(table) = without_table(all) { (sources(&table, numbers)) }
        @for sentence in left_out(all) { p { (paragraph(&sentence)) } }
    };
    Some(Section { id: "quantities", title: "Predicted quantities", content })
}

/// Displayed unit of a quantity.
pub(super) fn unit(found: &QuantityFindings) -> ShownUnit {
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
    let of_priors = all.iter().any(|found| found.of_priors);
    let centre = if of_priors { "at medians" } else { "MAP" };
    let heads = ["mean", "sd", "2.5 %", "median", "97.5 %", "MCSE", centre];
    let has_reference = all.iter().any(|found| found.reference.is_some());
    let heads: Vec<&str> = heads.into_iter().chain(has_reference.then_some("reference")).collect();
    let mut table = Table::new(&["quantity", "unit"], &heads);
    for found in all {
        let total = found.total;
        let cell = |value: f64| number(found, value);
        let mut cells = vec![found.name.clone(), unit(found).unit.clone()];
        cells.extend([total.mean, total.sd, total.q025, total.median, total.q975].map(cell));
        cells.push(significant(unit(found).show(found.mcse_mean), 2));
        cells.push(cell(found.map));
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
    let both = ["all", "parameters only"];
    let heads: Vec<&str> = both.into_iter().chain(heads.iter().map(String::as_str)).collect();
    let mut table = Table::new(&["quantity", "unit"], &heads);
    for found in all {
        let sd = |source: &&str| {
            let own = found.without.iter().find(|(other, _)| other == source);
            own.map_or_else(String::new, |(_, sd)| significant(unit(found).show(*sd), 3))
        };
        let mut cells = vec![found.name.clone(), unit(found).unit.clone()];
        cells.extend(
            [found.total.sd, found.parameters.sd].map(|sd| significant(unit(found).show(sd), 3)),
        );
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
    let of_priors = all.iter().any(|found| found.of_priors);
    let bounded = all.iter().any(|found| found.bounds.is_some());
    let (whose, centre, given) = if bounded {
        (
            "the priors, with parameters known as an interval only at its middle,",
            "value at the medians of the priors, without errors",
            "one point of the intervals: the next section has the bounds over all of them.",
        )
    } else if of_priors {
        (
            "the priors",
            "value at the medians of the priors, without errors",
            "prior predictive: given this model.",
        )
    } else {
        (
            "the posterior of the parameters",
            "value at the MAP, without errors",
            "posterior predictive: given this model and this discrepancy.",
        )
    };
    let caption = Caption::new(
        format!(
            "Quantities of interest. Mean, sd and quantiles contain {whose} and the errors that the study includes; the \
             last column is the {centre}. Numbers end at the first digit of the Monte Carlo standard error (MCSE) of the \
             mean."
        ),
        given,
        "an interval wider than the decision allows: the next table says which source matters most.",
    );
    numbers.table(&quantity_table(all), &caption)
}

/// Largest number of quantities that are shown in histograms.
const MOST_SHOWN: usize = 16;

/// Histograms of the draws with their 95 % intervals.
fn histograms(all: &[QuantityFindings], numbers: &mut Numbers) -> Markup {
    let panel = |found: &QuantityFindings| {
        let unit = unit(found);
        let mark = |class, label: &str, value: f64| Mark {
            class,
            label: label.to_owned(),
            value: unit.show(value),
        };
        let total = found.total;
        let mut marks = vec![
            mark("m-interval", "2.5 %", total.q025),
            mark("m-map", "median", total.median),
            mark("m-interval", "97.5 %", total.q975),
        ];
        marks.extend(found.reference.map(|value| mark("m-reference", "reference", value)));
        Marginal {
            title: found.name.clone(),
            remark: String::new(),
            label: unit.label(&found.name),
            density_label: "density".to_owned(),
            draws: found.values.iter().map(|&value| unit.show(value)).collect(),
            curves: Vec::new(),
            marks,
            second: None,
        }
    };
    let varies = |found: &&QuantityFindings| found.total.sd > 0.0;
    let panels: Vec<Marginal> = all.iter().filter(varies).take(MOST_SHOWN).map(panel).collect();
    if panels.is_empty() {
        return html! {};
    }
    let caption = Caption::new(
        format!(
            "Draws of the quantities, scaled to area one.{}",
            first_of_quantities(all.len(), MOST_SHOWN)
        ),
        "the numbers of the table above.",
        "two modes or a long tail, which mean and sd do not show.",
    );
    let keys = [
        Key::area("s-histogram", "draws"),
        Key::line("m-map", "median"),
        Key::line("m-interval", "95 % interval"),
    ];
    let drawings = marginals(&panels, "draws of a quantity");
    numbers.figure("quantities", &drawings, &keys, &caption)
}

fn sources(table: &Table, numbers: &mut Numbers) -> Markup {
    let caption = Caption::new(
        "Standard deviation of each quantity with all sources of uncertainty, with that of the parameters only, and with \
         all but one. All columns use the same random numbers.",
        "as in the table above.",
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
