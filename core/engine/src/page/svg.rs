//! A small writer of SVG: shapes with CSS classes, which the style sheet of the page defines.
//!
//! Every element is closed where it is written, text is escaped, and a shape with a coordinate that is not finite is
//! skipped, so that the drawing is well formed for any input.

use std::fmt::Write as _;

/// Drawing of a fixed size in its own units; the page scales it.
#[derive(Debug, Clone)]
pub struct Svg {
    width: f64,
    height: f64,
    body: String,
}

/// End of a text that lies at its coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The start of the text.
    Start,
    /// The middle of the text.
    Middle,
    /// The end of the text.
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// Rectangle of the drawing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Area {
    /// A rectangle from its upper left corner and its size.
    pub fn new(x: f64, y: f64, width: f64, height: f64) -> Self {
        Self { x, y, width, height }
    }

    /// Right edge.
    pub fn right(&self) -> f64 {
        self.x + self.width
    }

    /// Lower edge.
    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }
}

impl Svg {
    /// An empty drawing.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, body: String::new() }
    }

    /// The drawing as SVG text, with a description for readers who do not see it.
    pub fn finish(self, description: &str) -> String {
        let (width, height) = (number(self.width), number(self.height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"{}\">{}</svg>",
            escape(description),
            self.body
        )
    }

    /// Adds a straight line.
    pub fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        if finite(&[from.0, from.1, to.0, to.1]) {
            let (x1, y1) = (number(from.0), number(from.1));
            let (x2, y2) = (number(to.0), number(to.1));
            self.write(&format!(
                "<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"
            ));
        }
    }

    /// Adds a rectangle with a tooltip (`hint`).
    pub fn rectangle(&mut self, class: &str, area: Area, hint: &str) {
        if finite(&[area.x, area.y, area.width, area.height]) {
            let (x, y) = (number(area.x), number(area.y));
            let (width, height) = (number(area.width.max(0.0)), number(area.height.max(0.0)));
            let open = format!(
                "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\""
            );
            self.close("rect", &open, hint);
        }
    }

    /// Adds a circle with a tooltip (`hint`).
    pub fn circle(&mut self, class: &str, centre: (f64, f64), radius: f64, hint: &str) {
        if finite(&[centre.0, centre.1, radius]) {
            let (x, y, r) = (number(centre.0), number(centre.1), number(radius));
            let open = format!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\"");
            self.close("circle", &open, hint);
        }
    }

    /// Adds a path; `name` is shown in the read-out, and is empty if the path has none.
    pub fn path(&mut self, class: &str, path: &Path, name: &str) {
        if path.data.is_empty() {
            return;
        }
        let name = match name {
            "" => String::new(),
            name => format!(" data-name=\"{}\"", escape(name)),
        };
        self.write(&format!("<path class=\"{class}\"{name} d=\"{}\"/>", path.data));
    }

    /// Adds a text.
    pub fn text(&mut self, class: &str, at: (f64, f64), anchor: Anchor, text: &str) {
        if finite(&[at.0, at.1]) {
            let (x, y, anchor, text) = (number(at.0), number(at.1), anchor.name(), escape(text));
            self.write(&format!(
                "<text class=\"{class}\" x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>"
            ));
        }
    }

    /// Adds a text that runs upwards, centred at `at`.
    pub fn upward_text(&mut self, class: &str, at: (f64, f64), text: &str) {
        if finite(&[at.0, at.1]) {
            let (x, y, text) = (number(at.0), number(at.1), escape(text));
            self.write(&format!(
                "<text class=\"{class}\" transform=\"translate({x} {y}) rotate(-90)\" \
                 text-anchor=\"middle\">{text}</text>"
            ));
        }
    }

    /// Adds the output of `draw` as a group with these attributes.
    pub fn group(&mut self, attributes: &[(&str, &str)], draw: impl FnOnce(&mut Self)) {
        self.body.push_str("<g");
        for (name, value) in attributes {
            self.write(&format!(" {name}=\"{}\"", escape(value)));
        }
        self.body.push('>');
        draw(self);
        self.body.push_str("</g>");
    }

    /// Adds the output of `draw` in the coordinates of this drawing, clipped outside `area`.
    pub fn clipped(&mut self, area: Area, draw: impl FnOnce(&mut Self)) {
        let (x, y) = (number(area.x), number(area.y));
        let (width, height) = (number(area.width), number(area.height));
        self.write(&format!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"{x} {y} {width} {height}\">"
        ));
        draw(self);
        self.body.push_str("</svg>");
    }

    fn write(&mut self, text: &str) {
        self.body.push_str(text);
    }

    fn close(&mut self, tag: &str, open: &str, hint: &str) {
        self.body.push_str(open);
        if hint.is_empty() {
            self.body.push_str("/>");
        } else {
            self.write(&format!("><title>{}</title></{tag}>", escape(hint)));
        }
    }
}

/// The `d` attribute of a path, in steps relative to the last point and rounded to a tenth. Coordinates are rounded,
/// not steps, so that rounding errors do not accumulate.
#[derive(Debug, Clone, Default)]
pub struct Path {
    data: String,
    last: (i64, i64),
    broken: bool,
}

impl Path {
    /// A path through these points, interrupted at every point that is not finite.
    pub fn through(points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut path = Self { broken: true, ..Self::default() };
        for point in points {
            path.push(point);
        }
        path
    }

    /// A closed outline: along `upper`, then back along `lower`.
    pub fn band(upper: &[(f64, f64)], lower: &[(f64, f64)]) -> Self {
        let outline = upper.iter().chain(lower.iter().rev()).copied();
        let mut path = Self::through(outline.filter(|(x, y)| x.is_finite() && y.is_finite()));
        if !path.data.is_empty() {
            path.data.push('z');
        }
        path
    }

    /// Closed outlines one after the other, such as the cells of one class.
    pub fn polygons(outlines: impl IntoIterator<Item = Vec<(f64, f64)>>) -> Self {
        let mut path = Self { broken: true, ..Self::default() };
        for outline in outlines {
            if outline.iter().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
                continue;
            }
            path.broken = true;
            for point in outline {
                path.push(point);
            }
            path.data.push('z');
        }
        path
    }

    fn push(&mut self, (x, y): (f64, f64)) {
        if !x.is_finite() || !y.is_finite() {
            self.broken = true;
            return;
        }
        let point = (tenths(x), tenths(y));
        if self.broken {
            self.data.push('M');
            self.pair(point.0, point.1);
            self.broken = false;
        } else if point != self.last {
            self.data.push('l');
            self.pair(point.0 - self.last.0, point.1 - self.last.1);
        }
        self.last = point;
    }

    fn pair(&mut self, x: i64, y: i64) {
        write_tenths(&mut self.data, x);
        if y >= 0 {
            self.data.push(' ');
        }
        write_tenths(&mut self.data, y);
    }
}

/// Limit of coordinates: a point farther away is invisible and would only make the numbers longer.
const FAR: f64 = 1e5;

fn tenths(x: f64) -> i64 {
    (x.clamp(-FAR, FAR) * 10.0).round() as i64
}

fn write_tenths(out: &mut String, tenths: i64) {
    let sign = if tenths < 0 { "-" } else { "" };
    let (whole, rest) = (tenths.abs() / 10, tenths.abs() % 10);
    // Writing to a string cannot fail.
    let _ = match (whole, rest) {
        (whole, 0) => write!(out, "{sign}{whole}"),
        (0, rest) => write!(out, "{sign}.{rest}"),
        (whole, rest) => write!(out, "{sign}{whole}.{rest}"),
    };
}

fn number(x: f64) -> String {
    let mut text = String::new();
    write_tenths(&mut text, tenths(x));
    text
}

fn finite(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite())
}

/// A text with the reserved characters of XML as entities, and without control characters.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c if c.is_control() => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_relative_and_does_not_drift() {
        let path = Path::through((0..1000).map(|i| (f64::from(i) * 0.26, 0.0)));
        let steps = path.data.split('l').skip(1).map(|step| {
            step.split(' ').next().and_then(|x| x.parse::<f64>().ok()).expect("a number")
        });
        // 999 steps of 0.26 end at 259.74, which is 259.7 in tenths.
        assert!((steps.sum::<f64>() - 259.7).abs() < 1e-6);
    }

    #[test]
    fn a_path_is_interrupted_where_there_is_no_number() {
        let path = Path::through([(0.0, 1.0), (1.0, 1.5), (f64::NAN, 0.0), (3.0, -0.5)]);
        assert_eq!(path.data, "M0 1l1 .5M3-.5");
    }

    #[test]
    fn shapes_without_a_place_are_left_out() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.circle("a", (f64::NAN, 1.0), 2.0, "");
        svg.line("a", (0.0, f64::INFINITY), (1.0, 1.0));
        svg.text("a", (1.0, f64::NEG_INFINITY), Anchor::Start, "x");
        assert!(!svg.finish("nothing").contains("class"));
    }

    #[test]
    fn text_is_escaped() {
        assert_eq!(escape("<x> & \"y's\"\u{7}"), "&lt;x&gt; &amp; &quot;y&#39;s&quot; ");
    }
}
