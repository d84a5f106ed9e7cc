//! Elements of a page, whatever it reports: numbered figures and tables in sections, SVG charts, formatted numbers and
//! units. This module depends neither on a study nor on its results.

pub mod chart;
pub mod curve;
pub mod curves;
pub mod number;
pub mod scale;
pub mod svg;
pub mod table;

use maud::{Markup, PreEscaped, html};

use self::chart::{Key, Swatch};
use self::table::Table;

/// Section of the page.
pub struct Section {
    /// HTML id of the section.
    pub id: &'static str,
    /// Title of the section.
    pub title: &'static str,
    /// Content of the section.
    pub content: Markup,
}

/// Parts of a caption.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Caption {
    /// Quantity that is shown.
    pub shows: String,
    /// Distribution that is shown: prior, posterior, posterior predictive, replicates, or sampling error.
    pub whose: String,
    /// Hint for the reader on what to look for.
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

/// Counters of figures and tables.
#[derive(Debug, Default)]
pub struct Numbers {
    figures: usize,
    tables: usize,
}

impl Numbers {
    /// A numbered figure: legend, drawings below each other, caption.
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

    /// A numbered table below its caption.
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

/// Style sheet of all pages.
pub const STYLE: &str = include_str!("page.css");
/// Script of a page: it shows and hides the shapes that a legend entry names.
pub const SCRIPT: &str = include_str!("page.js");

/// A paragraph in which words between backticks are set as code.
pub fn paragraph(text: &str) -> Markup {
    html! {
        @for (i, part) in text.split('`').enumerate() {
            @if i % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}
