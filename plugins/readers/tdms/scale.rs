//! Scales: from the numbers of a converter, as stored, to those of the quantity.
//!
//! `LabVIEW` writes them as properties `NI_Scale[0]_Linear_Slope` and so on, of a channel, its group or the file. Each
//! takes the result of another or the stored number; the last is the result.

use std::collections::BTreeMap;

use super::kind::Property;

/// Number of a source that is the stored number.
const STORED: f64 = 4_294_967_295.0;

/// A polynomial: coefficients from the constant on.
pub(super) type Polynomial = Vec<f64>;

/// The polynomials that are applied to a stored number one after the other, from the properties of a channel, its group
/// and the file, in this order; fails for scales that are not polynomials.
pub(super) fn scales(levels: &[&BTreeMap<String, Property>]) -> Result<Vec<Polynomial>, String> {
    let scaled = |p: &BTreeMap<String, Property>| {
        p.get("NI_Scaling_Status") == Some(&Property::Text("scaled".to_owned()))
    };
    for properties in levels {
        match properties.get("NI_Number_Of_Scales") {
            Some(Property::Number(count)) if *count >= 1.0 && !scaled(properties) => {
                return of(properties, *count);
            }
            _ => (),
        }
    }
    Ok(Vec::new())
}

fn of(properties: &BTreeMap<String, Property>, count: f64) -> Result<Vec<Polynomial>, String> {
    let mut steps = Vec::new();
    let mut scale = count - 1.0;
    while scale != STORED {
        let get = |key: &str| properties.get(&format!("NI_Scale[{scale}]_{key}"));
        let number = |key: &str| match get(key) {
            Some(Property::Number(x)) => Ok(*x),
            _ => Err(format!("has no number `NI_Scale[{scale}]_{key}`")),
        };
        let Some(Property::Text(kind)) = get("Scale_Type") else {
            return Err(format!("has no `NI_Scale[{scale}]_Scale_Type`"));
        };
        match kind.as_str() {
            "Linear" => {
                steps.push(vec![number("Linear_Y_Intercept")?, number("Linear_Slope")?]);
            }
            "Polynomial" => {
                let size = number("Polynomial_Coefficients_Size").unwrap_or(4.0);
                let mut coefficients = Vec::new();
                while (coefficients.len() as f64) < size {
                    let key = format!("Polynomial_Coefficients[{}]", coefficients.len());
                    coefficients.push(number(&key)?);
                }
                steps.push(coefficients);
            }
            "AdvancedAPI" => (),
            _ => {
                return Err(format!(
                    "has the scale `{kind}`, and only those of type `Linear` and `Polynomial` are applied here"
                ));
            }
        }
        let source = number(&format!("{kind}_Input_Source")).unwrap_or(STORED);
        if !(source < scale || source == STORED) {
            return Err(format!("has the scale {scale}, which takes the result of scale {source}"));
        }
        scale = source;
    }
    steps.reverse();
    Ok(steps)
}

/// Applies scales to a stored number.
pub(super) fn scaled(scales: &[Polynomial], stored: f64) -> f64 {
    scales.iter().fold(stored, |x, coefficients| {
        coefficients.iter().rev().copied().reduce(|sum, c| sum * x + c).unwrap_or(0.0)
    })
}
