//! The list of runs.

use std::path::Path;

use maud::{Markup, html};

use super::{Head, Live, ago, page};
use crate::page::number::{duration, percent, significant, typeset};
use crate::view::address::encoded;
use crate::view::row::{Estimate, RunRow, RunState};

/// Largest number of parameters that are shown of each run.
const MOST: usize = 4;

/// The page of all runs in a folder.
pub fn list(folder: &Path, rows: &[RunRow]) -> String {
    let name = folder.file_name().map_or("/".into(), |name| name.to_string_lossy());
    let below = html! { "Folder " code { (folder.display()) } " · " a href="/api/runs" { "JSON" } };
    let head = Head { title: &format!("Runs in {name}"), kicker: "runs", below };
    let live = Live { json: "/api/runs".into(), part: "/part/runs".into(), state: "" };
    page(&head, list_of(rows), Some(&live))
}

/// The content of the page.
pub fn list_part(rows: &[RunRow]) -> String {
    list_of(rows).into_string()
}

fn list_of(rows: &[RunRow]) -> Markup {
    if rows.is_empty() {
        return html! {
            p { "There are no runs here yet: " code { "lacuna run STUDY" } " makes one in the folder " code { "runs" } "." }
        };
    }
    let finished = rows.iter().filter(|row| row.state == RunState::Finished).count();
    html! {
        form action="/compare" method="get" {
            div.scroll role="group" tabindex="0" aria-label="table of runs" { table.runs {
                thead { tr {
                    th.word { "run" } th.word { "state" } th.word { "result" } th.word { "parameters" }
                    th.number { "time" } th.number { "changed" }
                } }
                tbody { @for row in rows { (one(row, finished > 1)) } }
            } }
            @if finished > 1 {
                p.tools { button type="submit" { "Compare the chosen runs" } }
            }
        }
    }
}

fn one(row: &RunRow, choice: bool) -> Markup {
    let address = format!("/runs/{}/", encoded(&row.name));
    html! {
        tr {
            td.word {
                @if choice && row.state == RunState::Finished {
                    input type="checkbox" name="run" value=(row.name) aria-label=(format!("compare {}", row.name));
                    " "
                }
                a href=(address) { (row.name) }
                @if !row.title.is_empty() { div.about { (row.title) } }
            }
            td.word { (state(row.state)) }
            td.word { (result(row)) }
            td.word { @for found in row.parameters.iter().take(MOST) { div { (estimate(found)) } }
                @if row.parameters.len() > MOST { div.about { "and " (row.parameters.len() - MOST) " more" } }
            }
            td.number { (duration(row.seconds)) }
            td.number { (ago(row.changed)) }
        }
    }
}

/// The state of a run, with a sign that can be read without colour.
pub fn state(state: RunState) -> Markup {
    let sign = match state {
        RunState::Running => "\u{25b6}",
        RunState::Finished => "\u{2713}",
        RunState::Stopped => "\u{25a0}",
    };
    html! { span class=(format!("state {}", state.name())) { (sign) " " (state.name()) } }
}

/// The verdict of a finished run, the stage of any other.
fn result(row: &RunRow) -> Markup {
    let share = row.share.map(|share| format!(", {}", percent(share))).unwrap_or_default();
    html! {
        @if let Some(stage) = &row.stage { div { (stage) (share) } }
        @if let Some(verdict) = &row.verdict {
            div.about[row.stage.is_some()] { (verdict.lines().next().unwrap_or_default()) }
        }
    }
}

fn estimate(found: &Estimate) -> String {
    let Estimate { name, unit, mean, sd } = found;
    let digits = (mean.abs() / sd).log10().floor().clamp(0.0, 12.0) as usize + 2;
    let [mean, sd] = [significant(*mean, digits), significant(*sd, 2)].map(|text| typeset(&text));
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    format!("{name} {mean} ± {sd}{unit}")
}
