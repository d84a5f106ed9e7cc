//! A candidate inside a companion, as an effect on the response of the emulator.

use std::sync::Arc;

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Reach, SIMULATED, Situation, by_parameter_steps_of};
use lacuna::plugin::{Component, Effect, Forward, Hyperparameter};
use lacuna::run::{Fault, Stop};
use lacuna_linalg::Matrix;
use toml::Table;

use super::memory::Memory;
use crate::gap::candidates::Candidate;
use crate::gap::inside::pieces::{ExtendedModel, Pieces};
use crate::gap::result::IN_COMPANION;
use crate::gap::result::companion::IdentifiedCompanion;
use crate::gap::system::switched::InputEffect;
use crate::stage::direct::ModelMap;
use crate::stage::simulator::Simulator;
use crate::study::Study;
use crate::study::gap::companion::Companion;

/// A companion without candidates.
pub(super) struct BareCompanion {
    study: Arc<Study>,
    constants: Vec<f64>,
    /// The number of parameters of the study.
    own: usize,
    of_changes: f64,
    /// Responses without candidates.
    known: Memory,
    fault: Arc<Fault>,
}

/// A candidate inside a companion. Its change depends on the study's parameters, the first of those of the forward map.
pub(super) struct CompanionEffect {
    bare: Arc<BareCompanion>,
    pieces: Arc<Pieces>,
    model: ExtendedModel,
    inner: InputEffect,
    /// Responses with it.
    known: Memory,
}

impl BareCompanion {
    pub fn new(companion: &Companion, found: &IdentifiedCompanion) -> Self {
        Self {
            study: Arc::clone(&companion.study),
            constants: found.constants.clone(),
            own: companion.own(),
            of_changes: found.of_changes,
            known: Memory::default(),
            fault: Arc::new(Fault::new("the companion")),
        }
    }

    /// The response at a point of the study's parameters, one value per output; not finite if there is none.
    fn response(&self, parameters: &[f64]) -> Arc<Vec<f64>> {
        let point = [parameters, &self.constants].concat();
        self.known.or(&point, || {
            let none = || Stop::new("the companion has no model");
            let simulator = Simulator::of(&self.study).and_then(|own| own.ok_or_else(none));
            self.evaluated(simulator, &point)
        })
    }

    fn evaluated(&self, simulator: Result<Simulator<'_>, Stop>, point: &[f64]) -> Vec<f64> {
        let outputs = self.study.layouts.len();
        let simulator = match simulator {
            Ok(simulator) => simulator,
            Err(stop) => {
                self.fault.report(stop);
                return vec![f64::NAN; outputs];
            }
        };
        // Only the widths of derivatives, which are not taken here, depend on the priors.
        let priors = vec![Distribution::Uniform([0.0, 1.0]); point.len()];
        let map = ModelMap::with(simulator, priors, outputs);
        let response = map.mean(&Matrix::from_vec(1, point.len(), point.to_vec())).into_vec();
        if let Some(fatal) = map.failure() {
            self.fault.report(fatal);
        }
        response
    }
}

impl CompanionEffect {
    /// Piece `p` of a companion as a candidate of a search.
    pub fn candidate(
        bare: &Arc<BareCompanion>,
        pieces: &Arc<Pieces>,
        p: usize,
    ) -> Result<Candidate, Stop> {
        let piece = &pieces.all[p];
        let model = pieces
            .wider(&bare.study, &[p])?
            .ok_or_else(|| Stop::new("the companion has no model"))?;
        let inputs = piece.places.iter().map(|&i| pieces.inputs[i].clone()).collect();
        // The places are those of an extended map, which is not used: each candidate has a model of its own.
        let inner =
            InputEffect { places: Vec::new(), inputs, description: piece.description.clone() };
        let (bare, pieces) = (Arc::clone(bare), Arc::clone(pieces));
        // An input has its own name, also where an effect on the response has the same: both are the same physics.
        let kind = match &piece.addition {
            None => pieces.inputs[piece.places[0]].name.clone(),
            Some(_) => piece.kind.clone(),
        };
        let known = Memory::default();
        let effect: Arc<dyn Effect> = Arc::new(Self { bare, pieces, model, inner, known });
        Ok(Candidate { kind, plugin: IN_COMPANION.to_owned(), options: Table::new(), effect })
    }

    /// The change of the response, one value per output of the study.
    fn change(&self, values: &[f64], point: &[f64]) -> Vec<f64> {
        let own = &point[..self.bare.own];
        let without = self.bare.response(own);
        let point = [own, &self.bare.constants, values].concat();
        let with = self.known.or(&point, || {
            self.bare.evaluated(self.pieces.simulator(&self.bare.study, &self.model), &point)
        });
        with.iter().zip(without.iter()).map(|(a, b)| a - b).collect()
    }

    /// The part of a change that belongs to a block.
    fn part<'c>(&self, layout: &Layout, change: &'c [f64]) -> &'c [f64] {
        let mut parts = self.bare.study.layouts.parts();
        parts.find(|(block, _)| *block == layout).map_or(&[], |(_, range)| &change[range])
    }
}

impl Component for CompanionEffect {
    fn faults(&self) -> Vec<Arc<Fault>> {
        vec![Arc::clone(&self.bare.fault)]
    }
}

impl Effect for CompanionEffect {
    fn describe(&self) -> Description {
        self.inner.describe()
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        self.inner.parameters(layout)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        self.inner.absent(layout)
    }

    /// The response is returned unchanged: without a point of the parameters the companion has no answer.
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
        if values[0] == self.inner.inputs[0].absent {
            return response.to_vec();
        }
        let change = self.change(values, point);
        response.iter().zip(self.part(layout, &change)).map(|(y, d)| y + d).collect()
    }

    fn by_parameters_at(
        &self,
        layout: &Layout,
        _response: &[f64],
        values: &[f64],
        point: &[f64],
    ) -> Matrix {
        let change = |values: &[f64]| self.part(layout, &self.change(values, point)).to_vec();
        by_parameter_steps_of(&self.parameters(layout), layout.len(), values, SIMULATED, change)
    }

    /// The change is added, and its own slopes by the parameters are of second order: they are left out.
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
        self.bare.of_changes
    }
}
