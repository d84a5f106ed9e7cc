//! Data as a study writes them: a number, a list of numbers, or a list of rows.

use std::borrow::Cow;
use std::fmt;

use lacuna::expression::Data;
use lacuna_linalg::Matrix;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, Serializer};

/// A number, a vector or a matrix of data.
#[derive(Debug, Clone, PartialEq)]
pub struct Known(pub Data);

impl<'de> Deserialize<'de> for Known {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let data = match deserializer.deserialize_any(Written)? {
            Item::One(x) => Data::Number(x),
            Item::Many(items) => listed(items).map_err(D::Error::custom)?,
        };
        Ok(Self(data))
    }
}

impl Serialize for Known {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            Data::Number(x) => serializer.serialize_f64(*x),
            Data::Vector(elements) => elements.serialize(serializer),
            Data::Matrix(matrix) => serializer.collect_seq(matrix.iter_rows()),
        }
    }
}

impl JsonSchema for Known {
    fn schema_name() -> Cow<'static, str> {
        "Known".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let numbers = json_schema!({ "type": "array", "items": { "type": "number" } });
        json_schema!({
            "anyOf": [
                { "type": "number" },
                numbers,
                { "type": "array", "items": numbers },
            ]
        })
    }
}

/// A value as written in the study.
enum Item {
    One(f64),
    Many(Vec<Item>),
}

/// Converts a list to a vector of numbers, or to a matrix of rows of equal length.
fn listed(items: Vec<Item>) -> Result<Data, String> {
    let row = |items: &[Item]| -> Option<Vec<f64>> {
        let number = |item: &Item| if let Item::One(x) = item { Some(*x) } else { None };
        items.iter().map(number).collect()
    };
    if let Some(numbers) = row(&items) {
        return Ok(Data::Vector(numbers));
    }
    let rows = items.iter().map(|item| match item {
        Item::One(_) => Err("expected a list of numbers or a list of rows, found both".to_owned()),
        Item::Many(items) => {
            row(items).ok_or_else(|| "expected rows of numbers, found deeper lists".to_owned())
        }
    });
    let rows = rows.collect::<Result<Vec<Vec<f64>>, String>>()?;
    let columns = rows[0].len();
    match rows.iter().position(|row| row.len() != columns) {
        Some(i) => Err(format!(
            "expected rows of {columns} numbers like the first, found {} in row {}",
            rows[i].len(),
            i + 1
        )),
        None => Ok(Data::Matrix(Matrix::from_rows(columns, rows))),
    }
}

struct Written;

impl<'de> Deserialize<'de> for Item {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

impl<'de> Visitor<'de> for Written {
    type Value = Item;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a list of numbers or a list of rows")
    }

    fn visit_f64<E: Error>(self, x: f64) -> Result<Item, E> {
        if x.is_finite() {
            return Ok(Item::One(x));
        }
        Err(E::custom(format!("expected a finite number, found {x}")))
    }

    fn visit_i64<E: Error>(self, x: i64) -> Result<Item, E> {
        Ok(Item::One(x as f64))
    }

    fn visit_u64<E: Error>(self, x: u64) -> Result<Item, E> {
        Ok(Item::One(x as f64))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Item, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = list.next_element::<Item>()? {
            items.push(item);
        }
        Ok(Item::Many(items))
    }
}
