//! Curves of a response, and windows along them.

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::plugin::effect::On;
use lacuna::plugin::quantity::{Misfit, in_unit};

use super::QuantityKeys;

/// A curve of the response to one scenario.
pub(super) struct Placed<'a> {
    /// Labels of the curve, each after an underscore; empty for a response of one curve.
    pub labels: String,
    pub axis: &'a str,
    pub grid: &'a [f64],
    pub grid_unit: &'a Unit,
    /// Flat indices of its values.
    pub outputs: Vec<usize>,
}

/// Curves along the last axis of numbers that a place selects.
pub(super) fn curves<'a>(layout: &'a Layout, on: &On) -> Vec<Placed<'a>> {
    let is_grid = |axis: &Axis| matches!(axis.coordinates, Coordinates::Grid { .. });
    let Some(along) = layout.axes.iter().rposition(is_grid) else { return Vec::new() };
    let axis = &layout.axes[along];
    let Coordinates::Grid { values, unit } = &axis.coordinates else { return Vec::new() };
    let starts = (0..layout.len()).filter(|&i| layout.place(i)[along] == 0);
    let one = |first: usize| {
        let mut place = layout.place(first);
        let others = || layout.axes.iter().zip(&place).enumerate().filter(|(j, _)| *j != along);
        let texts: Vec<(&str, String)> =
            others().map(|(_, (axis, &i))| (axis.name.as_str(), axis.text(i))).collect();
        let selected = |(axis, text): &(&str, String)| {
            on.get(*axis).is_none_or(|chosen| chosen.contains(text))
        };
        // A place that names an axis this block does not have selects nothing in it.
        let known = |name: &String| name == SCENARIO || layout.axis(name).is_some();
        if !texts.iter().all(selected) || !on.keys().all(known) {
            return None;
        }
        let several = layout.len() > values.len();
        let labels = texts.iter().map(|(_, text)| format!("_{text}")).collect::<String>();
        let outputs = (0..values.len()).map(|k| {
            place[along] = k;
            layout.index(&place)
        });
        let outputs = outputs.collect();
        let labels = if several { labels } else { String::new() };
        Some(Placed { labels, axis: &axis.name, grid: values, grid_unit: unit, outputs })
    };
    starts.filter_map(one).collect()
}

/// Indices of the points of a grid inside the window.
pub(super) fn window(
    keys: &QuantityKeys,
    grid: &[f64],
    unit: &Unit,
) -> Result<Vec<usize>, Vec<Misfit>> {
    let Some([first, last]) = &keys.window else { return Ok((0..grid.len()).collect()) };
    let (first, last) = (in_unit("window", first, unit)?, in_unit("window", last, unit)?);
    // A point that lies on an end but for round-off belongs to the window.
    let slack = 1e-9 * (last - first).abs();
    let inside = |k: &usize| (first - slack..=last + slack).contains(&grid[*k]);
    let kept: Vec<usize> = (0..grid.len()).filter(inside).collect();
    if kept.is_empty() {
        let ends = [grid.first(), grid.last()].map(|end| end.copied().unwrap_or(f64::NAN));
        let misfit = Misfit::new("window", "the window holds no point of the curve");
        let expected = format!("two points in order, from {} to {} {unit}", ends[0], ends[1]);
        return Err(vec![misfit.expected(expected).found(format!("{first} to {last} {unit}"))]);
    }
    Ok(kept)
}
