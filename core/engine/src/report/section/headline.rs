//! The main results, warnings first.

use maud::{Markup, PreEscaped, html};

use super::fields::sketch;
use super::{banner, coordinate_unit, intervals, response_unit};
use crate::gap::report::verdict;
use crate::page::number::{decimals, fixed, percent, significant, typeset};
use crate::page::paragraph;
use crate::page::scale::{ShownUnit, extent};
use crate::report::findings::{CalibrationFindings, CoordinateFindings, FieldFindings, Findings};
use crate::report::qualified;
use crate::stage::validate::ValidationFindings;

/// The box at the top of the page.
pub fn headline(findings: &Findings) -> Markup {
    html! {
        (banner::banner(&findings.assessment))
        @if !findings.warnings.is_empty() {
            div.warnings role="note" {
                h2 { "Warnings on the way" }
                ul { @for warning in &findings.warnings { li { (paragraph(warning)) } } }
            }
        }
        div.headline {
            @for sentence in sentences(findings) { p { (paragraph(&sentence)) } }
            @if let Some(calibration) = &findings.calibration { (cards(findings, calibration)) }
            @if let Some(note) = &findings.note { p.note { b { "Note. " } (paragraph(note)) } }
        }
    }
}

/// The main results in at most three sentences.
pub fn sentences(findings: &Findings) -> Vec<String> {
    let mut sentences = Vec::new();
    if let Some(calibration) = &findings.calibration {
        sentences.push(estimate(findings, calibration));
        sentences.push(convergence(findings, calibration));
    }
    sentences.extend(findings.validation.as_ref().and_then(|v| agreement(findings, v)));
    sentences.extend(findings.gap.as_ref().map(|gap| verdict(&gap.result)));
    if let Some(found) = &findings.propagated {
        let (samples, inputs) = (found.samples, found.inputs.len());
        let word = if inputs == 1 { "input" } else { "inputs" };
        if inputs > 0 {
            sentences.push(format!(
                "The priors of {inputs} {word} were propagated through the model at {samples} draws; nothing was calibrated."
            ));
        }
        sentences.extend(found.bounds.as_ref().map(intervals::sentence));
    }
    if sentences.is_empty() {
        sentences.push(String::from("This run has no calibration yet."));
    }
    sentences
}

fn estimate(findings: &Findings, calibration: &CalibrationFindings) -> String {
    let (shown, further) = chosen(findings, calibration);
    let fields = findings.fields.iter().filter_map(field_in_words);
    let values: Vec<String> = shown
        .into_iter()
        .map(|c| {
            let unit = coordinate_unit(c);
            let places = decimals(unit.show(c.mcse_mean), unit.show(c.sd));
            let number = |value: f64| typeset(&fixed(unit.show(value), places));
            let interval = format!("{} to {}", number(c.q025), number(c.q975));
            format!("`{}` {}", c.name, unit.join(&format!("{} ({interval})", number(c.mean))))
        })
        .chain(fields)
        .collect();
    let further = match further {
        0 => String::new(),
        further => format!("; those of {further} further parameters are in the table"),
    };
    format!("Posterior means with 95 % credible intervals: {}{further}.", values.join("; "))
}

/// Largest number of parameters that are all shown at the top of the page, and the number shown if there are more.
const MOST_TOLD: (usize, usize) = (12, 6);

/// Parameters that are shown at the top of the page, and the number of those that are left to the table. The
/// coefficients of random fields are left out: they mean nothing by themselves, and their fields stand there instead.
fn chosen<'a>(
    findings: &Findings,
    calibration: &'a CalibrationFindings,
) -> (Vec<&'a CoordinateFindings>, usize) {
    let coefficients: Vec<String> =
        findings.fields.iter().flat_map(|found| found.field.coefficients()).collect();
    let parameters = calibration.coordinates.iter().take(findings.parameters.len());
    let mut shown: Vec<_> = parameters.filter(|c| !coefficients.contains(&c.name)).collect();
    let (most, told) = MOST_TOLD;
    let all = shown.len();
    if all > most {
        shown.truncate(told);
    }
    let further = all - shown.len();
    (shown, further)
}

/// Displayed unit of a field, and the formatted ends of the range of its posterior mean and of its 95 % band.
fn field_range(found: &FieldFindings) -> Option<(ShownUnit, [[String; 2]; 2])> {
    let band = found.posterior.as_ref()?;
    let edges = band.q025.iter().chain(&band.q975).copied();
    let unit = ShownUnit::for_values(&found.field.unit, edges.clone());
    let (mean, edges) = (extent(band.mean.iter().copied())?, extent(edges)?);
    let text = |value: f64| typeset(&significant(unit.show(value), 3));
    let both = [mean, edges].map(|(low, high)| [text(low), text(high)]);
    Some((unit, both))
}

/// A field in the sentence on the posterior.
fn field_in_words(found: &FieldFindings) -> Option<String> {
    let (unit, [[low, high], [least, most]]) = field_range(found)?;
    let values = unit.join(&format!("{low} to {high} ({least} to {most})"));
    Some(format!("the field `{}` along `{}` {values}", found.field.name, found.field.axis))
}

/// The tile of a field: its posterior mean with its 95 % band along its coordinate.
fn field_card(found: &FieldFindings) -> Markup {
    let Some((unit, [[low, high], [least, most]])) = field_range(found) else { return html! {} };
    html! {
        div.card {
            div.card-name { "field " (found.field.name) }
            div.card-value { (low) " to " (high) " " span.card-unit { (unit.join("")) } }
            div.card-more { "posterior mean along " (found.field.axis) " · 95 % between " (least) " and " (most) }
            (PreEscaped(sketch(found)))
        }
    }
}

fn convergence(findings: &Findings, calibration: &CalibrationFindings) -> String {
    let outcome = if calibration.converged { "The chains converged" } else { "Not converged" };
    match qualified::convergence(findings, calibration).trim_end_matches('.') {
        "" | "converged" => format!("{outcome}."),
        verdict if calibration.converged => format!("{outcome}; note: {verdict}."),
        verdict => format!("{outcome}: {verdict}."),
    }
}

fn agreement(findings: &Findings, validation: &ValidationFindings) -> Option<String> {
    let unit = response_unit(findings);
    let (first, others) = validation.cases.split_first()?;
    let how = if first.simulated { "simulated" } else { "emulated" };
    if first.accuracy.is_empty() {
        let (name, rmse) = (case_title(&first.name), unit.text(first.rmse, 3));
        return Some(format!(
            "The {how} response at the {name} differs from what was measured by {rmse} root mean square."
        ));
    }
    let map = format!(
        "{} of the {how} points at the {} lie inside the replicates' 95 % interval (mean over \
         groups) and differ from the replicates' mean by {} root mean square",
        percent(first.average),
        case_title(&first.name),
        unit.text(first.rmse, 3),
    );
    let others = others.iter().map(|other| {
        let (share, rmse) = (percent(other.average), unit.text(other.rmse, 3));
        format!("; at the {} {share} and {rmse}", case_title(&other.name))
    });
    Some(format!("{map}{}.", others.collect::<String>()))
}

/// The title of a case in a sentence.
pub fn case_title(name: &str) -> &str {
    match name {
        "map" => "MAP",
        name => name,
    }
}

fn cards(findings: &Findings, calibration: &CalibrationFindings) -> Markup {
    html! {
        div.cards {
            @for found in &findings.fields { (field_card(found)) }
            @for c in chosen(findings, calibration).0 {
                @let unit = coordinate_unit(c);
                @let places = decimals(unit.show(c.mcse_mean), unit.show(c.sd));
                div.card {
                    div.card-name { (c.name) }
                    div.card-value {
                        (typeset(&fixed(unit.show(c.mean), places)))
                        span.card-unit { (unit.join("")) }
                    }
                    div.card-more {
                        "posterior sd " (typeset(&fixed(unit.show(c.sd), places)))
                        " · MAP " (typeset(&fixed(unit.show(c.map), places)))
                    }
                }
            }
        }
    }
}
