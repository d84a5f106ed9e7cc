//! The dictionary: forms that the law of a missing rate may have, with their units.

use lacuna::data::Unit;
use lacuna::expression::is_name;
use lacuna::math::distribution::Distribution;
use lacuna::math::moments::quantile;

use super::quantity::{quantity, rounded, words};
use super::sites::{Argument, Site};

/// Exponents of odd powers `u |u|^(p - 1)`.
const ODD: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0];

/// Exponents of even powers `|u|^p`.
const EVEN: [f64; 3] = [1.0, 2.0, 4.0];

/// Quantiles of a quantity at which it may be clipped on one side.
const LEVELS: [f64; 8] = [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.96];

/// Quantiles of its magnitude at which it may be clipped on both sides.
const GAPS: [f64; 7] = [0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 0.95];

/// The width of a bend, relative to the root mean square of the quantity.
const BEND: f64 = 0.01;

/// The width over which a sign changes, relative to the root mean square of the quantity.
const TURN: f64 = 0.02;

/// The largest number of arguments whose products are tried.
const FACTORS: usize = 4;

/// The form of a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// `u |u / scale|^(p - 1)`.
    Odd,
    /// `|u / scale|^p`.
    Even,
    /// The sign of `u`, over a small width.
    Sign,
    /// `max(u - level, 0)`, with a small bend.
    Above,
    /// `u` limited to a gap on both sides, with small bends.
    Within,
    /// The excess of `u` over a gap on both sides, with small bends.
    Beyond,
    /// A product of two quantities.
    Product,
    /// One for all times.
    Constant,
}

/// A form with its argument: one function of the states.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    /// The index of the rate to which it may be added.
    pub site: usize,
    pub form: Form,
    /// The argument, as an expression, with its unit.
    pub of: String,
    pub unit: Unit,
    /// The second factor of a product, as an expression, and as a reader would write it.
    pub by: String,
    pub by_words: String,
    /// The exponent or the threshold, in the unit of the argument.
    pub value: f64,
    /// The root mean square of the argument along the run, and its largest and smallest value.
    pub scale: f64,
    pub range: [f64; 2],
}

/// An argument with its values along the run.
pub(super) struct Seen<'a> {
    pub argument: &'a Argument,
    pub values: Vec<f64>,
}

impl Seen<'_> {
    fn scale(&self) -> f64 {
        let squares: f64 = self.values.iter().map(|x| x * x).sum();
        rounded((squares / self.values.len().max(1) as f64).sqrt())
    }
}

/// All entries of a rate whose arguments were seen along the run.
pub(super) fn entries(index: usize, site: &Site, seen: &[Seen<'_>]) -> Vec<Entry> {
    let mut all = vec![Entry {
        site: index,
        form: Form::Constant,
        of: site.state.name.clone(),
        unit: site.state.unit.clone(),
        by: String::new(),
        by_words: String::new(),
        value: 0.0,
        scale: 1.0,
        range: [0.0, 0.0],
    }];
    let varies = |seen: &&Seen<'_>| {
        let (low, high) = ends(&seen.values);
        seen.values.iter().all(|x| x.is_finite()) && high > low && seen.scale() > 0.0
    };
    let seen: Vec<&Seen<'_>> = seen.iter().filter(varies).collect();
    for one in &seen {
        all.extend(of_one(index, one));
    }
    all.extend(products(index, &seen[..seen.len().min(FACTORS)]));
    all
}

fn ends(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)))
}

fn of_one(index: usize, seen: &Seen<'_>) -> Vec<Entry> {
    let scale = seen.scale();
    let (low, high) = ends(&seen.values);
    let of = &seen.argument.text;
    let entry = |form: Form, of: String, range: [f64; 2], value: f64| Entry {
        site: index,
        form,
        of,
        unit: seen.argument.unit.clone(),
        by: String::new(),
        by_words: String::new(),
        value,
        scale,
        range,
    };
    let plain = |form: Form, value: f64| entry(form, of.clone(), [low, high], value);
    let mut all: Vec<Entry> = ODD.iter().map(|p| plain(Form::Odd, *p)).collect();
    if low < 0.0 && high > 0.0 {
        all.extend(EVEN.iter().map(|p| plain(Form::Even, *p)));
        all.push(plain(Form::Sign, 0.0));
        let magnitudes = sorted(seen.values.iter().map(|x| x.abs()));
        for form in [Form::Within, Form::Beyond] {
            let range = [0.0, high.max(-low)];
            let gaps = GAPS.iter().map(|p| rounded(quantile(&magnitudes, *p)));
            all.extend(gaps.map(|gap| entry(form, of.clone(), range, gap)));
        }
    }
    for sign in [1.0, -1.0] {
        let values = sorted(seen.values.iter().map(|x| sign * x));
        let of = if sign > 0.0 { of.clone() } else { format!("-({of})") };
        let mut levels: Vec<f64> = LEVELS.iter().map(|p| rounded(quantile(&values, *p))).collect();
        if low < 0.0 && high > 0.0 {
            levels.push(0.0);
        }
        let range = if sign > 0.0 { [low, high] } else { [-high, -low] };
        all.extend(levels.into_iter().map(|level| entry(Form::Above, of.clone(), range, level)));
    }
    all
}

/// An expression as a factor.
fn bare(text: &str) -> String {
    if is_name(text) { text.to_owned() } else { format!("({text})") }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all
}

fn products(index: usize, seen: &[&Seen<'_>]) -> Vec<Entry> {
    let mut all = Vec::new();
    for (i, a) in seen.iter().enumerate() {
        for (j, b) in seen.iter().enumerate() {
            if i == j || a.argument.of_time && b.argument.of_time {
                continue;
            }
            let second = &b.argument.text;
            let width = quantity(rounded(BEND * b.scale()), &b.argument.unit);
            let mut factors = vec![
                (format!("({second})^2"), format!("{}^2", bare(second))),
                (format!("hypot({second}, {width})"), format!("abs({second})")),
            ];
            if i < j {
                factors.push((format!("({second})"), bare(second)));
            }
            all.extend(factors.into_iter().map(|(by, by_words)| Entry {
                site: index,
                form: Form::Product,
                of: a.argument.text.clone(),
                unit: a.argument.unit.clone(),
                by,
                by_words,
                value: 0.0,
                scale: a.scale(),
                range: [0.0, 0.0],
            }));
        }
    }
    all
}

impl Entry {
    /// The shape as an expression, with the exponent or the threshold as it is.
    pub fn shape(&self) -> String {
        let value = match self.form {
            Form::Odd | Form::Even => format!("{:?}", self.value),
            _ => quantity(self.value, &self.unit),
        };
        self.shape_with(&value)
    }

    /// The shape as an expression, with an unknown in the place of the exponent or the threshold.
    pub fn shape_with(&self, value: &str) -> String {
        let u = &self.of;
        let scale = quantity(self.scale, &self.unit);
        let bend = quantity(rounded(BEND * self.scale), &self.unit);
        let power = |exponent: String| format!("((({u}) / ({scale}))^2 + 1e-6)^({exponent})");
        let clamped = || {
            format!("0.5 * (hypot(({u}) + ({value}), {bend}) - hypot(({u}) - ({value}), {bend}))")
        };
        match self.form {
            Form::Odd => format!("({u}) * {}", power(format!("0.5 * ({value} - 1)"))),
            Form::Even => power(format!("0.5 * ({value})")),
            Form::Sign => {
                format!("tanh(({u}) / ({}))", quantity(rounded(TURN * self.scale), &self.unit))
            }
            Form::Above => {
                format!("0.5 * (({u}) - ({value}) + hypot(({u}) - ({value}), {bend}))")
            }
            Form::Within => clamped(),
            Form::Beyond => format!("({u}) - {}", clamped()),
            Form::Product => format!("({u}) * {}", self.by),
            Form::Constant => "1".to_owned(),
        }
    }

    /// The name of its exponent or threshold, with unit and prior; `None` if it has none.
    pub fn index(&self) -> Option<(&'static str, Unit, Distribution)> {
        let threshold = |name| {
            let [low, high] = self.range;
            Some((name, self.unit.clone(), Distribution::Uniform([low, high])))
        };
        match self.form {
            Form::Odd => Some(("power", Unit::dimensionless(), Distribution::Uniform([0.1, 5.0]))),
            Form::Even => Some(("power", Unit::dimensionless(), Distribution::Uniform([0.5, 6.0]))),
            Form::Above => threshold("level"),
            Form::Within | Form::Beyond => threshold("gap"),
            Form::Sign | Form::Product | Form::Constant => None,
        }
    }

    /// The formula as a reader would write it, with these names of the coefficient and of the exponent or threshold.
    pub fn formula(&self, name: &str, index: &str) -> String {
        let u = &bare(&self.of);
        let scale = words(self.scale, &self.unit);
        let bend = words(BEND * self.scale, &self.unit);
        match self.form {
            Form::Odd => format!("{name} * {u} * abs({u} / ({scale}))^({index} - 1)"),
            Form::Even => format!("{name} * abs({u} / ({scale}))^{index}"),
            Form::Sign => format!("{name} * sign({u})"),
            Form::Above => {
                format!("{name} * max({u} - {index}, 0) [bend {bend}]")
            }
            Form::Within => {
                format!("{name} * clamp({u}, -{index}, {index}) [bend {bend}]")
            }
            Form::Beyond => {
                format!("{name} * ({u} - clamp({u}, -{index}, {index})) [bend {bend}]")
            }
            Form::Product => format!("{name} * {u} * {}", self.by_words),
            Form::Constant => name.to_owned(),
        }
    }

    /// The description in words.
    pub fn title(&self) -> String {
        let u = &self.of;
        match self.form {
            Form::Odd => format!("a law found in the data: a power of `{u}` with its sign"),
            Form::Even => format!("a law found in the data: a power of the magnitude of `{u}`"),
            Form::Sign => format!("a law found in the data: the sign of `{u}`"),
            Form::Above => format!("a law found in the data: the excess of `{u}` over a level"),
            Form::Within => format!("a law found in the data: `{u}` within a gap"),
            Form::Beyond => format!("a law found in the data: the excess of `{u}` over a gap"),
            Form::Product => {
                format!("a law found in the data: the product of `{u}` and `{}`", self.by_words)
            }
            Form::Constant => "a law found in the data: a constant rate".to_owned(),
        }
    }

    /// True for a power above one.
    pub fn is_steep(&self) -> bool {
        self.form == Form::Odd && self.value > 1.0
    }

    /// True for an entry of the same form and arguments, whatever its exponent or threshold.
    pub fn is_kin(&self, other: &Self) -> bool {
        self.site == other.site
            && self.form == other.form
            && self.of == other.of
            && self.by == other.by
    }
}
