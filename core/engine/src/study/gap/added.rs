//! Candidates of `[gap]` that are part of the study: their changes are added to every response.

use std::sync::{Arc, OnceLock};

use lacuna::data::Layout;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Effect, Hyperparameter};
use lacuna::run::Fault;
use toml::Table;

/// A candidate that is part of the study.
pub struct AddedCandidate {
    /// Name.
    pub name: String,
    /// Effect on the response.
    pub effect: Arc<dyn Effect>,
    /// Hash of everything from which the effect was learned.
    pub origin: String,
}

/// The effects of such candidates, which are learned when the study runs.
#[derive(Default)]
pub struct Added(OnceLock<Vec<AddedCandidate>>);

impl Added {
    /// Sets the effects; later calls have no effect.
    pub fn set(&self, effects: Vec<AddedCandidate>) {
        let _ = self.0.set(effects);
    }

    /// The effects. Without [`set`](Self::set), those of these names report a fault, so that no result is computed without
    /// them.
    pub fn of<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> &[AddedCandidate] {
        let unset = |name: &str| AddedCandidate {
            name: name.to_owned(),
            effect: Arc::new(Unset::new(name)),
            origin: String::new(),
        };
        self.0.get_or_init(|| names.into_iter().map(unset).collect())
    }
}

/// The place of an added candidate whose effect was not set.
struct Unset(Arc<Fault>);

impl Unset {
    fn new(name: &str) -> Self {
        let fault = Fault::new(format!("the candidate `{name}` that is part of the study"));
        fault.report("its effect was not built before it was used");
        Self(Arc::new(fault))
    }
}

impl Component for Unset {
    fn faults(&self) -> Vec<Arc<Fault>> {
        vec![Arc::clone(&self.0)]
    }
}

impl Effect for Unset {
    fn describe(&self) -> Description {
        Description::new("not built", "", "")
    }

    fn parameters(&self, _layout: &Layout) -> Vec<Hyperparameter> {
        Vec::new()
    }

    fn absent(&self, _layout: &Layout) -> Vec<f64> {
        Vec::new()
    }

    fn apply(&self, _layout: &Layout, response: &[f64], _values: &[f64]) -> Vec<f64> {
        vec![f64::NAN; response.len()]
    }

    fn starts(&self, _layout: &Layout, _situation: &Situation<'_>) -> Vec<Vec<f64>> {
        Vec::new()
    }

    fn proposals(&self, _situation: &Situation<'_>) -> Vec<Table> {
        Vec::new()
    }
}
