//! Pages: the list of runs, one run, a comparison.

mod comparison;
mod list;
mod live;
mod run;

use std::time::{SystemTime, UNIX_EPOCH};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::page::style;

pub(super) use comparison::comparison;
pub(super) use list::{list, list_part};
pub(super) use run::{run, run_part};

/// Addresses that a page asks again and again, and the state at which it was made.
struct Live<'a> {
    /// JSON of which each change makes the page ask for its new content.
    json: String,
    /// New content.
    part: String,
    /// State of the run; the page is loaded again when it changes. Empty for a page that has none.
    state: &'a str,
}

/// Head of a page.
struct Head<'a> {
    title: &'a str,
    /// Line above the title.
    kicker: &'a str,
    /// Line below the title.
    below: Markup,
}

/// A whole page.
fn page(head: &Head<'_>, content: Markup, live: Option<&Live<'_>>) -> String {
    let version = env!("CARGO_PKG_VERSION");
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content=(format!("Lacuna {version}"));
                link rel="icon" href="data:,";
                title { (head.title) " · Lacuna" }
                style { (PreEscaped(style())) (PreEscaped(include_str!("view.css"))) }
            }
            body {
                header {
                    p.kicker { "Lacuna " (version) " · " (head.kicker) }
                    h1 { (head.title) }
                    p.study { (head.below) }
                }
                @if let Some(live) = live {
                    p #unanswered role="status" {}
                    main data-live=(live.json) data-part=(live.part) data-state=(live.state) { (content) }
                    script { (PreEscaped(include_str!("live.js"))) }
                } @else {
                    main { (content) }
                }
            }
        }
    }
    .into_string()
}

/// Time that has passed since a moment, in seconds since 1970 (UTC).
fn ago(moment: u64) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |elapsed| elapsed.as_secs());
    match now.saturating_sub(moment) {
        _ if moment == 0 => "–".to_owned(),
        0..=4 => "now".to_owned(),
        s @ 5..120 => format!("{s} s ago"),
        s @ 120..7200 => format!("{} min ago", s / 60),
        s @ 7200..172_800 => format!("{} h ago", s / 3600),
        s => format!("{} days ago", s / 86_400),
    }
}

/// A list of terms with their values.
fn facts(facts: &[(&str, String)]) -> Markup {
    html! { dl { @for (name, value) in facts { div { dt { (name) } dd { (value) } } } } }
}
