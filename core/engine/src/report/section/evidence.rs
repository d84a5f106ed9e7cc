//! The evidence, and the prediction of held-out data.

use maud::html;

use super::left_out;
use crate::page::number::{count, decimals, fixed, typeset};
use crate::page::{Numbers, Section, paragraph};
use crate::report::findings::{CalibrationFindings, Findings};
use crate::report::qualified;

/// The evidence and the prediction of held-out data; `None` if neither is known.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let calibration = findings.calibration.as_ref()?;
    let sentences = sentences(findings, calibration);
    if sentences.is_empty() {
        return None;
    }
    let content = html! {
        @for sentence in &sentences { p { (paragraph(sentence)) } }
        @if let Some(left) = &calibration.left_out { (left_out::figures(left, numbers)) }
        p {
            (paragraph(
                "Neither number means anything alone: they compare studies of the same data, side by side in \
                 `lacuna compare`. The difference of two log evidences is the logarithm of the Bayes factor; it \
                 depends on the priors of all unknowns, the predictions hardly do."
            ))
        }
    };
    Some(Section { id: "evidence", title: "Evidence", content })
}

/// Statement on whether the estimates can be trusted, given the number of those with k-hat above `limit`.
fn trusted(unreliable: usize, limit: f64) -> String {
    match unreliable {
        0 => String::from("all estimates are reliable"),
        bad => format!(
            "{} {} k-hat above {}: do not rely on it",
            count(bad),
            if bad == 1 { "estimate has" } else { "estimates have" },
            (100.0 * limit).round() / 100.0
        ),
    }
}

/// The evidence and the prediction of held-out data in sentences.
pub fn sentences(findings: &Findings, calibration: &CalibrationFindings) -> Vec<String> {
    let number = |value: f64, error: f64| {
        let places = decimals(error, f64::NAN).min(4);
        format!("{} ± {}", typeset(&fixed(value, places)), fixed(error, places))
    };
    let mut sentences = Vec::new();
    if let Some(evidence) = &calibration.evidence {
        let value = number(evidence.log, evidence.error);
        let limit = qualified::evidence(findings).map_or(String::new(), |why| format!(", {why}"));
        sentences.push(format!("Log evidence {value} ({}){limit}.", evidence.method));
    }
    if let Some(left) = &calibration.left_out {
        let value = number(left.elpd, left.error_by_curve.unwrap_or(left.error));
        let origin = match left.error_by_curve {
            Some(_) => format!(
                " (standard error by curve; {} as if the data were independent)",
                fixed(left.error, decimals(left.error, f64::NAN).min(4))
            ),
            None => " (standard error as if the data were independent)".to_owned(),
        };
        sentences.push(format!(
            "Log density of each of {} data predicted from all others (PSIS-LOO), summed: {value}{origin}, {} \
             effective parameters; {}.",
            count(left.count),
            fixed(left.parameters, 1),
            trusted(left.unreliable, left.limit),
        ));
        sentences.extend(left.curves.as_ref().map(|curves| {
            format!(
                "Log density of each of {} curves predicted from all others, summed: {}, {} effective parameters; {}.",
                count(curves.count),
                number(curves.elpd, curves.error),
                fixed(curves.parameters, 1),
                trusted(curves.unreliable, left.limit),
            )
        }));
    }
    sentences
}
