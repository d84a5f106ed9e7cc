//! The evidence, and the prediction of held-out data.

use maud::{Markup, html};

use crate::page::chart::{Axis, Curve, Key, dot_chart};
use crate::page::number::{count, decimals, fixed, typeset};
use crate::page::scale::{extent, padded};
use crate::page::{Caption, Numbers, Section, paragraph};
use crate::report::findings::{CalibrationFindings, Findings, LeftOutFindings};
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
        @if let Some(left) = &calibration.left_out { (shapes(left, numbers)) }
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

/// Largest number of dots of the figure of k-hat.
const MOST_DOTS: usize = 1500;

/// The shape k-hat of each datum, with the limit.
fn shapes(left: &LeftOutFindings, numbers: &mut Numbers) -> Markup {
    let all = left.k_hat.iter().enumerate().map(|(i, &k)| (i as f64 + 1.0, k));
    let known: Vec<(f64, f64)> = all.filter(|(_, k)| k.is_finite()).collect();
    let Some((low, high)) = extent(known.iter().map(|p| p.1)) else { return html! {} };
    let stride = known.len().div_ceil(MOST_DOTS).max(1);
    let is_shown = |(i, p): &(usize, &(f64, f64))| i % stride == 0 || p.1 > left.limit;
    let dots: Vec<(f64, f64)> =
        known.iter().enumerate().filter(is_shown).map(|(_, p)| *p).take(2 * MOST_DOTS).collect();
    let last = left.k_hat.len() as f64 + 0.5;
    let range = padded((low.min(0.0), high.max(left.limit)), 0.06);
    let x = Axis::new("datum [number in the order of the likelihood]", (0.5, last)).ticks(5);
    let y = Axis::new("k-hat", range).ticks(5);
    let limit = Curve {
        class: "s-equal",
        name: "limit".into(),
        points: vec![(0.5, left.limit), (last, left.limit)],
    };
    let description = format!(
        "k-hat of {} data from {} to {}, {} above the limit of {}",
        count(known.len()),
        fixed(low, 2),
        fixed(high, 2),
        count(left.unreliable),
        fixed(left.limit, 2)
    );
    let keys = [Key::dot("s-pair", "datum"), Key::line("s-equal", "limit")];
    let thinned = if stride > 1 {
        format!(" Of those below the limit one in {stride} is drawn.")
    } else {
        String::new()
    };
    let caption = Caption::new(
        format!(
            "PSIS: the shape k-hat of the largest importance ratios of each datum when it is left out.{thinned}"
        ),
        "importance ratios over the draws.",
        "dots above the line: the posterior depends so much on that datum that its prediction cannot be trusted.",
    );
    let drawing = dot_chart(&dots, &[limit], (&x, &y), ("k-hat", &description));
    numbers.figure("k-hat", &[drawing], &keys, &caption)
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
