//! The first part of each curve: equations that are integrated along the last axis end where nothing more is needed.

use lacuna::data::{Axis, Coordinates, Layout};
use lacuna::plugin::model::{Gradient, Response};
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::ModelMap;
use crate::stage::simulator::Setting;

/// The first places of each curve of a layout.
struct Beginning {
    layout: Layout,
    /// The number of places on the last axis, and that of the whole layout.
    places: usize,
    whole: usize,
}

impl Beginning {
    /// As far as some of the outputs of a layout are needed; `None` if its last axis is no grid.
    fn of(layout: &Layout, needed: &[bool]) -> Option<Self> {
        let (last, others) = layout.axes.split_last()?;
        let Coordinates::Grid { values, unit } = &last.coordinates else { return None };
        let whole = values.len();
        let needed = needed.iter().enumerate().filter(|(_, needed)| **needed);
        let places = needed.map(|(i, _)| i % whole + 1).max().unwrap_or(1);
        let axis = Axis::grid(&last.name, values[..places].to_vec(), unit.clone());
        let axes = others.iter().cloned().chain([axis]).collect();
        Some(Self { layout: Layout { axes, ..layout.clone() }, places, whole })
    }

    /// The row of the beginning for each output of the whole layout: beyond it that of its last place.
    fn rows(&self, outputs: usize) -> impl Iterator<Item = usize> {
        let row = |i: usize| i / self.whole * self.places + (i % self.whole).min(self.places - 1);
        (0..outputs).map(row)
    }
}

impl ModelMap<'_> {
    /// The beginnings of the responses to all scenarios; `None` if the model is none of equations that are integrated along
    /// the last axis.
    fn beginnings(&self, needed: &[bool]) -> Option<Vec<Beginning>> {
        if self.simulator.model.amend().is_none() || self.simulator.is_stochastic() {
            return None;
        }
        let settings = self.simulator.settings.iter();
        settings.map(|own| Beginning::of(&own.asked, &needed[own.outputs.clone()])).collect()
    }

    /// [`Forward::mean_at`](lacuna::plugin::Forward::mean_at) of equations.
    pub(super) fn mean_of_beginnings(&self, needed: &[bool], points: &Matrix) -> Option<Matrix> {
        let beginnings = self.beginnings(needed)?;
        let settings = &self.simulator.settings;
        let of_point = |i: usize| -> Vec<f64> {
            let mut all = vec![f64::NAN; self.outputs];
            for (setting, beginning) in settings.iter().zip(&beginnings) {
                let answer = self.simulator.respond_on(&beginning.layout, setting, points.row(i));
                let Some(answer) = self.note(answer) else { continue };
                let own = &mut all[setting.outputs.clone()];
                let rows = beginning.rows(own.len());
                own.iter_mut().zip(rows).for_each(|(y, row)| *y = answer.values[row]);
            }
            all
        };
        let rows: Vec<Vec<f64>> = (0..points.rows()).into_par_iter().map(of_point).collect();
        Some(Matrix::from_rows(self.outputs, rows))
    }

    /// [`Forward::mean_and_jacobian_by`](lacuna::plugin::Forward::mean_and_jacobian_by) of equations, by all parameters;
    /// beyond the beginnings the derivatives are zero.
    pub(super) fn derivatives_of_beginnings(
        &self,
        needed: &[bool],
        gradient: &dyn Gradient,
        point: &[f64],
    ) -> Option<(Vec<f64>, Matrix)> {
        let beginnings = self.beginnings(needed)?;
        let mut mean = vec![f64::NAN; self.outputs];
        let mut jacobian = Matrix::zeros(self.outputs, point.len());
        let settings = &self.simulator.settings;
        let answered = |(setting, beginning): (&Setting<'_>, &Beginning)| {
            let layout = &beginning.layout;
            self.note(self.simulator.with_derivatives_on(layout, setting, gradient, point))
        };
        let answers: Vec<Option<(Response, Matrix)>> =
            settings.par_iter().zip(&beginnings).map(answered).collect();
        for ((setting, beginning), answer) in settings.iter().zip(&beginnings).zip(answers) {
            let Some((answer, slopes)) = answer else { continue };
            for (i, row) in setting.outputs.clone().zip(beginning.rows(setting.outputs.len())) {
                mean[i] = answer.values[row];
                if (i - setting.outputs.start) % beginning.whole < beginning.places {
                    jacobian.row_mut(i).copy_from_slice(slopes.row(row));
                }
            }
        }
        Some((mean, jacobian))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lacuna::data::Unit;

    use super::*;

    #[test]
    fn a_beginning_ends_at_the_last_needed_place_of_all_curves() {
        let axes = vec![
            Axis::labels("sensor", ["a", "b"]),
            Axis::grid("t", vec![0.0, 1.0, 2.0, 3.0], Unit::parse("s").unwrap()),
        ];
        let layout = Layout { name: "y".into(), unit: Unit::dimensionless(), axes };
        let mut needed = [false; 8];
        needed[0] = true;
        needed[5] = true;
        let beginning = Beginning::of(&layout, &needed).unwrap();
        assert_eq!(beginning.layout.shape(), [2, 2]);
        assert_eq!(beginning.rows(8).collect::<Vec<_>>(), [0, 1, 1, 1, 2, 3, 3, 3]);
    }
}
