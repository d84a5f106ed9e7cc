//! A response as JSON: nested lists in the order of the axes, one flat list, or objects by label.

use lacuna::data::{Axis, Coordinates, Layout};
use serde_json::Value;

/// Parses the response from the output of a program: all of it, or its last line.
pub fn printed(text: &str, layout: &Layout) -> Result<Vec<f64>, String> {
    let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let document = serde_json::from_str(text).or_else(|_| serde_json::from_str(last));
    let document: Value = document.map_err(|_| {
        let found = if last.is_empty() { "nothing".to_owned() } else { format!("`{}`", cut(last)) };
        format!("expected the response as JSON in the last line printed, found {found}")
    })?;
    values(&document, layout)
}

/// Extracts the response from a document.
pub fn values(document: &Value, layout: &Layout) -> Result<Vec<f64>, String> {
    let mut values = Vec::with_capacity(layout.len());
    match document {
        Value::Array(items) if items.iter().all(|item| !item.is_array() && !item.is_object()) => {
            if items.len() != layout.len() {
                let (found, expected) = (items.len(), layout.len());
                return Err(format!("the response has {found} values, expected {expected}"));
            }
            for item in items {
                values.push(number(item)?);
            }
        }
        _ => nested(document, &layout.axes, &mut values)?,
    }
    Ok(values)
}

fn nested(document: &Value, axes: &[Axis], values: &mut Vec<f64>) -> Result<(), String> {
    let Some((axis, inner)) = axes.split_first() else {
        values.push(number(document)?);
        return Ok(());
    };
    match (document, &axis.coordinates) {
        (Value::Array(items), _) if items.len() == axis.len() => {
            items.iter().try_for_each(|item| nested(item, inner, values))
        }
        (Value::Array(items), _) => {
            let (found, expected) = (items.len(), axis.len());
            Err(format!("{found} values along `{}`, expected {expected}", axis.name))
        }
        (Value::Object(items), Coordinates::Labels(labels)) => {
            if let Some(unknown) = items.keys().find(|key| !labels.contains(key)) {
                return Err(format!("the response has no {} `{unknown}`", axis.name));
            }
            labels.iter().try_for_each(|label| {
                let item = items.get(label);
                let item = item.ok_or_else(|| format!("no values of {} `{label}`", axis.name))?;
                nested(item, inner, values)
            })
        }
        (Value::Object(_), Coordinates::Grid { .. }) => {
            Err(format!("expected a list along `{}`, found an object", axis.name))
        }
        (other, _) => Err(format!(
            "expected values along `{}`, found `{}`",
            axis.name,
            cut(&other.to_string())
        )),
    }
}

fn number(value: &Value) -> Result<f64, String> {
    value.as_f64().ok_or_else(|| format!("expected a number, found `{}`", cut(&value.to_string())))
}

/// Returns the beginning of a text.
fn cut(text: &str) -> String {
    const LONGEST: usize = 60;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}
