//! Elements of a page, whatever it reports: numbered figures and tables in sections, SVG charts, formatted numbers and
//! units. This module depends neither on a study nor on its results.

pub mod chart;
pub mod curve;
pub mod curves;
pub mod drawing;
mod figure;
mod file;
pub mod number;
pub mod scale;
pub mod svg;
pub mod table;
pub mod table_of_values;

use maud::{Markup, html};

use self::file::{DRAWING, PALETTE};

pub use self::figure::{FigureFile, Numbers, drawn, legend};

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

/// Style sheets of all pages.
pub fn style() -> String {
    [PALETTE, include_str!("page.css"), DRAWING].concat()
}

/// Script of a page: it lets the reader explore the figures, which say everything without it too.
pub const SCRIPT: &str = concat!(
    "(() => {\n",
    include_str!("plot.js"),
    include_str!("explore.js"),
    include_str!("files.js"),
    include_str!("draws.js"),
    include_str!("figure.js"),
    "})();"
);

/// A paragraph in which words between backticks are set as code.
pub fn paragraph(text: &str) -> Markup {
    html! {
        @for (i, part) in text.split('`').enumerate() {
            @if i % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}
