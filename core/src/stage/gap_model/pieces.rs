//! What `[gap]` says of the inside of the model, as one wider model with further inputs.

use std::sync::Arc;

use toml::Table;

use crate::data::Unit;
use crate::gap::candidates::Candidate;
use crate::gap::wide::{Freed, Switched};
use crate::plugin::amend::{Addition, changed};
use crate::plugin::effect::Description;
use crate::plugin::registry::{self, Identity, Section};
use crate::plugin::{Effect, Given, Model};
use crate::run::Stop;
use crate::run::made_by::Plugin;
use crate::stage::simulator::{Other, Simulator};
use crate::study::Study;
use crate::study::file::ModelKeys;
use crate::study::gap::{Added, Edit, SwitchSection};

use super::narrow::Narrower;
use super::terms;

/// The pieces with the model that has all of them.
pub struct Pieces {
    /// The pieces, in the order of the candidates.
    pub all: Vec<Piece>,
    /// The inputs of the wider model that are free in some piece.
    pub inputs: Vec<Freed>,
    whole: Wider,
    narrower: Narrower,
}

/// The study's model with some of the pieces.
pub struct Wider {
    /// The inputs that are free.
    pub inputs: Vec<usize>,
    model: Section<dyn Model, ModelKeys>,
    given: Vec<Given>,
}

/// One piece.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Its type: the name of the input or of the term.
    pub kind: String,
    /// What it is, in words; the formula says what is fixed by itself.
    pub description: Description,
    /// Its inputs among those of all, the size first.
    pub places: Vec<usize>,
    /// What it adds to the equations, if it does.
    pub addition: Option<Addition>,
}

impl Pieces {
    /// The pieces of a study; `None` where it has none, or no model.
    pub fn of(study: &Study) -> Result<Option<Self>, Stop> {
        let (mut all, mut inputs) = (Vec::new(), Vec::new());
        for switch in &study.gap.inside.switches {
            let (freed, description) = freed(study, switch)?;
            let kind = own_kind(&switch.input);
            all.push(Piece { kind, description, places: vec![inputs.len()], addition: None });
            inputs.push(freed);
        }
        terms::add(study, &mut all, &mut inputs)?;
        let every: Vec<usize> = (0..all.len()).collect();
        let whole = Wider::of(study, &all, &inputs, &every)?;
        let narrower = Narrower::new(all.len());
        let whole = whole.filter(|_| !all.is_empty());
        Ok(whole.map(|whole| Self { all, inputs, whole, narrower }))
    }

    /// The model with all pieces.
    pub fn whole(&self) -> &Wider {
        &self.whole
    }

    /// The models with few of the pieces.
    pub(super) fn narrower(&self) -> &Narrower {
        &self.narrower
    }

    /// The model with these pieces.
    pub fn wider(&self, study: &Study, pieces: &[usize]) -> Result<Option<Wider>, Stop> {
        Wider::of(study, &self.all, &self.inputs, pieces)
    }

    /// The model with some of the pieces as a function of the study's parameters and the inputs that are free there.
    pub fn simulator<'a>(
        &'a self,
        study: &'a Study,
        wider: &'a Wider,
    ) -> Result<Simulator<'a>, Stop> {
        let free = wider.inputs.iter().map(|&i| &self.inputs[i]);
        let free: Vec<(&str, &Unit)> =
            free.map(|freed| (freed.name.as_str(), &freed.unit)).collect();
        Simulator::of_other(study, &Other { section: &wider.model, given: &wider.given, free })
    }

    /// What the wider model is, for the hash of what is made with it.
    pub(super) fn model(&self) -> (Plugin<Identity<'_>>, &ModelKeys) {
        let model = &self.whole.model;
        (model.built.identity(), &model.common)
    }

    /// The pieces as candidates of a search.
    pub fn candidates(&self) -> Vec<Candidate> {
        let candidate = |piece: &Piece| {
            let inputs = piece.places.iter().map(|&i| self.inputs[i].clone()).collect();
            let (places, description) = (piece.places.clone(), piece.description.clone());
            let effect: Arc<dyn Effect> = Arc::new(Switched { places, inputs, description });
            Candidate {
                kind: piece.kind.clone(),
                plugin: piece.kind.clone(),
                options: Table::new(),
                effect,
            }
        };
        self.all.iter().map(candidate).collect()
    }

    /// What the study must say for the effects of these inputs; none where no piece has them.
    ///
    /// `switches` are those of the effects that were found, as [`Effect::switches`] gives them.
    pub fn edit(&self, study: &Study, switches: &[&[usize]]) -> Edit {
        let mut edit = Edit::default();
        let mut additions = Vec::new();
        for piece in self.all.iter().filter(|piece| switches.contains(&&piece.places[..])) {
            additions.extend(piece.addition.clone());
            for freed in piece.places.iter().map(|&i| &self.inputs[i]) {
                edit.parameters.push(Added {
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

impl Wider {
    fn of(
        study: &Study,
        all: &[Piece],
        inputs: &[Freed],
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

/// A type of an input's name that no effect of the library has.
fn own_kind(input: &str) -> String {
    let taken = registry::entries::<dyn Effect>().iter().any(|entry| entry.name == input);
    if taken { format!("switch_{input}") } else { input.to_owned() }
}

/// An input set free, with its absent value in its own unit.
fn freed(study: &Study, switch: &SwitchSection) -> Result<(Freed, Description), Stop> {
    let Some(held) = study.held(&switch.input) else {
        return Err(Stop::new(format!("the model holds no input `{}`", switch.input)));
    };
    let unit = switch.unit.clone().unwrap_or_else(|| held.input.unit.clone());
    let absent = held.input.unit.convert(held.value, &unit).ok_or_else(|| {
        Stop::new(format!("`{}` has no unit that converts to `{unit}`", switch.input))
    })?;
    let freed = Freed::new(&switch.input, unit.clone(), absent, switch.prior.clone());
    let description = Description {
        title: switch.title.clone().unwrap_or_else(|| held.input.description.clone()),
        formula: format!("`{}` of the model free instead of {absent} {unit}", switch.input)
            .trim_end()
            .to_owned(),
        source: "the model's own".to_owned(),
    };
    Ok((freed, description))
}
