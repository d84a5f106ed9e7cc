//! The inputs, terms and options that `[gap]` names inside the model, as one extended model.

use std::sync::Arc;

use lacuna::data::Unit;
use lacuna::plugin::amend::{Addition, changed};
use lacuna::plugin::effect::Description;
use lacuna::plugin::identity::Plugin;
use lacuna::plugin::registry::{Identity, Section};
use lacuna::plugin::{Effect, Given, Model, registry};
use lacuna::run::Stop;
use toml::Table;

use super::narrow::RestrictedModels;
use super::terms;
use crate::gap::candidates::{Candidate, Untried};
use crate::gap::edit::{Edit, NewParameter};
use crate::gap::experiment::wider::FreeInput;
use crate::gap::system::switched::InputEffect;
use crate::stage::simulator::{Other, Simulator};
use crate::study::Study;
use crate::study::file::ModelKeys;
use crate::study::gap::{SwitchPlace, SwitchSection};

/// The pieces with the model that has all of them.
pub struct Pieces {
    /// The pieces, in the order of the candidates.
    pub all: Vec<Piece>,
    /// The inputs of the wider model that are free in some piece.
    pub inputs: Vec<FreeInput>,
    /// The terms of the library that fit some equation and could be made for none.
    pub untried: Vec<Untried>,
    whole: ExtendedModel,
    narrower: RestrictedModels,
}

/// The study's model with some of the pieces.
pub struct ExtendedModel {
    /// The inputs that are free.
    pub inputs: Vec<usize>,
    model: Section<dyn Model, ModelKeys>,
    given: Vec<Given>,
}

/// One piece.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// The type: the name of the input or of the term.
    pub kind: String,
    /// The description in words; the formula states which values are fixed by the type itself.
    pub description: Description,
    /// The indices of its inputs among those of all pieces, the size first.
    pub places: Vec<usize>,
    /// The summand of the equations; `None` for an input that is set free.
    pub addition: Option<Addition>,
    /// The place of an input that is one of several for the same physics.
    pub at: Option<SwitchPlace>,
    /// The number of forms among which it was chosen by the data; 1 for a piece that was stated beforehand.
    pub tried: usize,
}

impl Pieces {
    /// The pieces of a study; `None` if it has none, or no model.
    pub fn of(study: &Study) -> Result<Option<Self>, Stop> {
        let (mut all, mut inputs) = (Vec::new(), Vec::new());
        for switch in &study.gap.inside.switches {
            let (freed, description) = freed(study, switch)?;
            let kind = own_kind(&switch.input);
            let (places, at) = (vec![inputs.len()], switch.place.clone());
            all.push(Piece { kind, description, places, addition: None, at, tried: 1 });
            inputs.push(freed);
        }
        let untried = terms::add(study, &mut all, &mut inputs)?;
        Self::made(study, all, inputs, untried)
    }

    /// The pieces of a study, followed by others, each with its inputs: the indices of its places are those of its own
    /// inputs.
    pub fn with(
        study: &Study,
        further: Vec<(Piece, Vec<FreeInput>)>,
    ) -> Result<Option<Self>, Stop> {
        let own = Self::of(study)?;
        let (mut all, mut inputs, untried) =
            own.map_or_else(Default::default, |own| (own.all, own.inputs, own.untried));
        append(&mut all, &mut inputs, further);
        Self::made(study, all, inputs, untried)
    }

    /// These pieces alone, as in [`Pieces::with`].
    pub fn alone(
        study: &Study,
        pieces: Vec<(Piece, Vec<FreeInput>)>,
    ) -> Result<Option<Self>, Stop> {
        let (mut all, mut inputs) = (Vec::new(), Vec::new());
        append(&mut all, &mut inputs, pieces);
        Self::made(study, all, inputs, Vec::new())
    }

    fn made(
        study: &Study,
        all: Vec<Piece>,
        inputs: Vec<FreeInput>,
        untried: Vec<Untried>,
    ) -> Result<Option<Self>, Stop> {
        let every: Vec<usize> = (0..all.len()).collect();
        let whole = ExtendedModel::of(study, &all, &inputs, &every)?;
        let narrower = RestrictedModels::new();
        let whole = whole.filter(|_| !all.is_empty());
        Ok(whole.map(|whole| Self { all, inputs, untried, whole, narrower }))
    }

    /// The model with all pieces.
    pub fn whole(&self) -> &ExtendedModel {
        &self.whole
    }

    /// The models with some of the pieces.
    pub(super) fn narrower(&self) -> &RestrictedModels {
        &self.narrower
    }

    /// The model with these pieces.
    pub fn wider(&self, study: &Study, pieces: &[usize]) -> Result<Option<ExtendedModel>, Stop> {
        ExtendedModel::of(study, &self.all, &self.inputs, pieces)
    }

    /// The model with some of the pieces as a function of the study's parameters and the inputs that are free there.
    pub fn simulator<'a>(
        &'a self,
        study: &'a Study,
        wider: &'a ExtendedModel,
    ) -> Result<Simulator<'a>, Stop> {
        let free = wider.inputs.iter().map(|&i| &self.inputs[i]);
        let free: Vec<(&str, &Unit)> =
            free.map(|freed| (freed.name.as_str(), &freed.unit)).collect();
        Simulator::of_other(study, &Other { section: &wider.model, given: &wider.given, free })
    }

    /// Identity of the model with all pieces, for the hash of results made with it.
    pub(super) fn model(&self) -> (Plugin<Identity<'_>>, &ModelKeys) {
        let model = &self.whole.model;
        (model.built.identity(), &model.common)
    }

    /// The pieces as candidates of a search.
    pub fn candidates(&self) -> Vec<Candidate> {
        let candidate = |piece: &Piece| {
            let inputs = piece.places.iter().map(|&i| self.inputs[i].clone()).collect();
            let (places, description) = (piece.places.clone(), piece.description.clone());
            let effect: Arc<dyn Effect> = Arc::new(InputEffect { places, inputs, description });
            Candidate {
                kind: piece.kind.clone(),
                plugin: piece.kind.clone(),
                options: Table::new(),
                effect,
                odds: 1.0,
                contains: terms::contained(&piece.kind),
                tried: piece.tried,
                beside: Vec::new(),
            }
        };
        self.all.iter().map(candidate).collect()
    }

    /// The changes of the study that include the effects of these inputs; empty if no piece has them.
    ///
    /// `switches` are those of the effects that were found, as [`Effect::switches`] gives them.
    pub fn edit(&self, study: &Study, switches: &[&[usize]]) -> Edit {
        let mut edit = Edit::default();
        let mut additions = Vec::new();
        for piece in self.all.iter().filter(|piece| switches.contains(&&piece.places[..])) {
            additions.extend(piece.addition.clone());
            for freed in piece.places.iter().map(|&i| &self.inputs[i]) {
                edit.parameters.push(NewParameter {
                    name: freed.name.clone(),
                    unit: freed.unit.clone(),
                    prior: freed.prior.clone(),
                    reference: freed.absent,
                });
                edit.freed.push(freed.name.clone());
            }
        }
        let amend = study.model.as_ref().and_then(|model| model.built.plugin.amend());
        if let Some(amend) = amend.filter(|_| !additions.is_empty()) {
            edit.model = amend.amended(&additions);
        }
        edit
    }
}

impl ExtendedModel {
    fn of(
        study: &Study,
        all: &[Piece],
        inputs: &[FreeInput],
        pieces: &[usize],
    ) -> Result<Option<Self>, Stop> {
        let Some(section) = &study.model else { return Ok(None) };
        let additions: Vec<Addition> =
            pieces.iter().filter_map(|&p| all[p].addition.clone()).collect();
        let free: Vec<usize> = pieces.iter().flat_map(|&p| all[p].places.iter().copied()).collect();
        let mut given = study.given.clone();
        for freed in free.iter().map(|&i| &inputs[i]) {
            if !given.iter().any(|known| known.name == freed.name) {
                given.push(Given { name: freed.name.clone(), unit: Some(freed.unit.clone()) });
            }
        }
        let options = match section.built.plugin.amend() {
            Some(amend) => changed(&section.built.options, &amend.amended(&additions)),
            None => section.built.options.clone(),
        };
        let built = registry::from_text::<dyn Model>(section.built.name, &options.to_string())
            .map_err(|error| Stop::new(format!("the model with further terms: {error}")))?;
        let model = Section { common: section.common.clone(), built };
        Ok(Some(Self { inputs: free, model, given }))
    }
}

/// Appends pieces with their inputs.
fn append(
    all: &mut Vec<Piece>,
    inputs: &mut Vec<FreeInput>,
    further: Vec<(Piece, Vec<FreeInput>)>,
) {
    for (mut piece, own) in further {
        piece.places.iter_mut().for_each(|place| *place += inputs.len());
        all.push(piece);
        inputs.extend(own);
    }
}

/// A type for the name of an input, distinct from those of the library's effects.
fn own_kind(input: &str) -> String {
    let taken = registry::entries::<dyn Effect>().iter().any(|entry| entry.name == input);
    if taken { format!("switch_{input}") } else { input.to_owned() }
}

/// An input set free, with its absent value in its own unit.
fn freed(study: &Study, switch: &SwitchSection) -> Result<(FreeInput, Description), Stop> {
    let Some(held) = study.held(&switch.input) else {
        return Err(Stop::new(format!("the model holds no input `{}`", switch.input)));
    };
    let unit = switch.unit.clone().unwrap_or_else(|| held.input.unit.clone());
    let absent = held.input.unit.convert(held.value, &unit).ok_or_else(|| {
        Stop::new(format!("`{}` has no unit that converts to `{unit}`", switch.input))
    })?;
    let freed = FreeInput::new(&switch.input, unit.clone(), absent, switch.prior.clone());
    let description = Description {
        title: switch.title.clone().unwrap_or_else(|| held.input.description.clone()),
        formula: format!("`{}` of the model free instead of {absent} {unit}", switch.input)
            .trim_end()
            .to_owned(),
        source: "the model's own".to_owned(),
    };
    Ok((freed, description))
}
