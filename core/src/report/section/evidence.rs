//! What speaks for the study as a whole.

use maud::html;

use crate::report::findings::{CalibrationFindings, Findings};
use crate::report::number::{count, decimals, fixed, typeset};
use crate::report::page::{Section, paragraph};
use crate::report::qualified;

/// The evidence and the prediction of left-out data, where they are known.
pub fn section(findings: &Findings) -> Option<Section> {
    let calibration = findings.calibration.as_ref()?;
    let sentences = sentences(findings, calibration);
    if sentences.is_empty() {
        return None;
    }
    let content = html! {
        @for sentence in &sentences { p { (paragraph(sentence)) } }
        p {
            "Neither number means anything alone: they compare studies of the same data, side by side in \
             `lacuna compare`. The difference of two log evidences is the logarithm of the Bayes factor; it \
             depends on the priors of all unknowns, the predictions hardly do."
        }
    };
    Some(Section { id: "evidence", title: "Evidence", content })
}

/// The same in words.
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
        let value = number(left.elpd, left.error);
        let trusted = match left.unreliable {
            0 => String::from("all estimates are reliable"),
            bad => format!("{} estimates have k-hat above 0.7: do not rely on it", count(bad)),
        };
        sentences.push(format!(
            "Log density of each of {} data predicted from all others (PSIS-LOO), summed: {value}, {} \
             effective parameters; {trusted}.",
            count(left.count),
            fixed(left.parameters, 1),
        ));
    }
    sentences
}
