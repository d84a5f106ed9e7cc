//! Arrays of a file, and the names by which a study asks for them.

use std::cmp::Ordering;
use std::path::Path;

use lacuna::data::Table;
use lacuna::data::table::Column;
use lacuna::plugin::reader::{Contents, ReadError, Variable};

use crate::readers::contents::{MOST_SIGNAL_VALUES, fact, limits};
use crate::readers::listed;

/// Placeholder for the name of a replicate, in names of datasets and in paths.
pub const REPLICATE: &str = "{replicate}";

/// Numbers with a shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Lengths of the dimensions.
    pub shape: Vec<usize>,
    /// Numbers, the last dimension fastest; missing ones are NaN.
    pub values: Vec<f64>,
    /// Unit as the file writes it; `None` if it states none.
    pub unit: Option<String>,
}

impl Array {
    /// An array from numbers whose first dimension is the fastest, the order of MATLAB.
    pub fn from_columns(shape: Vec<usize>, columns: &[f64], unit: Option<String>) -> Self {
        let mut values = Vec::with_capacity(columns.len());
        let mut place = vec![0; shape.len()];
        for _ in 0..columns.len() {
            let flat = place.iter().zip(&shape).rev().fold(0, |flat, (i, n)| flat * n + i);
            values.push(columns[flat]);
            for (i, n) in place.iter_mut().zip(&shape).rev() {
                *i += 1;
                if *i < *n {
                    break;
                }
                *i = 0;
            }
        }
        Self { shape, values, unit }
    }

    /// The shape without dimensions of length one, as far as more than `dimensions` are left.
    pub fn squeezed(&self, dimensions: usize) -> Vec<usize> {
        let mut shape = self.shape.clone();
        while shape.len() > dimensions {
            let Some(one) = shape.iter().position(|&n| n == 1) else { break };
            shape.remove(one);
        }
        shape
    }
}

/// Times at which a file says that the samples of a dataset were taken, without an array of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Rate {
    /// Time of the first sample.
    pub first: f64,
    /// Interval between samples, above zero.
    pub step: f64,
    /// Unit of both, as the file writes it; `None` if it states none.
    pub unit: Option<String>,
}

/// An open file with named arrays.
pub trait Store {
    /// Path of the file.
    fn path(&self) -> &Path;

    /// Description of the format.
    fn format(&self) -> String;

    /// Names of all datasets, numeric or not, in the order of the file.
    fn names(&self) -> &[String];

    /// Reads a dataset of [`Store::names`]; fails if it does not hold numbers.
    fn array(&self, name: &str) -> Result<Array, ReadError>;

    /// The times that the file states for the samples of a dataset; `None` if it states none.
    fn rate(&self, _name: &str) -> Option<Rate> {
        None
    }

    /// Further facts about the file, for its description.
    fn facts(&self) -> Vec<(String, String)> {
        Vec::new()
    }
}

/// Reads a dataset; the error about an unknown name lists those of the file.
pub fn array(store: &dyn Store, name: &str) -> Result<Array, ReadError> {
    if store.names().iter().any(|known| known == name) {
        return store.array(name);
    }
    let text = format!("has no dataset `{name}`; it has {}", listed(store.names()));
    Err(ReadError::new(store.path(), text))
}

/// Describes all datasets of a file.
pub fn contents(store: &dyn Store) -> Contents {
    let mut contents =
        Contents { format: store.format(), facts: store.facts(), ..Contents::default() };
    for name in store.names() {
        match store.array(name) {
            Ok(array) => contents.variables.push(described(name, array)),
            Err(error) => contents.facts.push(fact(&format!("dataset {name}"), error.message)),
        }
    }
    contents
}

fn described(name: &str, array: Array) -> Variable {
    let (range, not_finite) = limits(&array.values);
    let mut signals = Table::default();
    if array.values.len() <= MOST_SIGNAL_VALUES {
        let length = array.shape.iter().rev().copied().find(|&n| n > 1).unwrap_or(1);
        let count = array.values.len().div_ceil(length);
        for (i, values) in array.values.chunks(length).enumerate() {
            let name = if count == 1 { name.to_owned() } else { format!("{name} {}", i + 1) };
            signals.columns.push(Column { name, unit: None, values: values.to_vec() });
        }
    }
    Variable {
        name: name.to_owned(),
        on: "file".to_owned(),
        axes: array.shape.iter().zip(1..).map(|(&n, i)| (format!("dimension {i}"), n)).collect(),
        // A unit that is unknown to the engine does not prevent the description.
        unit: array.unit.and_then(|text| lacuna::data::Unit::parse(&text).ok()),
        range,
        not_finite,
        signals,
    }
}

/// The name of the replicate with which a pattern becomes this text; `None` if there is none. A name is not empty and
/// has no `/`.
pub fn captured(pattern: &str, text: &str) -> Option<String> {
    let (before, _) = pattern.split_once(REPLICATE)?;
    let rest = text.strip_prefix(before)?;
    let ends = rest.char_indices().map(|(i, c)| i + c.len_utf8());
    ends.map(|end| &rest[..end])
        .take_while(|name| !name.contains('/'))
        .find(|name| pattern.replace(REPLICATE, name) == text)
        .map(str::to_owned)
}

/// Compares names in which numbers count by their value: `pulse 9` is before `pulse 10`.
pub fn by_number(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    while let (Some(x), Some(y)) = (left.chars().next(), right.chars().next()) {
        if x.is_ascii_digit() && y.is_ascii_digit() {
            let ((m, after_m), (n, after_n)) = (leading_number(left), leading_number(right));
            let order = m.len().cmp(&n.len()).then(m.cmp(n));
            if order != Ordering::Equal {
                return order;
            }
            (left, right) = (after_m, after_n);
        } else if x == y {
            (left, right) = (&left[x.len_utf8()..], &right[y.len_utf8()..]);
        } else {
            return x.cmp(&y);
        }
    }
    left.len().cmp(&right.len()).then(a.cmp(b))
}

/// The digits at the beginning of a text without leading zeros, and the rest.
fn leading_number(text: &str) -> (&str, &str) {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    (text[..end].trim_start_matches('0'), &text[end..])
}
