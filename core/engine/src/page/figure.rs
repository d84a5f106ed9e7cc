//! Numbered figures and tables, and the files beside a page that show the same figures.

use maud::{Markup, PreEscaped, html};

use super::Caption;
use super::chart::{Key, Swatch};
use super::drawing::{Drawing, Form};
use super::file::{composed, swatch};
use super::table::Table;
use super::table_of_values::{csv, packed};

/// Counters of figures and tables, and the files of the figures.
#[derive(Debug, Default)]
pub struct Numbers {
    tables: usize,
    files: Vec<FigureFile>,
}

/// A figure as files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FigureFile {
    /// Name of the files, without extension.
    pub name: String,
    /// The figure as SVG, with its legend, in light colours.
    pub svg: String,
    /// The drawn values as CSV.
    pub csv: String,
}

impl Numbers {
    /// A numbered figure: legend, drawings, caption. Its files are called `name`; if another figure has that name, a
    /// number follows.
    pub fn figure(
        &mut self,
        name: &str,
        drawings: &[Drawing],
        keys: &[Key],
        caption: &Caption,
    ) -> Markup {
        let name = self.free(name);
        let table = csv(drawings);
        let number = self.files.len() + 1;
        let markup = html! {
            figure.drawn id=(format!("figure-{number}")) data-name=(name) {
                (legend(keys))
                (drawn(drawings))
                script type="text/plain" class="values" { (PreEscaped(packed(&table))) }
                figcaption { b { "Figure " (number) ". " } (caption.html()) }
            }
        };
        let svg = composed(drawings, keys, &format!("Figure {number}. {}", caption.shows));
        self.files.push(FigureFile { name, svg, csv: table });
        markup
    }

    fn free(&self, name: &str) -> String {
        let taken = |name: &str| self.files.iter().any(|file| file.name == name);
        let numbered = (2..).map(|i| format!("{name}-{i}"));
        let mut names = std::iter::once(name.to_owned()).chain(numbered);
        names.find(|name| !taken(name)).unwrap_or_default()
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

    /// The figures as files.
    pub fn files(self) -> Vec<FigureFile> {
        self.files
    }
}

/// Drawings beside each other, as many as fit.
pub fn drawn(drawings: &[Drawing]) -> Markup {
    html! { div.drawings { @for drawing in drawings { (forms(drawing)) } } }
}

/// Legend of a figure.
pub fn legend(keys: &[Key]) -> Markup {
    html! { @if !keys.is_empty() { div.legend { @for key in keys { (legend_key(key)) } } } }
}

fn forms(drawing: &Drawing) -> Markup {
    html! {
        @match &drawing.form {
            Form::Panel(svg) => div.panel { (PreEscaped(svg)) },
            Form::Wide(svg, Some(narrow)) => {
                div.wide { (PreEscaped(svg)) }
                div.narrow { (PreEscaped(narrow)) }
            }
            Form::Wide(svg, None) => {
                div.scroll.matrix role="group" tabindex="0" aria-label="figure, scrolls sideways" { (PreEscaped(svg)) }
            }
        }
    }
}

fn legend_key(key: &Key) -> Markup {
    let width = if key.swatch == Swatch::Dot { 12 } else { 30 };
    html! {
        span.key data-class=(key.class) data-swatch=(key.swatch.name()) {
            (PreEscaped(format!(
                "<svg width=\"{width}\" height=\"14\" aria-hidden=\"true\">{}</svg>", swatch(key)
            )))
            (key.label)
        }
    }
}
