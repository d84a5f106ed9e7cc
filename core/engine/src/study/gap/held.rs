//! Inputs of the model that a study holds at a value.

use lacuna::plugin::model::{Input, Signature};
use lacuna::plugin::{Context, Given, Model};

use crate::study::Study;

/// An input that is held.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// The input.
    pub input: Input,
    /// Value at which the input is held, in the input's unit.
    pub value: f64,
}

/// Why an input of the model is not held at a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::study) enum Loose {
    /// The model has no such input; those it has.
    Unknown(Vec<String>),
    /// A parameter sets it.
    Parameter,
    /// An expression sets it.
    Computed,
    /// Scenarios set it.
    Scenario,
    /// Nothing does.
    Unset,
}

impl Study {
    /// An input of the model that `fixed` or the model's default holds at a value under all conditions.
    pub fn held(&self, name: &str) -> Option<Held> {
        hold(self, name).ok()
    }

    /// True if the model has an input of this name.
    pub(in crate::study) fn has_input(&self, name: &str) -> bool {
        self.signature().is_some_and(|s| s.inputs.iter().any(|input| input.name == name))
    }

    fn signature(&self) -> Option<Signature> {
        self.signature_of(&*self.model.as_ref()?.built.plugin)
    }

    /// The signature of a model under the first conditions.
    pub fn signature_of(&self, model: &dyn Model) -> Option<Signature> {
        let (layout, _) = self.layouts.of_scenario(&self.scenarios.first()?.name)?;
        Some(model.signature(&self.context_of(&layout)))
    }

    /// True if the model has an input of this name once the study gives it, as a command or a function has.
    pub(in crate::study) fn takes(&self, name: &str) -> bool {
        let given = Given { name: name.to_owned(), unit: None };
        let given = [&self.given[..], &[given]].concat();
        let with = |model: &dyn Model| {
            let (layout, _) = self.layouts.of_scenario(&self.scenarios.first()?.name)?;
            Some(model.signature(&Context { given: &given, ..self.context_of(&layout) }))
        };
        let signature = self.model.as_ref().and_then(|model| with(&*model.built.plugin));
        signature.is_some_and(|signature| signature.inputs.iter().any(|input| input.name == name))
    }
}

/// The input that is held, or why it is not.
pub(in crate::study) fn hold(study: &Study, name: &str) -> Result<Held, Loose> {
    let Some(signature) = study.signature() else { return Err(Loose::Unknown(Vec::new())) };
    let names = || signature.inputs.iter().map(|input| input.name.clone()).collect();
    let input = signature.inputs.iter().find(|input| input.name == name);
    let input = input.ok_or_else(|| Loose::Unknown(names()))?.clone();
    let keys = study.model.as_ref().map(|model| &model.common);
    if keys.is_some_and(|keys| keys.computed.contains_key(name)) {
        return Err(Loose::Computed);
    }
    if study.unknowns.iter().any(|unknown| unknown.name == name) {
        return Err(Loose::Parameter);
    }
    if study.scenarios.iter().any(|scenario| scenario.value(name).is_some()) {
        return Err(Loose::Scenario);
    }
    let fixed = keys.and_then(|keys| keys.fixed.get(name)?.in_unit(&input.unit));
    let value = fixed.or(input.default).ok_or(Loose::Unset)?;
    Ok(Held { input, value })
}
