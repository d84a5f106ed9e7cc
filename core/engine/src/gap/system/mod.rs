//! A system: a forward map with effects, one vector of unknowns, the response and its derivatives.

mod ascent;
pub(in crate::gap) mod coordinate;
pub mod emulator_error;
pub mod fit;
pub mod noise_scale;
pub mod remainder;
pub(in crate::gap) mod step;
pub mod switched;
pub mod whitener;
mod window;

use std::ops::Range;

use lacuna::math::distribution::Distribution;
use lacuna::plugin::Forward;
use lacuna::plugin::effect::{Placed, with_tangents};
use lacuna::plugin::forward::Wanted;
use lacuna_linalg::Matrix;

use self::coordinate::Coordinate;
use self::fit::precision;
use super::experiment::Experiment;
use super::experiment::wider::ExtendedMap;
use super::noise::ResponseTangents;

/// The experiment's forward map with effects: on the model, through inputs of the [extended](Experiment::wide) forward
/// map, and on its response. The unknowns are the experiment's parameters, then those of the effects.
#[derive(Clone)]
pub struct System<'a> {
    /// The experiment.
    pub experiment: &'a Experiment<'a>,
    /// The effects: those on the response in the order in which they act.
    pub effects: Vec<Placed<'a>>,
    priors: Vec<Distribution>,
    coordinates: Vec<Coordinate>,
    /// The outputs that are needed; `None` for all.
    needed: Option<Vec<bool>>,
}

/// The response at a point with its derivatives.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// The unknowns, in their units.
    pub point: Vec<f64>,
    /// The response, one value an output, in its unit.
    pub response: Vec<f64>,
    /// The derivatives of the response, `unknowns x outputs`.
    pub tangents: Matrix,
}

impl<'a> System<'a> {
    /// The response at a point, `outputs`, with the changes that the unknowns can make to it, `unknowns x outputs`, in
    /// units of the widths of their priors, as input of the estimation of noise.
    pub fn around(&self, at: &Linearised) -> ResponseTangents {
        let widths: Vec<f64> = self.priors().iter().map(|p| 1.0 / precision(p).sqrt()).collect();
        let slopes = Matrix::from_fn(at.tangents.rows(), at.tangents.columns(), |j, i| {
            widths[j] * at.tangents[(j, i)]
        });
        ResponseTangents { response: at.response.clone(), slopes }
    }

    /// The system of an experiment with these effects.
    pub fn new(experiment: &'a Experiment<'a>, effects: Vec<Placed<'a>>) -> Self {
        let own = experiment.parameters.iter().map(|p| p.prior.clone());
        let mut priors: Vec<Distribution> = own.collect();
        for effect in &effects {
            priors.extend(effect.hyperparameters().into_iter().map(|h| h.prior));
        }
        let coordinates = priors.iter().map(Coordinate::of).collect();
        Self { experiment, effects, priors, coordinates, needed: None }
    }

    /// The system with one more effect.
    pub fn with(&self, effect: Placed<'a>) -> Self {
        let mut effects = self.effects.clone();
        effects.push(effect);
        Self::new(self.experiment, effects)
    }

    /// The same where only some outputs are needed; its responses may be any finite numbers at the others.
    #[must_use]
    pub fn at_outputs(&self, needed: Vec<bool>) -> Self {
        Self { needed: Some(needed), ..self.clone() }
    }

    /// The number of unknowns.
    pub fn dimension(&self) -> usize {
        self.priors.len()
    }

    /// The prior of each unknown.
    pub fn priors(&self) -> &[Distribution] {
        &self.priors
    }

    /// The coordinate in which each unknown is searched.
    pub(in crate::gap) fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// The lower and the upper bound of each unknown.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let region = self.experiment.region.as_ref();
        let bound = |(j, prior): (usize, &Distribution)| {
            let (low, high) = prior.support();
            region.and_then(|r| r.get(j)).map_or((low, high), |r| (low.max(r.0), high.min(r.1)))
        };
        self.priors.iter().enumerate().map(bound).collect()
    }

    /// The log prior density of all unknowns.
    pub fn log_prior(&self, point: &[f64]) -> f64 {
        self.priors.iter().zip(point).map(|(prior, &x)| prior.log_density(x)).sum()
    }

    /// The response at a point, one value per output; not finite if the forward map has no response.
    pub fn response(&self, point: &[f64]) -> Vec<f64> {
        self.responses(&[point]).remove(0)
    }

    /// The responses at several points, in their order.
    pub fn responses<P: AsRef<[f64]>>(&self, points: &[P]) -> Vec<Vec<f64>> {
        let columns = self.input(&vec![0.0; self.dimension()]).len();
        let inputs = points.iter().map(|p| self.input(p.as_ref()));
        let inputs = Matrix::from_rows(columns, inputs);
        let means = match &self.needed {
            Some(needed) => self.forward().mean_at(needed, &inputs),
            None => self.forward().mean(&inputs),
        };
        let with_effects = |(mean, point): (&[f64], &P)| {
            let mut response = mean.to_vec();
            let point = point.as_ref();
            for (effect, own) in self.on_the_response() {
                response = effect.apply(&response, &point[own], self.parameters(point));
            }
            response
        };
        means.iter_rows().zip(points).map(with_effects).collect()
    }

    /// The response at a point with its derivatives by all unknowns.
    pub fn linearised(&self, point: &[f64]) -> Linearised {
        let d = self.experiment.parameters.len();
        // The unknowns whose derivatives are known, each with its column of the forward map.
        let mut moved: Vec<(usize, usize)> = (0..d).map(|j| (j, j)).collect();
        for (effect, own) in self.on_the_model() {
            moved.extend(own.zip(effect.effect.switches()).map(|(unknown, i)| (unknown, d + i)));
        }
        let columns: Vec<usize> = moved.iter().map(|(_, column)| *column).collect();
        let input = self.input(point);
        let wanted = Wanted { parameters: &columns, outputs: self.needed.as_deref() };
        let (mean, jacobian) = self.forward().mean_and_jacobian_by(&input, wanted);
        let on_top = self.on_the_response().map(|(effect, own)| (effect, &point[own]));
        let (response, rows) = with_tangents(on_top, mean, &jacobian, self.parameters(point));
        let mut unknowns: Vec<usize> = moved.iter().map(|(unknown, _)| *unknown).collect();
        unknowns.extend(self.on_the_response().flat_map(|(_, own)| own));
        let mut tangents = Matrix::zeros(unknowns.len(), response.len());
        for (row, unknown) in rows.iter_rows().zip(unknowns) {
            tangents.row_mut(unknown).copy_from_slice(row);
        }
        Linearised { point: point.to_vec(), response, tangents }
    }

    /// The parameters of the forward map at these unknowns.
    pub fn parameters<'p>(&self, point: &'p [f64]) -> &'p [f64] {
        &point[..self.experiment.parameters.len()]
    }

    /// The extended forward map, if an effect needs it.
    fn wide(&self) -> Option<&'a ExtendedMap<'a>> {
        self.experiment.wide.filter(|_| self.on_the_model().next().is_some())
    }

    fn forward(&self) -> &dyn Forward {
        self.wide().map_or(self.experiment.forward, |wide| &*wide.forward)
    }

    /// The point of the forward map at these unknowns.
    fn input(&self, point: &[f64]) -> Vec<f64> {
        let d = self.experiment.parameters.len();
        let mut input = point[..d].to_vec();
        let Some(wide) = self.wide() else { return input };
        input.extend(wide.inputs.iter().map(|freed| freed.absent));
        for (effect, own) in self.on_the_model() {
            for (i, x) in effect.effect.switches().iter().zip(&point[own]) {
                input[d + i] = *x;
            }
        }
        input
    }

    /// Each effect with the places of its unknowns.
    fn places(&self) -> impl Iterator<Item = (&Placed<'a>, Range<usize>)> {
        let mut begin = self.experiment.parameters.len();
        self.effects.iter().map(move |effect| {
            let own = begin..begin + effect.absent().len();
            begin = own.end;
            (effect, own)
        })
    }

    fn on_the_model(&self) -> impl Iterator<Item = (&Placed<'a>, Range<usize>)> {
        self.places().filter(|(effect, _)| !effect.effect.switches().is_empty())
    }

    /// The effects on the response in the order in which they act: physics of the model comes first.
    fn on_the_response(&self) -> impl Iterator<Item = (&Placed<'a>, Range<usize>)> {
        let of = |first: bool| {
            self.places().filter(move |(effect, _)| {
                effect.effect.switches().is_empty() && effect.effect.acts_first() == first
            })
        };
        of(true).chain(of(false))
    }
}
