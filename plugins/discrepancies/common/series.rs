//! Outputs as series along one axis.

use lacuna::data::{Coordinates, Layout};

/// Series of outputs along a numeric axis, one for each combination of the other axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Flat indices of each series, in the order of the axis.
    pub outputs: Vec<Vec<usize>>,
    /// Values of the axis.
    pub grid: Vec<f64>,
    /// Name of the axis.
    pub axis: String,
    /// Unit of the axis.
    pub unit: lacuna::data::Unit,
}

impl Series {
    /// Returns the series along the axis of this name, or along the last numeric axis; fails if there is none.
    pub fn of(layout: &Layout, along: Option<&str>) -> Result<Self, String> {
        let is_grid = |c: &Coordinates| matches!(c, Coordinates::Grid { .. });
        let position = match along {
            Some(name) => layout.axis(name).map(|(position, _)| position),
            None => layout.axes.iter().rposition(|axis| is_grid(&axis.coordinates)),
        };
        let Some(position) = position else {
            return Err(match along {
                Some(name) => format!("the response has no axis `{name}`"),
                None => "the response has no axis of numbers, such as times".to_owned(),
            });
        };
        let axis = &layout.axes[position];
        let Coordinates::Grid { values, unit } = &axis.coordinates else {
            return Err(format!("axis `{}` has labels and not numbers", axis.name));
        };
        let starts = (0..layout.len()).filter(|&i| layout.place(i)[position] == 0);
        let series = |first: usize| {
            let mut place = layout.place(first);
            let at = |j: usize| {
                place[position] = j;
                layout.index(&place)
            };
            (0..values.len()).map(at).collect()
        };
        Ok(Self {
            outputs: starts.map(series).collect(),
            grid: values.clone(),
            axis: axis.name.clone(),
            unit: unit.clone(),
        })
    }
}
