//! Result tables, with one form for the page and the terminal.

use maud::{Markup, html};

use super::number::typeset;
use super::paragraph;

/// Alignment of the cells of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Left, for words.
    Left,
    /// Right, for numbers.
    Right,
}

/// Table of short texts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    heads: Vec<(String, Side)>,
    rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Row {
    cells: Vec<String>,
    emphasis: bool,
}

impl Table {
    /// An empty table with these columns: those of `words` first, then those of `numbers`.
    pub fn new(words: &[&str], numbers: &[&str]) -> Self {
        let left = words.iter().map(|head| ((*head).to_owned(), Side::Left));
        let right = numbers.iter().map(|head| ((*head).to_owned(), Side::Right));
        Self { heads: left.chain(right).collect(), rows: Vec::new() }
    }

    /// Appends a row; missing cells are empty, and surplus cells are dropped.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.push(cells.into_iter().collect(), false);
    }

    /// Appends a highlighted row, such as a total.
    pub fn emphasised(&mut self, cells: impl IntoIterator<Item = String>) {
        self.push(cells.into_iter().collect(), true);
    }

    fn push(&mut self, mut cells: Vec<String>, emphasis: bool) {
        cells.resize(self.heads.len(), String::new());
        self.rows.push(Row { cells, emphasis });
    }

    /// Returns true if the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The table as HTML.
    pub fn html(&self) -> Markup {
        html! {
            div.scroll role="group" tabindex="0" aria-label="table" { table {
                thead { tr {
                    @for (head, side) in &self.heads { th.(class(*side)) { (head) } }
                } }
                tbody {
                    @for row in &self.rows {
                        tr.emphasis[row.emphasis] {
                            @for (cell, (_, side)) in row.cells.iter().zip(&self.heads) {
                                td.(class(*side)) {
                                @match side {
                                    Side::Left => (paragraph(cell)),
                                    Side::Right => (typeset(cell)),
                                }
                            }
                            }
                        }
                    }
                }
            } }
        }
    }

    /// The table as plain text: aligned columns, two spaces between them.
    pub fn text(&self) -> String {
        let width = |column: usize| {
            let cells = self.rows.iter().map(|row| letters(&row.cells[column]));
            cells.chain([letters(&self.heads[column].0)]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.heads.len()).map(width).collect();
        let line = |cells: &mut dyn Iterator<Item = &String>| {
            let cells: Vec<String> = cells
                .zip(&self.heads)
                .zip(&widths)
                .map(|((cell, (_, side)), width)| aligned(cell, *side, *width))
                .collect();
            format!("{}\n", cells.join("  ").trim_end())
        };
        let mut text = line(&mut self.heads.iter().map(|(head, _)| head));
        for row in &self.rows {
            text.push_str(&line(&mut row.cells.iter()));
        }
        text
    }
}

fn class(side: Side) -> &'static str {
    match side {
        Side::Left => "word",
        Side::Right => "number",
    }
}

fn letters(text: &str) -> usize {
    text.chars().count()
}

fn aligned(text: &str, side: Side, width: usize) -> String {
    let space = " ".repeat(width.saturating_sub(letters(text)));
    match side {
        Side::Left => format!("{text}{space}"),
        Side::Right => format!("{space}{text}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_is_aligned_by_letters_not_bytes() {
        let mut table = Table::new(&["name"], &["µ", "sd"]);
        table.row(["density".into(), "-1.5".into(), "0.25".into()]);
        table.row(["é".into(), "12111".into()]);
        assert_eq!(table.text(), "name         µ    sd\ndensity   -1.5  0.25\né        12111\n");
    }

    #[test]
    fn html_escapes_what_people_wrote() {
        let mut table = Table::new(&["name"], &[]);
        table.row(["<b> & \"c\"".into()]);
        assert!(table.html().into_string().contains("&lt;b&gt; &amp; &quot;c&quot;"));
    }
}
