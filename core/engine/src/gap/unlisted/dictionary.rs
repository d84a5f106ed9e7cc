//! Candidate terms of a symbolic form: functions of the response, its derivatives along the last axis, and the place on
//! that axis.

use lacuna::plugin::effect::On;
use lacuna_linalg::Matrix;

use crate::gap::candidates::place;
use crate::gap::experiment::Experiment;

/// Largest number of values of all terms together, which bounds the memory of the dictionary.
const NUMBERS: usize = 12_000_000;

/// Number of decay lengths that are tried, from 1/64 of the axis to the whole axis.
const DECAYS: i32 = 7;

/// Widths of the bumps that are tried, as the number of widths per axis.
const BUMPS: [u32; 3] = [6, 12, 24];

/// A place on a curve with the response and its derivatives.
struct Point {
    t: f64,
    y: f64,
    dy: f64,
    ddy: f64,
}

/// A function of a point, with its text in the language of expressions.
struct Function {
    text: String,
    value: Box<dyn Fn(&Point) -> f64>,
}

/// Sensors on which a term acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sharing {
    /// On all sensors, with the same coefficients.
    All,
    /// On all sensors, each with its own coefficients.
    Each,
    /// On one sensor.
    One(usize),
}

/// One term: one function, or two that form a pair such as sine and cosine.
pub(super) struct DictionaryTerm {
    /// Names of its functions.
    pub parts: Vec<String>,
    /// True if the language of expressions has all its functions.
    pub expressible: bool,
    /// Sensors on which it acts.
    pub spread: Sharing,
    /// The rows: the functions in their order, on each sensor in turn.
    pub rows: Vec<usize>,
}

/// All terms on some sensors.
pub(super) struct Dictionary {
    pub candidates: Vec<DictionaryTerm>,
    /// The values at every output, one row per function and sensor, or per function on all sensors.
    pub rows: Matrix,
}

impl Dictionary {
    /// The terms on these sensors around a response; `None` if no curve has an axis of at least four places.
    pub fn new(experiment: &Experiment<'_>, response: &[f64], sensors: &[On]) -> Option<Self> {
        let mut points: Vec<(usize, usize, Point)> = Vec::new();
        let (mut first, mut last, mut length) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        for curve in &experiment.curves {
            let Some(sensor) = sensors.iter().position(|on| *on == place(curve)) else { continue };
            let (layout, _) = experiment.layouts.block(curve.outputs.start);
            let Some((_, at, _)) = layout.abscissa() else { continue };
            if at.len() != curve.outputs.len() || at.len() < 4 || curve.measured.is_empty() {
                continue;
            }
            (first, last) = (first.min(at[0]), last.max(at[at.len() - 1]));
            length = length.max(at.len());
            let y = &response[curve.outputs.clone()];
            let dy = slope(y, at);
            let ddy = slope(&dy, at);
            for (k, i) in curve.outputs.clone().enumerate() {
                points.push((sensor, i, Point { t: at[k], y: y[k], dy: dy[k], ddy: ddy[k] }));
            }
        }
        if length == 0 || last <= first {
            return None;
        }
        let each = 1 + if sensors.len() > 1 { sensors.len() } else { 0 };
        let affordable = (NUMBERS / experiment.outputs() / each).saturating_sub(130) / 2;
        let terms = terms(first, last, length.min(affordable));
        let mut all = Self { candidates: Vec::new(), rows: Matrix::zeros(0, experiment.outputs()) };
        for parts in terms {
            let together = all.push(&parts, None, &points);
            all.add(&parts, Sharing::All, together);
            if sensors.len() > 1 {
                let own: Vec<Vec<usize>> =
                    (0..sensors.len()).map(|s| all.push(&parts, Some(s), &points)).collect();
                all.add(&parts, Sharing::Each, own.concat());
                for (s, rows) in own.into_iter().enumerate() {
                    all.add(&parts, Sharing::One(s), rows);
                }
            }
        }
        Some(all)
    }

    /// Adds the values of functions on one sensor, or on all; returns the indices of their rows.
    fn push(
        &mut self,
        parts: &[Function],
        sensor: Option<usize>,
        points: &[(usize, usize, Point)],
    ) -> Vec<usize> {
        let begin = self.rows.rows();
        for part in parts {
            let mut row = vec![0.0; self.rows.columns()];
            for (own, i, point) in points {
                if sensor.is_none_or(|sensor| *own == sensor) {
                    row[*i] = (part.value)(point);
                }
            }
            if !row.iter().all(|x| x.is_finite()) {
                row.fill(0.0);
            }
            self.rows.push_row(&row);
        }
        (begin..self.rows.rows()).collect()
    }

    fn add(&mut self, parts: &[Function], spread: Sharing, rows: Vec<usize>) {
        self.candidates.push(DictionaryTerm {
            parts: parts.iter().map(|part| part.text.clone()).collect(),
            expressible: parts.iter().all(|part| !part.text.contains("dy")),
            spread,
            rows,
        });
    }
}

/// The derivative along the axis by finite differences.
fn slope(y: &[f64], at: &[f64]) -> Vec<f64> {
    let last = y.len() - 1;
    let of = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
        (y[b] - y[a]) / (at[b] - at[a])
    };
    (0..y.len()).map(of).collect()
}

/// The functions of all terms on an axis from `first` to `last`, with `frequencies` frequencies in steps of half a
/// period.
fn terms(first: f64, last: f64, frequencies: usize) -> Vec<Vec<Function>> {
    let length = last - first;
    let mut all: Vec<Vec<Function>> = simple().into_iter().map(|one| vec![one]).collect();
    let since = if first == 0.0 { "t".to_owned() } else { format!("(t - {})", short(first)) };
    for k in 0..DECAYS {
        let time = rounded(length / 2f64.powi(k));
        let decay = format!("exp(-{since} / {})", short(time));
        let value = move |p: &Point| (-(p.t - first) / time).exp();
        all.push(vec![Function {
            text: format!("y * {decay}"),
            value: Box::new(move |p| p.y * value(p)),
        }]);
        all.push(vec![Function { text: decay, value: Box::new(value) }]);
    }
    for k in BUMPS {
        let width = rounded(length / f64::from(k));
        for step in 0..=2 * k {
            let middle = rounded(first + 0.5 * width * f64::from(step));
            all.push(vec![Function {
                text: format!("exp(-((t - {}) / {})^2)", short(middle), short(width)),
                value: Box::new(move |p| (-((p.t - middle) / width).powi(2)).exp()),
            }]);
        }
    }
    for k in 2..frequencies {
        let frequency = rounded(0.5 * k as f64 / length);
        let angle = format!("2 * pi * {} * t", short(frequency));
        let phase = move |p: &Point| std::f64::consts::TAU * frequency * p.t;
        let sine = Box::new(move |p: &Point| phase(p).sin());
        let cosine = Box::new(move |p: &Point| phase(p).cos());
        all.push(vec![
            Function { text: format!("sin({angle})"), value: sine },
            Function { text: format!("cos({angle})"), value: cosine },
        ]);
    }
    all
}

/// The functions without a parameter of their own.
fn simple() -> Vec<Function> {
    let one = |text: &str, value: fn(&Point) -> f64| Function {
        text: text.to_owned(),
        value: Box::new(value),
    };
    vec![
        one("1", |_| 1.0),
        one("t", |p| p.t),
        one("t^2", |p| p.t * p.t),
        one("y", |p| p.y),
        one("y^2", |p| p.y * p.y),
        one("y^3", |p| p.y.powi(3)),
        one("abs(y)", |p| p.y.abs()),
        one("y * abs(y)", |p| p.y * p.y.abs()),
        one("sign(y)", |p| sign(p.y)),
        one("y * t", |p| p.y * p.t),
        one("dy", |p| p.dy),
        one("dy^2", |p| p.dy * p.dy),
        one("dy * abs(dy)", |p| p.dy * p.dy.abs()),
        one("abs(dy)", |p| p.dy.abs()),
        one("sign(dy)", |p| sign(p.dy)),
        one("t * dy", |p| p.t * p.dy),
        one("y * dy", |p| p.y * p.dy),
        one("y^2 * dy", |p| p.y * p.y * p.dy),
        one("ddy", |p| p.ddy),
        one("y * ddy", |p| p.y * p.ddy),
    ]
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// A number rounded to six digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

/// A number with six digits, as it is written in a formula.
pub(super) fn short(x: f64) -> String {
    let x = rounded(x);
    let plain = x.to_string();
    if plain.len() <= 12 { plain } else { format!("{x:e}") }
}
