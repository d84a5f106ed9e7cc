//! The page: numbered figures and tables in sections, one file without anything from the network.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::{Key, Swatch};
use super::findings::Findings;
use super::section;
use super::table::Table;

/// A chapter of the page.
pub struct Section {
    /// Its anchor.
    pub id: &'static str,
    /// Its title.
    pub title: &'static str,
    /// What it holds.
    pub content: Markup,
}

/// What a caption must tell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Caption {
    /// What is shown.
    pub shows: String,
    /// Whose distribution it is: prior, posterior, posterior predictive, replicates, sampling error.
    pub whose: String,
    /// What to look for.
    pub look: String,
}

impl Caption {
    /// A caption from its three parts.
    pub fn new(
        shows: impl Into<String>,
        whose: impl Into<String>,
        look: impl Into<String>,
    ) -> Self {
        Self { shows: shows.into(), whose: whose.into(), look: look.into() }
    }

    fn html(&self) -> Markup {
        html! {
            (paragraph(&self.shows))
            @if !self.whose.is_empty() { " " b { "Whose distribution: " } (self.whose) }
            @if !self.look.is_empty() { " " b { "Look for: " } (paragraph(&self.look)) }
        }
    }
}

/// The counters of figures and tables.
#[derive(Debug, Default)]
pub struct Numbers {
    figures: usize,
    tables: usize,
}

impl Numbers {
    /// A numbered figure: its legend, its drawings below each other, its caption.
    pub fn figure(&mut self, drawings: &[String], keys: &[Key], caption: &Caption) -> Markup {
        self.figures += 1;
        let number = self.figures;
        html! {
            figure id=(format!("figure-{number}")) {
                @if !keys.is_empty() { div.legend { @for key in keys { (legend_key(key)) } } }
                @for drawing in drawings { div.scroll { (PreEscaped(drawing)) } }
                figcaption { b { "Figure " (number) ". " } (caption.html()) }
            }
        }
    }

    /// A numbered table under its caption.
    pub fn table(&mut self, table: &Table, caption: &Caption) -> Markup {
        self.tables += 1;
        let number = self.tables;
        html! {
            figure.table id=(format!("table-{number}")) {
                figcaption { b { "Table " (number) ". " } (caption.html()) }
                (table.html())
            }
        }
    }
}

fn legend_key(key: &Key) -> Markup {
    let class = key.class;
    let width = if key.swatch == Swatch::Dot { 12 } else { 30 };
    let shape = match key.swatch {
        Swatch::Line => format!("<path class=\"line {class}\" d=\"M1 7l28 0\"/>"),
        Swatch::Area => {
            format!("<rect class=\"{class}\" x=\"1\" y=\"2\" width=\"28\" height=\"10\"/>")
        }
        Swatch::Dot => format!("<path class=\"{class} large\" d=\"M6 7l.1 0\"/>"),
    };
    html! {
        span.key data-class=(class) {
            (PreEscaped(format!(
                "<svg width=\"{width}\" height=\"14\" aria-hidden=\"true\">{shape}</svg>"
            )))
            (key.label)
        }
    }
}

/// How everything looks.
pub const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The whole report as one HTML file.
pub fn render(findings: &Findings) -> String {
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
                style { (PreEscaped(STYLE)) }
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
    page.into_string()
}

/// A text in which words between backticks are set as code.
pub fn paragraph(text: &str) -> Markup {
    html! {
        @for (i, part) in text.split('`').enumerate() {
            @if i % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}
