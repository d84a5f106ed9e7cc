//! Text that fits into the columns of a terminal: sentences are broken between words, and the columns of a table that do not
//! fit follow below, beside the columns of words with which the rows begin.

use std::ops::Range;

/// Smallest number of spaces between the columns of a table.
const GUTTER: usize = 2;
/// Smallest number of columns of a table: fewer are sentences with a wide space.
const COLUMNS: usize = 3;
/// Largest number of lines before and after a table in its paragraph, such as a title.
const BESIDE: usize = 2;

/// The text with no line longer than `width` letters, where words and cells are not longer.
pub fn fitted(text: &str, width: usize) -> String {
    let lines: Vec<&str> = text.split('\n').collect();
    let paragraphs = lines.split_inclusive(|line| line.is_empty());
    paragraphs.flat_map(|lines| paragraph(lines, width)).collect::<Vec<_>>().join("\n")
}

fn paragraph(lines: &[&str], width: usize) -> Vec<String> {
    if lines.iter().all(|line| letters(line) <= width) {
        return lines.iter().map(|line| (*line).to_owned()).collect();
    }
    let broken = |lines: &[&str]| lines.iter().flat_map(|line| sentence(line, width)).collect();
    let Some((rows, columns)) = table(lines) else { return broken(lines) };
    let before: Vec<String> = broken(&lines[..rows.start]);
    let bands = bands(&lines[rows.clone()], &columns, width);
    [before, bands, broken(&lines[rows.end..])].concat()
}

/// The lines of a paragraph that are a table, and its columns; `None` if there is no table.
fn table(lines: &[&str]) -> Option<(Range<usize>, Vec<Range<usize>>)> {
    let count = lines.iter().position(|line| line.is_empty()).unwrap_or(lines.len());
    let ends = |start: usize| {
        (count.saturating_sub(BESIDE).max(start + 2)..=count).rev().map(move |end| start..end)
    };
    let parts = (0..=BESIDE.min(count)).flat_map(ends);
    let tried = parts.map(|rows| (columns(&lines[rows.clone()]), rows));
    let mut best: Option<(Range<usize>, Vec<Range<usize>>)> = None;
    for (columns, rows) in tried.filter(|(columns, _)| columns.len() >= COLUMNS) {
        if best.as_ref().is_none_or(|(_, most)| columns.len() > most.len()) {
            best = Some((rows, columns));
        }
    }
    best
}

/// Places of the columns: what stands between places that are empty in all lines.
fn columns(lines: &[&str]) -> Vec<Range<usize>> {
    let width = lines.iter().map(|line| letters(line)).max().unwrap_or(0);
    let mut used = vec![false; width];
    for line in lines {
        for (used, c) in used.iter_mut().zip(line.chars()) {
            *used |= c != ' ';
        }
    }
    let mut found: Vec<Range<usize>> = Vec::new();
    for place in (0..width).filter(|&place| used[place]) {
        match found.last_mut() {
            Some(last) if place < last.end + GUTTER => last.end = place + 1,
            _ => found.push(place..place + 1),
        }
    }
    found
}

/// Number of columns of words at the beginning of the rows, names and units, at least one: they tell what the numbers are, and take
/// no more than half of the width.
fn heads(rows: &[&str], columns: &[Range<usize>], width: usize) -> usize {
    let is_words = |column: &Range<usize>| {
        let cells: Vec<String> = rows[1..].iter().map(|row| cell(row, column)).collect();
        let at_left = cells.iter().all(|cell| !cell.starts_with(' ') || cell.trim().is_empty());
        let is_number = |cell: &String| cell.trim().parse::<f64>().is_ok();
        at_left && !cells.iter().all(is_number) && 2 * column.end <= width
    };
    let words = columns.iter().take_while(|column| is_words(column)).count();
    words.clamp(1, columns.len() - 1)
}

/// The rows of a table whose columns are distributed over as many tables as necessary.
fn bands(rows: &[&str], columns: &[Range<usize>], width: usize) -> Vec<String> {
    let (heads, rest) = columns.split_at(heads(rows, columns, width));
    let head = 0..heads.last().map_or(0, |last| last.end);
    let mut bands: Vec<Vec<&Range<usize>>> = Vec::new();
    let mut used = 0;
    for column in rest {
        let own = GUTTER + column.len();
        match bands.last_mut() {
            Some(band) if used + own <= width => {
                used += own;
                band.push(column);
            }
            _ => {
                used = head.end + own;
                bands.push(vec![column]);
            }
        }
    }
    let line = |row: &&str, band: &[&Range<usize>]| {
        let mut text = cell(row, &head);
        for column in band {
            text.push_str(&" ".repeat(GUTTER));
            text.push_str(&cell(row, column));
        }
        text.trim_end().to_owned()
    };
    let band = |band: &Vec<&Range<usize>>| rows.iter().map(|row| line(row, band)).collect();
    bands.iter().map(band).collect::<Vec<Vec<String>>>().join(&String::new())
}

/// The letters of a row at some places, filled with spaces.
fn cell(row: &str, places: &Range<usize>) -> String {
    let letters = row.chars().chain(std::iter::repeat(' '));
    letters.skip(places.start).take(places.len()).collect()
}

/// A sentence in lines; those after the first begin below its first letter after a mark such as `x` or `->`.
fn sentence(line: &str, width: usize) -> Vec<String> {
    let text = line.trim_start_matches(' ');
    let mut indent = line.len() - text.len();
    let mut words = words(text).into_iter();
    let first = text.split(' ').next().map_or(0, letters);
    if indent > 0 && first <= 2 {
        indent += first + 1;
    }
    let mut lines = Vec::new();
    let mut last = " ".repeat(line.len() - text.len()) + &words.next().unwrap_or_default();
    for word in words {
        if letters(&last) + 1 + letters(&word) <= width {
            last.push(' ');
            last.push_str(&word);
        } else {
            lines.push(std::mem::replace(&mut last, " ".repeat(indent) + &word));
        }
    }
    lines.push(last);
    lines
}

/// The words of a text; a number stays with its per cent and its error.
fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match words.last_mut() {
            Some(last) if word.starts_with(['%', '±']) || last.ends_with('±') => {
                last.push(' ');
                last.push_str(word);
            }
            _ => words.push(word.to_owned()),
        }
    }
    words
}

fn letters(text: &str) -> usize {
    text.chars().count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "\
members of populations, and a new member
parameter     unit   mean    sd  2.5 %
stiffness[A]  GPa   100.1  0.21   99.7
stiffness[B]  GPa    98.7  0.19   98.3
new member    GPa    99.6  1.30   97.1";

    #[test]
    fn what_fits_is_left_alone() {
        assert_eq!(fitted(TABLE, 80), TABLE);
        assert_eq!(fitted("a\n\nb\n", 80), "a\n\nb\n");
    }

    #[test]
    fn columns_that_do_not_fit_follow_below() {
        let expected = "\
members of populations, and a new
member
parameter     unit   mean    sd
stiffness[A]  GPa   100.1  0.21
stiffness[B]  GPa    98.7  0.19
new member    GPa    99.6  1.30

parameter     unit  2.5 %
stiffness[A]  GPa    99.7
stiffness[B]  GPa    98.3
new member    GPa    97.1";
        assert_eq!(fitted(TABLE, 36), expected);
    }

    #[test]
    fn every_cell_is_there_at_every_width() {
        let cells = |text: &str| {
            let lines = text.lines().skip_while(|line| !line.starts_with("parameter"));
            let mut all: Vec<String> = lines
                .flat_map(|line| line.split("  ").map(|cell| cell.trim().to_owned()))
                .filter(|cell| !cell.is_empty())
                .collect();
            all.sort();
            all.dedup();
            all
        };
        for width in 1..50 {
            assert_eq!(cells(&fitted(TABLE, width)), cells(TABLE), "{width}");
        }
        for width in 24..50 {
            assert!(fitted(TABLE, width).lines().all(|line| letters(line) <= width), "{width}");
        }
    }

    #[test]
    fn sentences_are_broken_between_words_below_their_first_letter() {
        let text = "  x prior_bound [μ]: the posterior lies at a bound of its prior\n    -> widen the prior of this parameter";
        let expected = "  x prior_bound [μ]: the\n    posterior lies at a\n    bound of its prior\n    -> widen the prior of\n       this parameter";
        assert_eq!(fitted(text, 25), expected);
        assert_eq!(fitted("an_unbreakable_word and more", 5), "an_unbreakable_word\nand\nmore");
        assert_eq!(fitted("sum: 29 ± 7 and 95 % of it", 9), "sum:\n29 ± 7\nand 95 %\nof it");
    }
}
