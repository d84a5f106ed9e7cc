//! Effects with their place: acting on the responses of all blocks, at selected outputs.

use std::collections::BTreeMap;

use lacuna_base::data::{Coordinates, Layout, Layouts};
use lacuna_base::matrix::Matrix;

use super::Effect;
use crate::plugin::Hyperparameter;

/// Place of an effect: labels by axis. The effect acts everywhere along an axis that is not named.
pub type On = BTreeMap<String, Vec<String>>;

/// An effect with its name and its place.
#[derive(Clone)]
pub struct Placed<'a> {
    /// Name of the effect, the prefix of the names of its unknowns.
    pub name: String,
    /// The effect itself.
    pub effect: &'a dyn Effect,
    /// For each output, true if the effect acts on it.
    pub acts: Vec<bool>,
    layouts: &'a Layouts,
}

impl<'a> Placed<'a> {
    /// An effect at a place.
    pub fn new(name: &str, effect: &'a dyn Effect, layouts: &'a Layouts, on: &On) -> Self {
        let acts = layouts.blocks.iter().flat_map(|layout| acts(layout, on)).collect();
        Self { name: name.to_owned(), effect, acts, layouts }
    }

    /// Unknowns of the effect, named `name.unknown`; those of an effect inside the model have the names of the model's
    /// inputs.
    pub fn hyperparameters(&self) -> Vec<Hyperparameter> {
        if !self.effect.switches().is_empty() {
            return self.effect.parameters(&self.layouts.blocks[0]);
        }
        let named = |own: Hyperparameter| Hyperparameter {
            name: format!("{}.{}", self.name, own.name),
            ..own
        };
        self.effect.parameters(&self.layouts.blocks[0]).into_iter().map(named).collect()
    }

    /// Values of the unknowns at which the effect is absent.
    pub fn absent(&self) -> Vec<f64> {
        self.effect.absent(&self.layouts.blocks[0])
    }

    /// Responses of all blocks with the effect applied, at a point of the forward map's parameters.
    pub fn apply(&self, response: &[f64], values: &[f64], point: &[f64]) -> Vec<f64> {
        let changed = self.layouts.parts().flat_map(|(layout, range)| {
            if self.acts[range.clone()].contains(&true) {
                self.effect.apply_at(layout, &response[range], values, point)
            } else {
                response[range].to_vec()
            }
        });
        self.where_it_acts(changed, response)
    }

    /// Derivative along a direction of the response.
    pub fn push_forward(&self, response: &[f64], values: &[f64], tangent: &[f64]) -> Vec<f64> {
        let changed = self.layouts.parts().flat_map(|(layout, range)| {
            if self.acts[range.clone()].contains(&true) {
                let (response, tangent) = (&response[range.clone()], &tangent[range]);
                self.effect.push_forward(layout, response, values, tangent)
            } else {
                tangent[range].to_vec()
            }
        });
        self.where_it_acts(changed, tangent)
    }

    /// Derivative of each output by each unknown of the effect, `outputs x unknowns`, at a point of the forward map's
    /// parameters.
    pub fn by_parameters(&self, response: &[f64], values: &[f64], point: &[f64]) -> Matrix {
        let mut all = Matrix::zeros(response.len(), values.len());
        for (layout, range) in self.layouts.parts() {
            if !self.acts[range.clone()].contains(&true) {
                continue;
            }
            let own = &response[range.clone()];
            let part = self.effect.by_parameters_at(layout, own, values, point);
            for (row, i) in range.enumerate().filter(|(_, i)| self.acts[*i]) {
                all.row_mut(i).copy_from_slice(part.row(row));
            }
        }
        all
    }

    fn where_it_acts(&self, changed: impl Iterator<Item = f64>, unchanged: &[f64]) -> Vec<f64> {
        let pick = |((changed, unchanged), acts): ((f64, &f64), &bool)| {
            if *acts { changed } else { *unchanged }
        };
        changed.zip(unchanged).zip(&self.acts).map(pick).collect()
    }
}

/// A response with effects applied, and its derivatives by all unknowns, one per row (`unknowns x outputs`): first
/// those of the forward map, whose `jacobian` has one per column, then those of the effects, each given with the values
/// of its unknowns. `point` holds the parameters of the forward map.
pub fn with_tangents<'b>(
    effects: impl Iterator<Item = (&'b Placed<'b>, &'b [f64])>,
    mut response: Vec<f64>,
    jacobian: &Matrix,
    point: &[f64],
) -> (Vec<f64>, Matrix) {
    let mut tangents = jacobian.transposed();
    for (effect, values) in effects {
        let mut next = Matrix::zeros(0, response.len());
        for tangent in tangents.iter_rows() {
            next.push_row(&effect.push_forward(&response, values, tangent));
        }
        let own = effect.by_parameters(&response, values, point).transposed();
        own.iter_rows().for_each(|row| next.push_row(row));
        response = effect.apply(&response, values, point);
        tangents = next;
    }
    (response, tangents)
}

/// For each output of a block, true if it belongs to the place.
pub fn acts(layout: &Layout, on: &On) -> Vec<bool> {
    let chosen: Vec<Option<Vec<bool>>> = layout
        .axes
        .iter()
        .map(|axis| match (&axis.coordinates, on.get(&axis.name)) {
            (Coordinates::Labels(labels), Some(chosen)) => {
                Some(labels.iter().map(|label| chosen.contains(label)).collect())
            }
            _ => None,
        })
        .collect();
    // A place that names an axis this block does not have selects nothing in it.
    if on.keys().any(|name| layout.axis(name).is_none()) {
        return vec![false; layout.len()];
    }
    let at = |flat: usize| {
        let places = layout.place(flat);
        chosen.iter().zip(places).all(|(chosen, i)| chosen.as_ref().is_none_or(|c| c[i]))
    };
    (0..layout.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna_base::data::{Axis, Unit};

    #[test]
    fn an_effect_acts_on_the_labels_it_names() {
        let axes = vec![
            Axis::labels("sensor", ["A", "B"]),
            Axis::grid("time", vec![1.0, 2.0], Unit::dimensionless()),
        ];
        let layout = Layout { name: "y".into(), unit: Unit::dimensionless(), axes };
        let on = |axis: &str, label: &str| On::from([(axis.to_owned(), vec![label.to_owned()])]);
        assert_eq!(acts(&layout, &On::new()), [true; 4]);
        assert_eq!(acts(&layout, &on("sensor", "B")), [false, false, true, true]);
        assert_eq!(acts(&layout, &on("scenario", "x")), [false; 4]);
    }
}
