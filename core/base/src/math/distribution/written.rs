//! Parsing of distributions as a study writes them.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::Distribution;

/// Names that a study may use and the meaning of their parameters.
const FORMS: [(&str, &str); 14] = [
    ("uniform", "[lower bound, upper bound]"),
    ("normal", "[mean, standard deviation]"),
    ("half_normal", "a scale"),
    ("log_normal", "[mu, sigma]"),
    ("log_uniform", "[lower bound, upper bound]"),
    ("gamma", "[shape, scale]"),
    ("inverse_gamma", "[shape, scale]"),
    ("beta", "[a, b, lower bound, upper bound] or [a, b]"),
    ("exponential", "a mean"),
    ("student_t", "[degrees of freedom, location, scale]"),
    ("half_student_t", "[degrees of freedom, scale]"),
    ("truncated_normal", "[mean, standard deviation, lower bound, upper bound]"),
    ("triangular", "[lower bound, mode, upper bound]"),
    ("quantiles", "[lower bound, upper bound, largest score, quantiles at equally spaced scores]"),
];

impl<'de> Deserialize<'de> for Distribution {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Table)
    }
}

struct Table;

impl<'de> Visitor<'de> for Table {
    type Value = Distribution;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a distribution such as { uniform = [0, 1] }")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Distribution, A::Error> {
        let Some(name) = map.next_key::<String>()? else {
            return Err(Error::custom(
                "expected a distribution such as { uniform = [0, 1] }, found an empty table",
            ));
        };
        Distribution::named(&name, map)
    }
}

impl Distribution {
    /// Reads the rest of a table whose first key, the name of the distribution, was taken.
    ///
    /// # Errors
    /// What is wrong with the name or the numbers.
    pub fn named<'de, A: MapAccess<'de>>(name: &str, mut map: A) -> Result<Self, A::Error> {
        if !FORMS.iter().any(|form| form.0 == name) {
            return Err(Error::custom(unknown(name)));
        }
        let numbers = map.next_value::<Numbers>()?;
        if let Some(second) = map.next_key::<String>()? {
            return Err(Error::custom(format!(
                "expected one distribution, found `{name}` and `{second}`"
            )));
        }
        build(name, &numbers).map_err(Error::custom)
    }
}

fn unknown(name: &str) -> String {
    let nearest = FORMS
        .iter()
        .map(|form| (strsim::jaro_winkler(form.0, name), form.0))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(score, _)| *score > 0.8);
    let names: Vec<_> = FORMS.iter().map(|form| form.0).collect();
    let hint = nearest.map_or(String::new(), |(_, near)| format!(" (did you mean `{near}`?)"));
    format!("expected a distribution ({}), found `{name}`{hint}", names.join(", "))
}

/// One number, or a list of numbers. JSON has no infinity: it writes `null`, which is `None`.
enum Numbers {
    One(Option<f64>),
    List(Vec<Option<f64>>),
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Value)
    }
}

struct Value;

impl<'de> Visitor<'de> for Value {
    type Value = Numbers;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number or a list of numbers")
    }

    fn visit_f64<E>(self, x: f64) -> Result<Numbers, E> {
        Ok(Numbers::One(Some(x)))
    }

    fn visit_i64<E>(self, x: i64) -> Result<Numbers, E> {
        Ok(Numbers::One(Some(x as f64)))
    }

    fn visit_u64<E>(self, x: u64) -> Result<Numbers, E> {
        Ok(Numbers::One(Some(x as f64)))
    }

    fn visit_unit<E>(self) -> Result<Numbers, E> {
        Ok(Numbers::One(None))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Numbers, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element::<Numbers>()? {
            match item {
                Numbers::One(x) => list.push(x),
                Numbers::List(_) => {
                    return Err(Error::custom("expected a list of numbers, found a list of lists"));
                }
            }
        }
        Ok(Numbers::List(list))
    }
}

/// The numbers of a list: `null` leaves a bound open, and is no number elsewhere.
fn bounded(name: &str, list: &[Option<f64>]) -> Vec<f64> {
    let low = match name {
        "truncated_normal" => 2,
        "quantiles" => 0,
        _ => usize::MAX,
    };
    let read = |(i, item): (usize, &Option<f64>)| match (item, i.checked_sub(low)) {
        (Some(x), _) => *x,
        (None, Some(0)) => f64::NEG_INFINITY,
        (None, Some(1)) => f64::INFINITY,
        (None, _) => f64::NAN,
    };
    list.iter().enumerate().map(read).collect()
}

fn build(name: &str, numbers: &Numbers) -> Result<Distribution, String> {
    let distribution = match numbers {
        Numbers::One(x) => match (name, x.unwrap_or(f64::NAN)) {
            ("half_normal", x) => Distribution::HalfNormal(x),
            ("exponential", x) => Distribution::Exponential(x),
            (_, x) => return Err(form(name, &number(x))),
        },
        Numbers::List(list) => match (name, bounded(name, list).as_slice()) {
            ("uniform", &[lo, hi]) => Distribution::Uniform([lo, hi]),
            ("normal", &[mean, sd]) => Distribution::Normal([mean, sd]),
            ("log_normal", &[mu, sigma]) => Distribution::LogNormal([mu, sigma]),
            ("log_uniform", &[lo, hi]) => Distribution::LogUniform([lo, hi]),
            ("gamma", &[shape, scale]) => Distribution::Gamma([shape, scale]),
            ("inverse_gamma", &[shape, scale]) => Distribution::InverseGamma([shape, scale]),
            ("beta", &[a, b]) => Distribution::Beta([a, b, 0.0, 1.0]),
            ("beta", &[a, b, lo, hi]) => Distribution::Beta([a, b, lo, hi]),
            ("student_t", &[dof, location, scale]) => {
                Distribution::StudentT([dof, location, scale])
            }
            ("half_student_t", &[dof, scale]) => Distribution::HalfStudentT([dof, scale]),
            ("truncated_normal", &[mean, sd, lo, hi]) => {
                Distribution::TruncatedNormal([mean, sd, lo, hi])
            }
            ("quantiles", all @ &[_, _, ..]) => Distribution::Quantiles(all.to_vec()),
            ("triangular", &[lo, mode, hi]) => Distribution::Triangular([lo, mode, hi]),
            (_, numbers) => return Err(form(name, &in_brackets(numbers))),
        },
    };
    distribution.check()?;
    Ok(distribution)
}

fn form(name: &str, found: &str) -> String {
    let meaning = FORMS.iter().find(|form| form.0 == name).map_or("numbers", |form| form.1);
    format!("expected `{name}` to be {meaning}, found {found}")
}

/// Numbers in brackets, as a study writes them.
pub(super) fn in_brackets(numbers: &[f64]) -> String {
    let list: Vec<_> = numbers.iter().map(|&x| number(x)).collect();
    format!("[{}]", list.join(", "))
}

/// A number in the form people write: `0.5`, `1.5e6`, `1e-6`.
pub(super) fn number(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 || (1e-3..1e5).contains(&size) || !x.is_finite() {
        format!("{x}")
    } else {
        format!("{x:e}")
    }
}

/// Schema of the parameters of a beta distribution, which are two or four.
pub(super) fn beta_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({
        "anyOf": [
            { "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 },
            { "type": "array", "items": { "type": "number" }, "minItems": 4, "maxItems": 4 }
        ]
    })
}
