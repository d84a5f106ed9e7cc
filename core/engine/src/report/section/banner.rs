//! The verdict, which comes first on the page and on the terminal.

use maud::{Markup, html};

use crate::assess::{Assessment, Finding, Level, Severity};
use crate::page::number::significant;
use crate::page::paragraph;

fn class(level: Level) -> &'static str {
    match level {
        Level::Trusted => "assessment trusted",
        Level::TrustedWithReservations => "assessment reserved",
        Level::NotTrusted => "assessment refused",
    }
}

/// A sign that can be read without colour.
fn sign(severity: Severity) -> &'static str {
    match severity {
        Severity::Failure => "\u{2717}",
        Severity::Reservation => "!",
        Severity::Note => "i",
    }
}

/// Level, findings and recommended actions.
pub fn banner(assessment: &Assessment) -> Markup {
    let (grave, notes): (Vec<&Finding>, Vec<&Finding>) =
        assessment.findings.iter().partition(|finding| finding.severity > Severity::Note);
    html! {
        div class=(class(assessment.level)) role="status" {
            p.level { (capital(&assessment.line())) }
            @if !grave.is_empty() { ul { @for finding in grave { (item(finding)) } } }
            @if !notes.is_empty() {
                details { summary { "Notes (" (notes.len()) ")" }
                    ul { @for finding in notes { (item(finding)) } }
                }
            }
        }
    }
}

fn item(finding: &Finding) -> Markup {
    let figure = finding.figure.map(|figure| {
        format!("{} (threshold {})", significant(figure, 3), significant(finding.threshold, 3))
    });
    html! {
        li {
            span.sign { (sign(finding.severity)) } " "
            code { (finding.code) }
            @if !finding.place.is_empty() { " " b { (finding.place) } }
            @if let Some(figure) = figure { span.figure { " " (figure) } }
            ": " (paragraph(&finding.message)) "."
            span.action { " \u{2192} " (paragraph(&finding.action)) "." }
        }
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// The verdict as lines of text: the level, then failures and reservations. Notes are only counted; the report lists
/// them.
pub fn lines(assessment: &Assessment) -> Vec<String> {
    let mut lines = vec![assessment.line()];
    for finding in assessment.findings.iter().filter(|f| f.severity > Severity::Note) {
        let mark = if finding.severity == Severity::Failure { "x" } else { "!" };
        let place =
            if finding.place.is_empty() { String::new() } else { format!(" [{}]", finding.place) };
        lines.push(format!("  {mark} {}{place}: {}", finding.code, finding.message));
        lines.push(format!("    -> {}", finding.action));
    }
    let notes = assessment.count(Severity::Note);
    if notes > 0 {
        let noun = if notes == 1 { "note" } else { "notes" };
        lines.push(format!("  ({notes} {noun} in the report)"));
    }
    lines
}
