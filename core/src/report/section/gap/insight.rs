//! What else the search can tell: what foretells, what drifts, what would tell a class apart, what has no name.

use maud::{Markup, html};

use crate::gap::account::Account;
use crate::gap::drift::Map;
use crate::gap::name::{Separations, What};
use crate::report::findings::Findings;
use crate::report::gap::{capitalised, on, p_value};
use crate::report::number::{fixed, significant, typeset};
use crate::report::page::{Caption, Numbers, paragraph};
use crate::report::scale::ShownUnit;
use crate::report::section::axis_unit;
use crate::report::table::Table;

/// Everything of the kind that there is.
pub fn all(findings: &Findings, account: &Account, numbers: &mut Numbers) -> Markup {
    let insight = &account.insight;
    html! {
        (unnamed(account))
        @if !insight.foretold.is_empty() { (foretold(account, numbers)) }
        @if let Some(separations) = &insight.separations { (separation(findings, separations, numbers)) }
        @if let Some(map) = &insight.drift { (drift(findings, account, map, numbers)) }
    }
}

/// What is known of something without a name.
fn unnamed(account: &Account) -> Markup {
    let insight = &account.insight;
    html! {
        @for place in &insight.places { p { (paragraph(&place.words)) } }
        @if let Some(symbolic) = &insight.symbolic {
            p {
                "A form that fits: what is added to the response is " code { (symbolic.form) } ". It explains "
                (fixed(100.0 * symbolic.explained, 0)) " % of the misfit beyond noise, less what the best of "
                (symbolic.tried) " terms would of noise alone. A form is no name: it says how to look for one."
            }
            @for written in &symbolic.expressions {
                p { "As an effect of your own" (on(&written.on)) ": " code { "formula = \"" (written.formula) "\"" } }
            }
        }
        @if let Some(stopgap) = &insight.stopgap {
            p {
                "Until it has a name, a smooth process on " (stopgap.curves.len())
                " curves, orthogonal to what the parameters do, takes "
                (fixed(100.0 * stopgap.explained, 0)) " % of the misfit beyond noise."
            }
        }
    }
}

/// What is foretold of left-out data.
fn foretold(account: &Account, numbers: &mut Numbers) -> Markup {
    let insight = &account.insight;
    let mut table =
        Table::new(&["left out in turn"], &["parts", "difference", "standard error", "p"]);
    for one in &insight.foretold {
        table.row([
            one.left_out.words().to_owned(),
            one.parts.to_string(),
            typeset(&fixed(one.corrected, 1)),
            one.error.map_or_else(String::new, |e| fixed(e, 1)),
            one.p.map_or_else(String::new, p_value),
        ]);
    }
    let against = insight.against.as_deref().unwrap_or("nothing");
    let caption = Caption::new(
        format!(
            "What the best explanation foretells of data that neither was fitted to, against `{against}`: the joint \
             log score of what is left out given the rest, summed over the parts, less what the best of so many \
             candidates is ahead by chance."
        ),
        "standard errors pair the replicates, or the parts.",
        "differences below zero: then the rival foretells better, whatever fits better.",
    );
    numbers.table(&table, &caption)
}

/// The most further measurements that are listed.
const LISTED: usize = 8;

/// What would tell the members of a class apart.
fn separation(findings: &Findings, all: &Separations, numbers: &mut Numbers) -> Markup {
    let mut table =
        Table::new(&["measured further"], &["log evidence expected", "replicates for 20"]);
    for one in all.ranked.iter().take(LISTED) {
        table.row([
            what(findings, &one.what),
            fixed(one.expected, 1),
            one.replicates.map_or_else(|| "over 1024".to_owned(), |n| n.to_string()),
        ]);
    }
    let caption = Caption::new(
        format!(
            "What would tell the members of the class apart, the best first: the log evidence by which the truth is \
             expected to lead after as many further replicates as there are now ({} with the data as they are), and \
             the number of replicates that make it 20.",
            fixed(all.now, 1)
        ),
        "expected, by linearisation.",
        "the cheapest measurement that decides.",
    );
    numbers.table(&table, &caption)
}

fn what(findings: &Findings, what: &What) -> String {
    let under = |scenario: &Option<String>| {
        scenario.as_ref().map(|s| format!(" under `{s}`")).unwrap_or_default()
    };
    match what {
        What::Condition { scenario } => format!("replicates{}", under(scenario)),
        What::Sensor { on: place } => format!("replicates{}", on(place)),
        What::Window { scenario, span } => {
            let unit = axis_unit(findings);
            format!("from {} to {}{}", unit.text(span.0, 3), unit.text(span.1, 3), under(scenario))
        }
        What::Input { parameter, value } => {
            let known = findings.parameters.iter().find(|p| p.name == *parameter);
            let value = known.map_or_else(
                || significant(*value, 3),
                |p| ShownUnit::for_values(&p.unit, [*value]).text(*value, 3),
            );
            format!("all with `{parameter}` at {value}")
        }
    }
}

/// The parameters by condition and window.
fn drift(findings: &Findings, account: &Account, map: &Map, numbers: &mut Numbers) -> Markup {
    let unit = axis_unit(findings);
    let labels: Vec<String> = account
        .parameters
        .iter()
        .map(|shift| ShownUnit::for_values(&shift.unit, shift.value).label(&shift.name))
        .collect();
    let heads: Vec<&str> = labels.iter().map(String::as_str).collect();
    let mut table = Table::new(&["recalibrated with"], &heads);
    for piece in &map.pieces {
        let scenario = piece.scenario.as_ref().map(|s| format!(" · {s}")).unwrap_or_default();
        let name =
            format!("{} to {}{scenario}", unit.text(piece.span.0, 3), unit.text(piece.span.1, 3));
        let each = account.parameters.iter().zip(piece.values.iter().zip(&piece.sd));
        let values = each.map(|(shift, (value, sd))| {
            let unit = ShownUnit::for_values(&shift.unit, shift.value);
            format!("{} ± {}", significant(unit.show(*value), 4), significant(unit.show(*sd), 2))
        });
        table.row(std::iter::once(name).chain(values));
    }
    let mut last = vec![String::from("p of equality")];
    last.extend(map.parameters.iter().map(|p| p_value(p.equality.p)));
    table.emphasised(last);
    let caption = Caption::new(
        format!(
            "The parameters recalibrated by condition and window, without any effect. {}.",
            capitalised(&map.words)
        ),
        "normal approximation, with the noise of all pieces together.",
        "parameters that differ between pieces while no sensor stands out: the model is wrong there, and not a sensor's \
         chain.",
    );
    numbers.table(&table, &caption)
}
