//! The page: all sections in one file that loads nothing from the network.

use maud::{DOCTYPE, PreEscaped, html};

use super::findings::Findings;
use super::section;
use crate::page::{FigureFile, Numbers, SCRIPT, style};

/// The whole report as one HTML file.
pub fn render(findings: &Findings) -> String {
    page(findings).0
}

/// The whole report as one HTML file, and its figures as files.
pub fn page(findings: &Findings) -> (String, Vec<FigureFile>) {
    let mut numbers = Numbers::default();
    let sections = section::all(findings, &mut numbers);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content=(format!("Lacuna {}", findings.version));
                title { (findings.title) }
                style { (PreEscaped(style())) }
            }
            body {
                header {
                    p.kicker { "Lacuna " (findings.version) " · calibration report" }
                    h1 { (findings.title) }
                    p.study { "Study " code { (findings.study) } " · seed " code { (findings.seed) } }
                }
                nav { h2 { "Contents" } ol {
                    @for section in &sections {
                        li { a href=(format!("#{}", section.id)) { (section.title) } }
                    }
                } }
                main {
                    (section::headline::headline(findings))
                    @for section in &sections {
                        section id=(section.id) { h2 { (section.title) } (section.content) }
                    }
                }
                footer {
                    "Made by Lacuna " (findings.version) " from study " code { (findings.study) }
                    ", seed " code { (findings.seed) } "."
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    (page.into_string(), numbers.files())
}
