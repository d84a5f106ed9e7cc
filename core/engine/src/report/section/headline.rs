//! The main results, warnings first.

use maud::{Markup, html};

use super::{banner, coordinate_unit, intervals, response_unit};
use crate::gap::report::verdict;
use crate::page::number::{decimals, fixed, percent, typeset};
use crate::page::paragraph;
use crate::report::findings::{CalibrationFindings, Findings};
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
    let (shown, further) = chosen(findings);
    let parameters = calibration.coordinates.iter().take(shown);
    let values: Vec<String> = parameters
        .map(|c| {
            let unit = coordinate_unit(c);
            let places = decimals(unit.show(c.mcse_mean), unit.show(c.sd));
            let number = |value: f64| typeset(&fixed(unit.show(value), places));
            let interval = format!("{} to {}", number(c.q025), number(c.q975));
            format!("`{}` {}", c.name, unit.join(&format!("{} ({interval})", number(c.mean))))
        })
        .collect();
    let further = match further {
        0 => String::new(),
        further => format!("; those of {further} further parameters are in the table"),
    };
    format!("Posterior means with 95 % credible intervals: {}{further}.", values.join("; "))
}

/// Largest number of parameters that are all shown at the top of the page, and the number shown if there are more.
const MOST_TOLD: (usize, usize) = (12, 6);

/// Numbers of parameters that are shown at the top of the page and that are left to the table.
fn chosen(findings: &Findings) -> (usize, usize) {
    let (most, told) = MOST_TOLD;
    let all = findings.parameters.len();
    let shown = if all > most { told } else { all };
    (shown, all - shown)
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
    let parameters = calibration.coordinates.iter().take(chosen(findings).0);
    html! {
        div.cards {
            @for c in parameters {
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
