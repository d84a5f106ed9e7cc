//! The page of one run.

use maud::{Markup, html};

use super::list::state;
use super::live::{campaign, gap, sampling, stages};
use super::{Head, Live, ago, page};
use crate::assess::Assessment;
use crate::page::number::{count, duration, fixed, percent, significant};
use crate::page::paragraph;
use crate::page::table::Table;
use crate::report::banner;
use crate::view::address::encoded;
use crate::view::row::RunState;
use crate::view::watched::Watched;

/// The page of a run; with a link to the list if it is one of several.
pub fn run(found: &Watched, listed: bool, assessment: Option<&Assessment>) -> String {
    let row = &found.row;
    let name = encoded(&row.name);
    let title = if row.title.is_empty() { &row.name } else { &row.title };
    let below = html! {
        @if listed { a href="/" { "All runs" } " · " }
        "Run " code { (row.name) } " · study " code { (row.study) }
        " · " a href=(format!("/api/runs/{name}")) { "JSON" }
    };
    let live = Live {
        json: format!("/api/runs/{name}"),
        part: format!("/part/runs/{name}"),
        state: row.state.name(),
    };
    let head = Head { title, kicker: "run", below };
    page(&head, content(found, assessment), Some(&live))
}

/// The content of the page.
pub fn run_part(found: &Watched, assessment: Option<&Assessment>) -> String {
    content(found, assessment).into_string()
}

fn content(found: &Watched, assessment: Option<&Assessment>) -> Markup {
    let finished = found.row.state == RunState::Finished;
    html! {
        @match assessment {
            Some(assessment) if finished => (banner(assessment)),
            _ => (progress(found)),
        }
        @if finished && !found.row.parameters.is_empty() { (posterior(found)) }
        @if finished { (files(found)) }
        @if let Some(found) = &found.sampling { (sampling(found)) }
        @if let Some(found) = &found.campaign { (campaign(found)) }
        @if let Some(found) = &found.gap { (gap(found)) }
        @if finished && !found.figures.is_empty() { (gallery(found)) }
        (stages(&found.stages))
        @if !finished { (files(found)) }
    }
}

/// The state of a run with the progress of its stage.
fn progress(found: &Watched) -> Markup {
    let row = &found.row;
    let present = found.progress.as_ref();
    html! {
        div.now {
            p.what {
                (state(row.state))
                @match (&row.stage, present.and_then(|p| p.ended.last())) {
                    (Some(stage), _) => { " · " b { (stage) } }
                    (None, Some(last)) => { " · after " b { (last.stage) } }
                    (None, None) => {}
                }
            }
            @if let Some(p) = present.filter(|p| !p.stage.is_empty()) {
                @if p.total > 0 {
                    progress max=(p.total) value=(p.done.min(p.total)) aria-label=(format!("progress of {}", p.stage)) {}
                }
                @if !p.unit.is_empty() {
                    p.note {
                        (p.unit) " " (count(p.done as usize))
                        @if p.total > 0 { (if p.about { " of about " } else { " of " }) (count(p.total as usize)) }
                        @if let Some(share) = row.share { " (" (percent(share)) ")" }
                        ", begun " (ago(p.begun))
                    }
                }
            }
            @if let Some(reason) = &row.verdict { p { (paragraph(reason)) } }
            @if row.state == RunState::Stopped {
                p { code { "lacuna resume RUN" } " continues it." }
            }
        }
        @let warnings = present.map(|p| p.warnings.as_slice()).unwrap_or_default();
        @if !warnings.is_empty() {
            div.warnings { h2 { "Warnings" } ul { @for text in warnings { li { (paragraph(text)) } } } }
        }
    }
}

fn posterior(found: &Watched) -> Markup {
    let mut table = Table::new(&["parameter", "unit"], &["mean", "sd"]);
    for p in &found.row.parameters {
        let places = (1.0 - p.sd.log10().floor()).clamp(0.0, 15.0);
        let mean = if places.is_finite() && p.mean.abs() < 1e6 {
            fixed(p.mean, places as usize)
        } else {
            significant(p.mean, 6)
        };
        table.row([p.name.clone(), p.unit.clone(), mean, significant(p.sd, 2)]);
    }
    html! { section #posterior { h2 { "Posterior" } (table.html()) } }
}

fn files(found: &Watched) -> Markup {
    let report = found.files.iter().any(|file| file == "report.html");
    let finished = found.row.state == RunState::Finished;
    html! {
        section #files {
            h2 { "Files" }
            @if report {
                p.tools { a.button href="report.html" { "Open the report" } }
                @if !finished { p.note { "The report is that of the last finished run in this directory." } }
            }
            p { @for (i, file) in found.files.iter().filter(|file| *file != "report.html").enumerate() {
                @if i > 0 { " · " } a href=(file) { (file) }
            } }
            p.note { "Time of the finished stages: " (duration(found.row.seconds)) "." }
        }
    }
}

fn gallery(found: &Watched) -> Markup {
    html! {
        section #figures {
            h2 { "Figures" }
            div.gallery {
                @for name in &found.figures {
                    @let address = format!("figures/{}", encoded(name));
                    figure {
                        a href=(format!("{address}.svg")) { img src=(format!("{address}.svg")) alt=(name) loading="lazy"; }
                        figcaption { (name) " · " a href=(format!("{address}.csv")) { "CSV" } }
                    }
                }
            }
        }
    }
}
