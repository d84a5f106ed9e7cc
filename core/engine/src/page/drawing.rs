//! A drawing of a figure: its SVG in the forms that screens and paper need, and the values that it shows.

/// Drawing of a figure.
#[derive(Debug, Clone)]
pub struct Drawing {
    /// Drawing in its forms.
    pub form: Form,
    /// Labels of the horizontal and of the vertical axis, with units.
    pub labels: [String; 2],
    /// Values that are drawn.
    pub values: Vec<Datum>,
}

/// Forms of a drawing.
#[derive(Debug, Clone)]
pub enum Form {
    /// One of several panels: as wide as a phone; screens and paper set as many beside each other as fit.
    Panel(String),
    /// A drawing over the full width, and a narrow form for phones. Without a narrow form, phones scroll it sideways.
    Wide(String, Option<String>),
}

/// Value that is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Datum {
    /// Title of the panel.
    pub panel: String,
    /// Name of the curve, bar or row.
    pub series: String,
    /// Place on the horizontal axis.
    pub x: Place,
    /// Value; NaN if only an interval is drawn.
    pub y: f64,
    /// Interval that is drawn, if there is one.
    pub interval: Option<(f64, f64)>,
}

/// Place on the horizontal axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// A number, in the unit of the axis.
    At(f64),
    /// A name, such as that of a sensor.
    Name(String),
}

impl Datum {
    /// A point of a curve.
    pub fn point(panel: &str, series: &str, (x, y): (f64, f64)) -> Self {
        Self { panel: panel.into(), series: series.into(), x: Place::At(x), y, interval: None }
    }

    /// A value with a name.
    pub fn named(panel: &str, series: &str, name: &str, y: f64) -> Self {
        let x = Place::Name(name.into());
        Self { panel: panel.into(), series: series.into(), x, y, interval: None }
    }
}

impl Drawing {
    /// One of several panels.
    pub fn panel(svg: String, labels: [&str; 2], values: Vec<Datum>) -> Self {
        Self { form: Form::Panel(svg), labels: labels.map(str::to_owned), values }
    }

    /// A drawing in two widths, made by `draw`.
    pub fn wide(draw: impl Fn(f64) -> String, labels: [&str; 2], values: Vec<Datum>) -> Self {
        let form = Form::Wide(draw(super::chart::WIDTH), Some(draw(super::chart::PANEL)));
        Self { form, labels: labels.map(str::to_owned), values }
    }

    /// A drawing in one width, which phones scroll sideways.
    pub fn scrolled(svg: String, labels: [&str; 2], values: Vec<Datum>) -> Self {
        let form = Form::Wide(svg, None);
        Self { form, labels: labels.map(str::to_owned), values }
    }

    /// The drawing as it is set on paper and in files.
    pub fn svg(&self) -> &str {
        match &self.form {
            Form::Panel(svg) | Form::Wide(svg, _) => svg,
        }
    }
}
