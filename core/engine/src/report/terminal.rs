//! The summary that a terminal shows at the end of a run.

use lacuna::run::Stop;

use super::findings::Findings;
use super::section::{
    accuracy_table, banner, bounds_table, evidence, field_table, group_word, headline,
    population_table, posterior_table, quantity_table, reliability_table, screening, share_table,
    view, without_table,
};
use crate::gap::next::Wanted;
use crate::gap::report;

/// Result of a run in plain text: the verdict in the first line, its findings, warnings, main results, posterior,
/// accuracy.
pub fn summary_text(findings: &Findings) -> String {
    let mut parts = vec![banner::lines(&findings.assessment).join("\n") + "\n"];
    if !findings.warnings.is_empty() {
        let lines: Vec<String> =
            findings.warnings.iter().map(|warning| format!("warning: {warning}")).collect();
        parts.push(lines.join("\n") + "\n");
    }
    parts.push(headline::sentences(findings).join("\n") + "\n");
    if let Some(sentence) = findings.ensemble.as_ref().and_then(screening::sentence) {
        parts.push(sentence + "\n");
    }
    if let Some(calibration) = &findings.calibration {
        parts.push(posterior_table(calibration).text());
        if !calibration.populations.is_empty() {
            let table = population_table(calibration).text();
            parts.push(format!("members of populations, and a new member\n{table}"));
        }
        let evidence = evidence::sentences(findings, calibration);
        if !evidence.is_empty() {
            parts.push(evidence.join("\n") + "\n");
        }
    }
    if !findings.fields.is_empty() {
        parts.push(format!("random fields\n{}", field_table(&findings.fields).text()));
    }
    if let Some(validation) =
        findings.validation.as_ref().filter(|v| v.cases.iter().any(|c| !c.accuracy.is_empty()))
    {
        let title = "points inside the replicates' 95 % interval";
        parts.push(format!(
            "{title}\n{}",
            accuracy_table(group_word(&findings.layouts), &validation.cases).text()
        ));
    }
    if !findings.reliability.is_empty() {
        let table = reliability_table(&findings.reliability).text();
        parts.push(format!("probabilities of rare events\n{table}"));
    }
    if !findings.quantities.is_empty() {
        let table = quantity_table(&findings.quantities).text();
        let bounded = findings.quantities.iter().any(|found| found.bounds.is_some());
        let place = if bounded { " at the middle of the intervals" } else { "" };
        parts.push(format!("predicted quantities{place}\n{table}"));
        if let Some(table) = without_table(&findings.quantities) {
            parts.push(format!("their standard deviation without one source\n{}", table.text()));
        }
        if let Some(table) = share_table(&findings.quantities) {
            parts.push(format!("shares of the inputs in their variance\n{}", table.text()));
        }
        if let Some(table) = bounds_table(findings) {
            parts.push(format!("bounds over the intervals\n{}", table.text()));
        }
    }
    parts.join("\n")
}

/// Verdict of the gap search and its reasons, one sentence per line; empty without a gap search.
pub fn gap_text(findings: &Findings) -> String {
    findings.gap.as_ref().map_or_else(String::new, |gap| report::text(&view(findings), gap))
}

/// Information that further data are expected to give, as a table ranked by what is wanted, or by the name, if there is a
/// choice; `None` if it could not be computed.
pub fn next_text(findings: &Findings, by: Option<Wanted>) -> Option<Result<String, Stop>> {
    let next = findings.gap.as_ref()?.result.insight.next.clone()?;
    let by = by.unwrap_or(next.ranked_by);
    Some(if next.has(by) { Ok(report::next::text(&next.ranked(by))) } else { Err(nothing_on(by)) })
}

/// Why options cannot be ranked.
fn nothing_on(wanted: Wanted) -> Stop {
    match wanted {
        Wanted::Quantity => {
            Stop::new("the study states no quantity that the next data should tell")
                .help("state it: `[gap.quantity]`")
        }
        _ => Stop::new("there is no choice of a name that further data could decide")
            .help("leave `--by name` out: the options are then ranked by the parameters"),
    }
}
