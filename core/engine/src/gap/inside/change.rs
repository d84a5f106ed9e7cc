//! A change of the emulator's response that was learned from simulation runs, as an effect.

use lacuna::data::{Layout, Layouts};
use lacuna::plugin::effect::{Description, Reach, SMOOTH, Situation, by_parameter_steps_of};
use lacuna::plugin::{Component, Effect, Hyperparameter};
use lacuna_linalg::Matrix;
use toml::Table;

use crate::gap::system::switched::InputEffect;

/// A change of the whole response over the study's parameters and the parameters of an effect.
pub(super) trait Change: Send + Sync {
    /// The change at a point of the study's parameters, for values of the effect's parameters.
    fn at(&self, point: &[f64], values: &[f64]) -> Vec<f64>;
}

/// A learned change as an effect. It depends on the study's parameters, the first of those of the forward map.
pub(super) struct ChangeEffect<C> {
    pub change: C,
    /// The number of the study's parameters.
    pub own: usize,
    pub layouts: Layouts,
    /// The parameters of the effect and their description.
    pub inner: InputEffect,
    /// The error of the change, relative to its size.
    pub relative_error: f64,
}

impl<C: Change> ChangeEffect<C> {
    /// The change of the response of a block.
    fn change(&self, layout: &Layout, values: &[f64], point: &[f64]) -> Vec<f64> {
        let mut parts = self.layouts.parts();
        let range = parts.find(|(block, _)| *block == layout).map(|(_, range)| range);
        range.map_or_else(Vec::new, |range| {
            self.change.at(&point[..self.own], values)[range].to_vec()
        })
    }
}

impl<C: Change> Component for ChangeEffect<C> {}

impl<C: Change> Effect for ChangeEffect<C> {
    fn describe(&self) -> Description {
        self.inner.describe()
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        self.inner.parameters(layout)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        self.inner.absent(layout)
    }

    /// The response is returned unchanged: the change is known at a point of the study's parameters only.
    fn apply(&self, _layout: &Layout, response: &[f64], _values: &[f64]) -> Vec<f64> {
        response.to_vec()
    }

    fn apply_at(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        point: &[f64],
    ) -> Vec<f64> {
        let change = self.change(layout, values, point);
        response.iter().zip(change).map(|(y, d)| y + d).collect()
    }

    fn by_parameters_at(
        &self,
        layout: &Layout,
        _response: &[f64],
        values: &[f64],
        point: &[f64],
    ) -> Matrix {
        let change = |values: &[f64]| self.change(layout, values, point);
        by_parameter_steps_of(&self.parameters(layout), layout.len(), values, SMOOTH, change)
    }

    /// The change is added, and its own slopes by the study's parameters are of second order: they are left out.
    fn push_forward(
        &self,
        _layout: &Layout,
        _response: &[f64],
        _values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>> {
        self.inner.starts(layout, situation)
    }

    fn proposals(&self, _situation: &Situation<'_>) -> Vec<Table> {
        Vec::new()
    }

    fn reach(&self) -> Reach {
        Reach::Whole
    }

    fn acts_first(&self) -> bool {
        true
    }

    fn relative_error(&self) -> f64 {
        self.relative_error
    }
}
