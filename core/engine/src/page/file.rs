//! A figure as one SVG file of its own: legend above, drawings below, style inside.

use super::chart::{Key, Swatch};
use super::drawing::{Drawing, Form};
use super::svg::escape;

/// Colours of pages and drawings.
pub const PALETTE: &str = include_str!("palette.css");
/// Style sheet of drawings.
pub const DRAWING: &str = include_str!("drawing.css");

/// Width of a file without a wider drawing, that of three panels.
const WIDTH: f64 = 1044.0;
const GAP: f64 = 12.0;
const MARGIN: f64 = 10.0;
/// Height of a line of the legend, and approximate width of a letter there.
const LINE: f64 = 20.0;
const LETTER: f64 = 6.8;

/// The drawings of a figure in one file.
pub fn composed(drawings: &[Drawing], keys: &[Key], title: &str) -> String {
    let mut body = String::new();
    let whole = drawings.iter().map(|drawing| size(drawing.svg()).0).fold(WIDTH, f64::max);
    let (mut x, mut y) = (0.0, 0.0);
    for key in keys {
        let width = 44.0 + LETTER * key.label.chars().count() as f64;
        if x > 0.0 && x + width > whole {
            (x, y) = (0.0, y + LINE);
        }
        body.push_str(&format!(
            "<g transform=\"translate({x} {y})\">{}<text x=\"36\" y=\"12\">{}</text></g>",
            swatch(key),
            escape(&key.label)
        ));
        x += width + 16.0;
    }
    if !keys.is_empty() {
        (x, y) = (0.0, y + LINE + 8.0);
    }
    let mut row = 0.0_f64;
    for drawing in drawings {
        let (width, height) = size(drawing.svg());
        let alone = matches!(drawing.form, Form::Wide(..));
        if x > 0.0 && (alone || x + width > whole) {
            (x, y, row) = (0.0, y + row + GAP, 0.0);
        }
        let inner = drawing.svg().replacen("<svg ", &format!("<svg x=\"{x}\" y=\"{y}\" "), 1);
        body.push_str(&inner.replacen(" role=\"img\"", "", 1));
        row = row.max(height);
        x += width + GAP;
    }
    let (width, height) = (whole + 2.0 * MARGIN, y + row + 2.0 * MARGIN);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-{MARGIN} -{MARGIN} {width} {height}\" width=\"{width}\" \
         height=\"{height}\" role=\"img\"><title>{}</title><style>{}</style>\
         <rect class=\"paper\" x=\"-{MARGIN}\" y=\"-{MARGIN}\" width=\"{width}\" height=\"{height}\"/>{body}</svg>\n",
        escape(title),
        light()
    )
}

/// Example of the shapes of a legend entry.
pub fn swatch(key: &Key) -> String {
    let class = key.class;
    match key.swatch {
        Swatch::Line => format!("<path class=\"swatch line {class}\" d=\"M1 7l28 0\"/>"),
        Swatch::Area => {
            format!("<rect class=\"swatch {class}\" x=\"1\" y=\"2\" width=\"28\" height=\"10\"/>")
        }
        Swatch::Dot => format!("<path class=\"swatch {class} large\" d=\"M6 7l.1 0\"/>"),
    }
}

/// Width and height of a drawing, as its first attributes state them.
fn size(svg: &str) -> (f64, f64) {
    let value = |name: &str| {
        let (_, rest) = svg.split_once(&format!(" {name}=\""))?;
        rest.split_once('"')?.0.parse::<f64>().ok()
    };
    (value("width").unwrap_or(0.0), value("height").unwrap_or(0.0))
}

/// The style sheet of drawings with the light colours instead of variables, which few programs but browsers know.
fn light() -> String {
    let mut style = DRAWING.to_owned();
    for line in PALETTE.lines() {
        let Some((name, value)) = line.trim().split_once(": light-dark(") else { continue };
        let light = value.split_once(", ").map_or(value, |(light, _)| light);
        style = style.replace(&format!("var({name})"), light);
    }
    style.replace(
        "var(--sans)",
        "\"Segoe UI\", \"Helvetica Neue\", Helvetica, Arial, \"Liberation Sans\", sans-serif",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_style_of_a_file_has_no_variables() {
        assert!(!light().contains("var(") && light().contains("#1c2733"), "{}", light());
    }

    #[test]
    fn panels_stand_three_in_a_row() {
        let svg = "<svg xmlns=\"x\" viewBox=\"0 0 340 100\" width=\"340\" height=\"100\"></svg>";
        let panel = || Drawing::panel(svg.into(), ["", ""], Vec::new());
        let drawings = [panel(), panel(), panel(), panel()];
        let file = composed(&drawings, &[], "a < b");
        for place in
            ["x=\"0\" y=\"0\"", "x=\"704\" y=\"0\"", "x=\"0\" y=\"112\"", "<title>a &lt; b</title>"]
        {
            assert!(file.contains(place), "no {place} in {file}");
        }
    }

    #[test]
    fn a_file_is_as_wide_as_its_widest_drawing() {
        let svg = "<svg xmlns=\"x\" viewBox=\"0 0 1500 100\" width=\"1500\" height=\"100\"></svg>";
        let file = composed(&[Drawing::scrolled(svg.into(), ["", ""], Vec::new())], &[], "wide");
        assert!(file.contains("width=\"1520\" height=\"120\" role"), "{file}");
    }
}
