//! The comparison of several runs.

use maud::{Markup, html};

use super::{Head, page};
use crate::compare::{Comparison, names, tables};
use crate::page::paragraph;
use crate::view::address::encoded;

/// The page of a comparison.
pub fn comparison(found: &Comparison) -> String {
    let query: Vec<String> =
        found.runs.iter().map(|run| format!("run={}", encoded(&run.directory))).collect();
    let below = html! {
        a href="/" { "All runs" } " · " a href=(format!("/api/compare?{}", query.join("&"))) { "JSON" }
    };
    let head =
        Head { title: &format!("{} runs compared", found.runs.len()), kicker: "comparison", below };
    page(&head, content(found), None)
}

fn content(found: &Comparison) -> Markup {
    html! {
        ul.columns {
            @for (name, run) in names(found).iter().zip(&found.runs) {
                li {
                    b { (name) } " " a href=(format!("/runs/{}/", encoded(&run.directory))) { (run.directory) }
                    @if !run.title.is_empty() { ": " (run.title) }
                    @if !run.converged { " " b { "(not converged)" } }
                }
            }
        }
        @if !found.notes.is_empty() {
            div.warnings { h2 { "Notes" } ul { @for note in &found.notes { li { (paragraph(note)) } } } }
        }
        @for (title, table) in tables(found) {
            section { h2 { (capital(title)) } (table.html()) }
        }
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}
