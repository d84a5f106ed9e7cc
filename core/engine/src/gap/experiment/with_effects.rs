//! The forward map with the effects that a study already has, from which a search begins.

use lacuna::data::Parameter;
use lacuna::plugin::Forward;
use lacuna::plugin::effect::{Placed, with_tangents};
use lacuna::plugin::forward::Wanted;
use lacuna_linalg::Matrix;

/// A forward map whose parameters are those of another one, followed by the unknowns of effects on its response.
pub struct WithEffects<'a> {
    forward: &'a dyn Forward,
    effects: Vec<Placed<'a>>,
}

impl<'a> WithEffects<'a> {
    /// A forward map with effects.
    pub fn new(forward: &'a dyn Forward, effects: Vec<Placed<'a>>) -> Self {
        Self { forward, effects }
    }

    /// The unknowns: the parameters of the forward map, then the unknowns of the effects.
    pub fn parameters(&self, own: &[Parameter]) -> Vec<Parameter> {
        let unknowns = self.effects.iter().flat_map(Placed::hyperparameters);
        let parameter = |unknown: lacuna::plugin::Hyperparameter| Parameter {
            symbol: unknown.symbol,
            unit: unknown.unit,
            ..Parameter::plain(&unknown.name, unknown.prior)
        };
        own.iter().cloned().chain(unknowns.map(parameter)).collect()
    }

    /// Each effect with its values, taken from those of all unknowns.
    fn placed<'b>(&'b self, point: &'b [f64]) -> impl Iterator<Item = (&'b Placed<'b>, &'b [f64])> {
        let mut begin = self.forward.dimension();
        self.effects.iter().map(move |effect| {
            let own = begin..begin + effect.absent().len();
            begin = own.end;
            (effect, &point[own])
        })
    }

    /// The inner map's part of points.
    fn own(&self, points: &Matrix) -> Matrix {
        points.select_columns(&(0..self.forward.dimension()).collect::<Vec<_>>())
    }

    /// Responses of the inner map with the effects at these points.
    fn applied(&self, mut means: Matrix, points: &Matrix) -> Matrix {
        for i in 0..means.rows() {
            let point = points.row(i);
            let parameters = &point[..self.forward.dimension()];
            let response =
                self.placed(point).fold(means.row(i).to_vec(), |response, (effect, values)| {
                    effect.apply(&response, values, parameters)
                });
            means.row_mut(i).copy_from_slice(&response);
        }
        means
    }
}

impl Forward for WithEffects<'_> {
    fn dimension(&self) -> usize {
        self.forward.dimension() + self.effects.iter().map(|e| e.absent().len()).sum::<usize>()
    }

    fn outputs(&self) -> usize {
        self.forward.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.applied(self.forward.mean(&self.own(points)), points)
    }

    fn mean_at(&self, needed: &[bool], points: &Matrix) -> Matrix {
        self.applied(self.forward.mean_at(needed, &self.own(points)), points)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.mean_and_jacobian(point).1
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let parameters = &point[..self.forward.dimension()];
        let (mean, jacobian) = self.forward.mean_and_jacobian(parameters);
        let (response, tangents) = with_tangents(self.placed(point), mean, &jacobian, parameters);
        (response, tangents.transposed())
    }

    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        let d = self.forward.dimension();
        let parameters = wanted.parameters;
        let own: Vec<usize> = parameters.iter().copied().filter(|&i| i < d).collect();
        let inner = Wanted { parameters: &own, ..wanted };
        let (mean, jacobian) = self.forward.mean_and_jacobian_by(&point[..d], inner);
        let (response, tangents) = with_tangents(self.placed(point), mean, &jacobian, &point[..d]);
        // The derivatives by all unknowns of the effects come after those that were asked for.
        let mut seen = 0;
        let column = |&i: &usize| {
            seen += usize::from(i < d);
            if i < d { seen - 1 } else { own.len() + i - d }
        };
        let columns: Vec<usize> = parameters.iter().map(column).collect();
        (response, tangents.transposed().select_columns(&columns))
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}
