//! The tables of cross-validation, discrimination and drift, and the description of an unlisted effect.

use maud::{Markup, html};

use super::View;
use crate::gap::drift::DriftMap;
use crate::gap::report::sentences::{capitalised, on, p_value};
use crate::gap::result::GapResult;
use crate::gap::result::insight::SIMULATIONS;
use crate::gap::search::{Discrimination, FurtherData};
use crate::page::curves::axis_unit;
use crate::page::number::{fixed, significant, typeset};
use crate::page::scale::ShownUnit;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, paragraph};

/// All further results of the search.
pub fn all(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    let insight = &result.insight;
    html! {
        (unnamed(result))
        @if !insight.cross_validation.is_empty() { (cross_validation(result, numbers)) }
        @if let Some(discrimination) = &insight.discrimination { (separation(view, discrimination, numbers)) }
        @if let Some(map) = &insight.drift { (drift(view, result, map, numbers)) }
    }
}

/// The description of an unlisted effect.
fn unnamed(result: &GapResult) -> Markup {
    let insight = &result.insight;
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
        @if let Some(smoother) = &insight.smoother {
            p {
                "Until it has a name, a smooth process on " (smoother.curves.len())
                " curves, orthogonal to what the parameters do, takes "
                (fixed(100.0 * smoother.explained, 0)) " % of the misfit beyond noise."
            }
        }
    }
}

/// The comparison of two explanations by cross-validation.
fn cross_validation(result: &GapResult, numbers: &mut Numbers) -> Markup {
    let insight = &result.insight;
    let mut table =
        Table::new(&["left out in turn"], &["parts", "difference", "standard error", "p"]);
    for one in &insight.cross_validation {
        table.row([
            one.left_out.words().to_owned(),
            one.parts.to_string(),
            typeset(&fixed(one.corrected, 1)),
            one.error.map_or_else(String::new, |e| fixed(e, 1)),
            one.p.map_or_else(String::new, |p| p_value(p, 0)),
        ]);
    }
    let against = insight.against.as_deref().unwrap_or("nothing");
    let caption = Caption::new(
        format!(
            "Cross-validation of the best explanation against `{against}`, on data to which neither was fitted: the joint \
             log score of what is left out given the rest, summed over the parts, less what the best of so many \
             candidates is ahead by chance."
        ),
        "standard errors pair the replicates, or the parts.",
        "differences below zero: then the other explanation predicts better, whichever fits better.",
    );
    numbers.table(&table, &caption)
}

/// Largest number of further measurements that are listed.
const LISTED: usize = 8;

/// Further measurements that would discriminate between the members of a class.
fn separation(view: &View<'_>, all: &Discrimination, numbers: &mut Numbers) -> Markup {
    let mut table =
        Table::new(&["measured further"], &["log evidence expected", "replicates for 20"]);
    for one in all.ranked.iter().take(LISTED) {
        table.row([
            what(view, &one.what),
            fixed(one.expected, 1),
            one.replicates.map_or_else(|| "over 1024".to_owned(), |n| n.to_string()),
        ]);
    }
    let caption = Caption::new(
        format!(
            "Further data that would discriminate between the members of the class, the best first: the log evidence by which the truth is \
             expected to lead after as many further replicates as there are now ({} with the data as they are), and \
             the number of replicates that make it 20.",
            fixed(all.now, 1)
        ),
        "expected, by linearisation.",
        "the cheapest measurement that decides.",
    );
    numbers.table(&table, &caption)
}

fn what(view: &View<'_>, what: &FurtherData) -> String {
    let under = |scenario: &Option<String>| {
        scenario.as_ref().map(|s| format!(" under `{s}`")).unwrap_or_default()
    };
    match what {
        FurtherData::Condition { scenario } => format!("replicates{}", under(scenario)),
        FurtherData::Sensor { on: place } => format!("replicates{}", on(place)),
        FurtherData::Window { scenario, span } => {
            let unit = axis_unit(view.layouts);
            format!("from {} to {}{}", unit.text(span.0, 3), unit.text(span.1, 3), under(scenario))
        }
        FurtherData::Input { parameter, value } => {
            let known = view.parameters.iter().find(|p| p.name == *parameter);
            let value = known.map_or_else(
                || significant(*value, 3),
                |p| ShownUnit::for_values(&p.unit, [*value]).text(*value, 3),
            );
            format!("all with `{parameter}` at {value}")
        }
    }
}

/// The parameters by condition and window.
fn drift(view: &View<'_>, result: &GapResult, map: &DriftMap, numbers: &mut Numbers) -> Markup {
    let unit = axis_unit(view.layouts);
    let labels: Vec<String> = result
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
        let each = result.parameters.iter().zip(piece.values.iter().zip(&piece.sd));
        let values = each.map(|(shift, (value, sd))| {
            let unit = ShownUnit::for_values(&shift.unit, shift.value);
            format!("{} ± {}", significant(unit.show(*value), 4), significant(unit.show(*sd), 2))
        });
        table.row(std::iter::once(name).chain(values));
    }
    let mut last = vec![String::from("p of equality")];
    last.extend(map.parameters.iter().map(|p| p_value(p.equality.p, SIMULATIONS)));
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
