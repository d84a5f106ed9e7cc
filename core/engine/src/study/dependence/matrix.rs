//! Correlations as a study writes them: one number, or a matrix.

use std::borrow::Cow;
use std::fmt;

use lacuna_linalg::{Matrix, symmetric_eigen};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, SeqAccess, Visitor};
use serde::{Serialize, Serializer};

/// One correlation, or a matrix by rows.
#[derive(Debug, Clone, PartialEq)]
pub enum Correlations {
    /// Correlation of two parameters.
    One(f64),
    /// Correlation matrix, by rows.
    Matrix(Vec<Vec<f64>>),
}

/// Fault of correlations, and what would be right.
pub(super) struct Unfit {
    pub(super) message: String,
    pub(super) expected: String,
}

impl Correlations {
    /// The matrix of `count` parameters, each correlation replaced by `map` of it.
    ///
    /// # Errors
    /// What is wrong with the correlations.
    pub(super) fn rows(
        &self,
        count: usize,
        map: impl Fn(f64) -> f64,
    ) -> Result<Vec<Vec<f64>>, Unfit> {
        let unfit = |message: String, expected: String| Err(Unfit { message, expected });
        let rows = match self {
            Self::One(r) if count == 2 => vec![vec![1.0, *r], vec![*r, 1.0]],
            Self::One(_) => {
                let message = format!("one correlation does not describe {count} parameters");
                return unfit(message, format!("a matrix of {count} rows and {count} columns"));
            }
            Self::Matrix(rows) => rows.clone(),
        };
        if rows.len() != count || rows.iter().any(|row| row.len() != count) {
            let message = format!("the matrix does not fit {count} parameters");
            return unfit(message, format!("{count} rows and {count} columns"));
        }
        for (i, row) in rows.iter().enumerate() {
            if row[i] != 1.0 {
                let message = format!("entry {} of the diagonal is {}", i + 1, row[i]);
                return unfit(message, "ones on the diagonal".to_owned());
            }
            for (j, other) in rows[..i].iter().enumerate() {
                let (a, b) = (row[j], other[i]);
                let (row, column) = (i + 1, j + 1);
                if a != b {
                    let message = format!(
                        "the matrix is not symmetric: row {row}, column {column} is {a}, row {column}, column {row} is {b}"
                    );
                    return unfit(message, "the same number at both places".to_owned());
                }
                if a.is_nan() || a.abs() >= 1.0 {
                    let message = format!("a correlation is {a}");
                    return unfit(message, "numbers between -1 and 1".to_owned());
                }
            }
        }
        let mapped = |i: usize, j: usize| if i == j { 1.0 } else { map(rows[i][j]) };
        Ok((0..count).map(|i| (0..count).map(|j| mapped(i, j)).collect()).collect())
    }
}

/// Smallest eigenvalue of a symmetric matrix.
pub(super) fn smallest_eigenvalue(rows: &[Vec<f64>]) -> f64 {
    let matrix = Matrix::from_fn(rows.len(), rows.len(), |i, j| rows[i][j]);
    symmetric_eigen(&matrix).map_or(f64::NAN, |eigen| eigen.values[0])
}

impl Serialize for Correlations {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::One(r) => r.serialize(serializer),
            Self::Matrix(rows) => rows.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Correlations {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

struct Written;

impl<'de> Visitor<'de> for Written {
    type Value = Correlations;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number between -1 and 1, or a matrix such as [[1, 0.6], [0.6, 1]]")
    }

    fn visit_f64<E>(self, x: f64) -> Result<Correlations, E> {
        Ok(Correlations::One(x))
    }

    fn visit_i64<E>(self, x: i64) -> Result<Correlations, E> {
        Ok(Correlations::One(x as f64))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Correlations, A::Error> {
        let mut rows = Vec::new();
        while let Some(row) = items.next_element::<Vec<f64>>()? {
            rows.push(row);
        }
        Ok(Correlations::Matrix(rows))
    }
}

impl JsonSchema for Correlations {
    fn schema_name() -> Cow<'static, str> {
        "Correlations".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "anyOf": [
                { "type": "number", "exclusiveMinimum": -1, "exclusiveMaximum": 1 },
                { "type": "array", "items": { "type": "array", "items": { "type": "number" } } }
            ]
        })
    }
}
