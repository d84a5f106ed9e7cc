//! Numbers and functions that a part passes on to those after it.

use std::sync::Arc;

use lacuna::data::{Coordinates, Function, Interpolation, Layout, Scenario, Unit};
use lacuna::plugin::Given;

/// One quantity that a part passes on.
pub struct Handed {
    /// Name of the input or function that it becomes.
    pub name: String,
    /// Unit of its values.
    pub unit: Unit,
    /// Numeric axis and its unit, if the quantity is a function.
    pub grid: Option<(Vec<f64>, Unit)>,
    /// Index of its first value in the response of the part.
    pub begin: usize,
}

/// Converts an output of this shape to the quantities that the parts after it receive; fails if the shape is not
/// supported.
pub fn handed(layout: &Layout) -> Result<Vec<Handed>, String> {
    let labels = |i: usize| match layout.axes.get(i).map(|axis| &axis.coordinates) {
        Some(Coordinates::Labels(labels)) => Some(labels.clone()),
        _ => None,
    };
    let grid = |i: usize| match layout.axes.get(i).map(|axis| &axis.coordinates) {
        Some(Coordinates::Grid { values, unit }) => Some((values.clone(), unit.clone())),
        _ => None,
    };
    let one = |name: String, grid: Option<(Vec<f64>, Unit)>, i: usize| {
        let length = grid.as_ref().map_or(1, |(values, _)| values.len());
        Handed { name, unit: layout.unit.clone(), grid, begin: i * length }
    };
    let name = layout.name.clone();
    match (layout.axes.len(), labels(0), grid(0), grid(1)) {
        (0, ..) => Ok(vec![one(name, None, 0)]),
        (1, _, Some(grid), _) => Ok(vec![one(name, Some(grid), 0)]),
        (1, Some(labels), ..) => {
            Ok(labels.into_iter().enumerate().map(|(i, label)| one(label, None, i)).collect())
        }
        (2, Some(labels), _, Some(grid)) => Ok(labels
            .into_iter()
            .enumerate()
            .map(|(i, label)| one(label, Some(grid.clone()), i))
            .collect()),
        _ => {
            Err("expected no axes, labels, one axis of numbers, or labels and then numbers".into())
        }
    }
}

impl Handed {
    /// Returns the function with these values; `None` if the quantity is a number.
    pub fn function(&self, values: &[f64]) -> Option<Function> {
        let (at, at_unit) = self.grid.as_ref()?;
        Some(Function {
            name: self.name.clone(),
            at: at.clone(),
            at_unit: at_unit.clone(),
            values: values.to_vec(),
            unit: self.unit.clone(),
            interpolation: Interpolation::Linear,
        })
    }
}

/// Announces the quantities to the parts after: numbers by name, functions by name and points.
pub fn announce(handed: &[Handed], given: &mut Vec<Given>, scenarios: &mut [Scenario]) {
    for output in handed {
        let zeros = output.grid.as_ref().map_or_else(Vec::new, |(at, _)| vec![0.0; at.len()]);
        if let Some(function) = output.function(&zeros).map(Arc::new) {
            for scenario in &mut *scenarios {
                scenario.functions.retain(|known| known.name != output.name);
                scenario.functions.push(Arc::clone(&function));
            }
        } else {
            given.retain(|other| other.name != output.name);
            given.push(Given { name: output.name.clone(), unit: Some(output.unit.clone()) });
        }
    }
}
