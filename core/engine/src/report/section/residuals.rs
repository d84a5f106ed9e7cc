//! Residuals of the calibrated model as a map of sensors and times.

use maud::{Markup, html};

use super::group_word;
use crate::page::chart::{Axis, Strip, residual_map};
use crate::page::curves::Curves;
use crate::page::number::{fixed, significant, typeset};
use crate::page::scale::padded;
use crate::page::{Caption, Numbers};
use crate::report::findings::Findings;
use crate::stage::validate::ValidationFindings;

/// The map; empty without residuals.
pub fn map(findings: &Findings, validation: &ValidationFindings, numbers: &mut Numbers) -> Markup {
    let residuals = &validation.residuals;
    if !residuals.iter().any(|r| r.is_finite()) {
        return html! {};
    }
    let outlines = Curves::of(&findings.layouts);
    let strips: Vec<Strip> = outlines
        .panels
        .iter()
        .map(|outline| Strip {
            name: outline.title.clone(),
            points: outline.curve(|i| residuals.get(i).copied().unwrap_or(f64::NAN)),
            outlines: Vec::new(),
        })
        .collect();
    let domain = if outlines.domain.1 > outlines.domain.0 {
        outlines.domain
    } else {
        padded((outlines.domain.0 - 0.5, outlines.domain.1 + 0.5), 0.0)
    };
    let x = Axis::new(outlines.label.as_str(), domain).ticks(6);
    let caption = Caption::new(
        format!(
            "The mean of the replicates less the response at the MAP, in standard deviations of a new replicate. Blue: measured \
             above the model; red: below; the darkest colour is six or more.{}{}",
            largest(findings, &outlines, &strips),
            outlines.left_out_sentence()
        ),
        "posterior predictive of one new replicate; neighbouring values are not independent.",
        "a stretch of one colour: structure that these parameters cannot remove. One row alone points at a sensor, all rows at \
         one time at the model.",
    );
    let drawing = residual_map(&strips, &x, "residuals at the MAP");
    numbers.figure("residuals", &[drawing], &[], &caption)
}

/// A sentence that names the sensor and the time of the largest residual.
fn largest(findings: &Findings, outlines: &Curves, strips: &[Strip]) -> String {
    let all = strips.iter().flat_map(|strip| strip.points.iter().map(move |p| (&strip.name, p)));
    let known = all.filter(|(_, point)| point.1.is_finite());
    let Some((name, &(at, value))) = known.max_by(|a, b| a.1.1.abs().total_cmp(&b.1.1.abs()))
    else {
        return String::new();
    };
    let place = match outlines.label.split_once(" [") {
        Some((axis, unit)) => {
            format!("{axis} {} {}", typeset(&significant(at, 3)), unit.trim_end_matches(']'))
        }
        None => format!("{} {}", outlines.label, typeset(&significant(at, 3))),
    };
    let group = group_word(&findings.layouts);
    format!(" The largest is {} at {group} `{name}`, {place}.", typeset(&fixed(value, 1)))
}
