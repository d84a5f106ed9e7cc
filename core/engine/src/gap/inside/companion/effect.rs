//! A candidate inside a companion, as an effect on the response of the emulator.

use std::collections::BTreeMap;
use std::sync::Arc;

use lacuna::math::random::Stream;
use lacuna::plugin::effect::Description;
use lacuna::plugin::{Effect, Forward};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use toml::Table;

use super::learned::{Basis, LearnedChange, Region};
use super::line::Line;
use super::reach::Reach;
use crate::gap::candidates::{Candidate, Untried};
use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::change::{Change, ChangeEffect};
use crate::gap::inside::pieces::{Piece, Pieces};
use crate::gap::inside::terms;
use crate::gap::result::IN_COMPANION;
use crate::gap::result::companion::IdentifiedCompanion;
use crate::gap::system::switched::InputEffect;
use crate::stage::direct::ModelMap;
use crate::study::gap::Companion;

/// The candidates inside a companion.
#[derive(Default)]
pub struct CompanionCandidates {
    /// The candidates.
    pub candidates: Vec<Candidate>,
    /// Those whose change could not be learned.
    pub untried: Vec<Untried>,
}

/// A companion with its constants, from which changes are learned near a point of the study's parameters.
pub(super) struct Learning<'a> {
    pub companion: &'a Companion,
    pub found: &'a IdentifiedCompanion,
    pub pieces: &'a Pieces,
    pub region: Region,
    /// The point of the study's parameters in the middle of the region.
    pub point: Vec<f64>,
    pub extent: Extent,
    pub random: Stream,
}

/// The extent of the sizes for which changes are learned.
pub(super) enum Extent {
    /// As large as changes of the response of this root mean square, in its unit, that the parameters cannot make up for.
    Change(f64),
    /// As far from absence as these sizes by the names of candidates; for others as far as their priors.
    Sizes(BTreeMap<String, f64>),
}

impl Learning<'_> {
    /// The candidates with these names, or all.
    pub fn candidates(&self, wanted: impl Fn(&str) -> bool) -> Result<CompanionCandidates, Stop> {
        let study = &self.companion.study;
        let bare = ModelMap::of(study)?;
        let mut without = Matrix::zeros(0, study.layouts.len());
        let mut all = CompanionCandidates::default();
        let reach = Reach::new(self, &bare)?;
        let mut lines: Vec<Line> = Vec::new();
        for (p, piece) in self.pieces.all.iter().enumerate() {
            let kind = self.kind(piece);
            if !wanted(&kind) {
                continue;
            }
            let inputs: Vec<FreeInput> =
                piece.places.iter().map(|&i| self.pieces.inputs[i].clone()).collect();
            let model = self.pieces.wider(study, &[p])?;
            let model = model.ok_or_else(|| Stop::new("the companion has no model"))?;
            let priors = study.parameters.iter().map(|p| p.prior.clone());
            let priors = priors.chain(inputs.iter().map(|i| i.prior.clone())).collect();
            let simulator = self.pieces.simulator(study, &model)?;
            let map = ModelMap::with(simulator, priors, study.layouts.len());
            let far = reach.of(&kind, &inputs, &map)?;
            let basis = Basis::new(self.region.clone(), &inputs, far);
            let points = basis.points(&self.random);
            // All candidates are learned at the same points of the parameters.
            if points.len() > without.rows() {
                without = self.answers(&bare, points.iter().map(|(own, _)| (own, &[][..])))?;
            }
            let with = self.answers(&map, points.iter().map(|(own, values)| (own, &values[..])))?;
            let difference = |i: usize| -> Vec<f64> {
                with.row(i).iter().zip(without.row(i)).map(|(a, b)| a - b).collect()
            };
            let differences: Vec<Vec<f64>> = (0..points.len()).map(difference).collect();
            match (LearnedChange::of(basis, &points, &differences), &piece.at) {
                (Some(change), Some(place)) => {
                    Line::add(&mut lines, kind, place.at, piece, inputs, change);
                }
                (Some(change), None) => {
                    let description = piece.description.clone();
                    all.candidates.push(self.candidate(kind, description, inputs, change));
                }
                (None, _) => all.untried.push(Untried {
                    kind,
                    reason: format!(
                        "the companion has no answer for most of its values{}",
                        map.tally().map_or(String::new(), |why| format!(": {why}"))
                    ),
                }),
            }
        }
        for line in lines {
            let Line { kind, description, inputs, places } = line.sorted();
            all.candidates.push(self.candidate(kind, description, inputs, places));
        }
        Ok(all)
    }

    /// The type: an input has its own name, also where an effect on the response has the same, for both are the same
    /// physics.
    fn kind(&self, piece: &Piece) -> String {
        match (&piece.addition, &piece.at) {
            (None, Some(place)) => place.of.as_str().to_owned(),
            (None, None) => self.pieces.inputs[piece.places[0]].name.clone(),
            (Some(_), _) => piece.kind.clone(),
        }
    }

    /// The responses of a map at points of the study's parameters and values of its inputs.
    pub fn answers<'p>(
        &self,
        map: &ModelMap<'_>,
        points: impl Iterator<Item = (&'p Vec<f64>, &'p [f64])>,
    ) -> Result<Matrix, Stop> {
        let rows = points.map(|(own, values)| [own, &self.found.constants[..], values].concat());
        let answers = map.mean(&Matrix::from_rows(map.dimension(), rows));
        match map.failure() {
            Some(fatal) => Err(Stop::new(format!("the companion: {fatal}"))),
            None => Ok(answers),
        }
    }

    fn candidate(
        &self,
        kind: String,
        description: Description,
        inputs: Vec<FreeInput>,
        change: impl Change + 'static,
    ) -> Candidate {
        // The places are those of an extended map, which is not used.
        let inner = InputEffect { places: Vec::new(), inputs, description };
        let effect: Arc<dyn Effect> = Arc::new(ChangeEffect {
            change,
            own: self.companion.own(),
            layouts: self.companion.study.layouts.clone(),
            inner,
            relative_error: self.found.of_changes,
        });
        Candidate {
            contains: terms::contained(&kind),
            tried: 1,
            beside: Vec::new(),
            kind,
            plugin: IN_COMPANION.to_owned(),
            options: Table::new(),
            odds: 1.0,
            effect,
        }
    }
}
