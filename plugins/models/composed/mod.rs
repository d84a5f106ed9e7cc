//! `composed`: models in a chain, in which the output of one is an input of those after it.

mod handed;
mod part;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lacuna::data::{Condition, Layout, Scenario, Unit};
use lacuna::plugin::model::{Call, EvalError, Input, Response, Signature};
use lacuna::plugin::{Component, Context, Fact, Given, Library, Model};
use lacuna::run::Fault;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{given, nested};
use handed::{Handed, announce, handed};
use part::{Part, pass_on};

/// Models in a chain, in which the output of each is an input of those after it, as from load to response to sensor.
/// A part is exchanged by changing its `use`.
///
/// Each entry of `parts` is a model of any kind with its options, a `name`, and, for all but the last, its output
/// `gives`: `name`, `unit` and `axes` as in `[response]`. The parts after it receive that output
///
/// - as an input with the output's name, if it has no axes; with the name of each label, if it has one axis of
///   labels;
/// - as a function with the output's name, if it has one numeric axis (in `equations` it is called as `force(t)`; a
///   command finds it in its JSON); with the name of each label, if an axis of labels precedes the numeric one.
///
/// An input of a part that no earlier part gives is an input of the chain. For a model that accepts any inputs (a
/// command, a Python function, a server) `takes` lists those it receives. The last part gives the response.
/// Derivatives are computed by finite differences.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Composed {
    /// Parts, in the order in which they are computed.
    pub parts: Vec<Part>,
}

/// Layout requested from a part: its own, or the study's from the last.
fn asked(part: &Part, name: &str, last: bool, study: &Layout) -> Result<Layout, String> {
    match (part.gives()?, last) {
        (Some(layout), false) => Ok(layout),
        (None, true) => Ok(study.clone()),
        (None, false) => Err(format!("part `{name}` needs the option `gives`, its response")),
        (Some(_), true) => Err(format!(
            "part `{name}` is the last and gives the study's response: leave out `gives`"
        )),
    }
}

/// A part that does not fit in its chain.
struct Misfit {
    /// Index of the part.
    part: usize,
    reason: String,
}

/// A part with everything needed to evaluate it.
struct Link<'a> {
    model: &'a dyn Model,
    name: String,
    /// Layout requested from the part; the study's own for the last.
    asked: Layout,
    signature: Signature,
    /// Quantities that it passes on; none for the last.
    handed: Vec<Handed>,
}

impl Composed {
    /// Links the leading parts whose options are valid, in the context of the study; the error describes what does
    /// not fit.
    fn links<'a>(&'a self, context: &Context<'_>) -> Result<Vec<Link<'a>>, Misfit> {
        let mut given = context.given.to_vec();
        let mut scenarios = context.scenarios.to_vec();
        let mut links = Vec::new();
        for (i, part) in self.parts.iter().enumerate() {
            let Ok(section) = part.section() else { break };
            let misfit = |reason| Misfit { part: i, reason };
            let name = section.common.name.as_str().to_owned();
            let last = i + 1 == self.parts.len();
            let asked = asked(part, &name, last, context.layout).map_err(misfit)?;
            let seen =
                part.seen(&given).map_err(|what| misfit(format!("part `{name}`: {what}")))?;
            let own = Context {
                given: &seen,
                scenarios: &scenarios,
                layout: &asked,
                ..Context::new(context.directory, context.parameters, &asked)
            };
            let model = &*section.built.plugin;
            let signature = model.signature(&own);
            let handed = if last { Vec::new() } else { handed(&asked).map_err(misfit)? };
            announce(&handed, &mut given, &mut scenarios);
            links.push(Link { model, name, asked, signature, handed });
        }
        Ok(links)
    }

    /// Returns the inputs of the chain: those of the parts that no earlier part gives.
    fn inputs(links: &[Link<'_>]) -> Vec<Input> {
        let mut known: Vec<&str> = Vec::new();
        let mut inputs: Vec<Input> = Vec::new();
        for link in links {
            for input in &link.signature.inputs {
                let there = inputs.iter().any(|other| other.name == input.name);
                if !there && !known.contains(&input.name.as_str()) {
                    inputs.push(input.clone());
                }
            }
            known.extend(link.handed.iter().map(|output| output.name.as_str()));
        }
        inputs
    }
}

/// Data available to the next part.
struct State {
    /// Names, values and units of the quantities that set inputs.
    values: Vec<(String, f64, Unit)>,
    scenario: Scenario,
}

impl Link<'_> {
    /// Evaluates the part.
    fn answer(
        &self,
        state: &State,
        study: &Path,
        directory: Option<&Path>,
    ) -> Result<Response, EvalError> {
        let fatal = |what: String| EvalError::Fatal(format!("part `{}`: {what}", self.name));
        let mut inputs = Vec::new();
        let mut names = Vec::new();
        for input in &self.signature.inputs {
            let set = state.values.iter().find(|(name, ..)| name == &input.name);
            let value = match set {
                Some((_, value, unit)) => unit
                    .convert(*value, &input.unit)
                    .ok_or_else(|| fatal(format!("`{}` has another unit", input.name)))?,
                None => {
                    input.default.ok_or_else(|| fatal(format!("nothing sets `{}`", input.name)))?
                }
            };
            inputs.push(value);
            names.push(input.name.clone());
        }
        let units: Vec<Unit> = self.signature.inputs.iter().map(|i| i.unit.clone()).collect();
        let folder = directory.map(|folder| folder.join(&self.name));
        let call = Call {
            inputs: &inputs,
            names: &names,
            units: &units,
            layout: &self.asked,
            scenario: &state.scenario,
            study,
            directory: folder.as_deref(),
        };
        let named = |text: String| format!("part `{}`: {text}", self.name);
        let response = self.model.predict(&call).map_err(|error| match error {
            EvalError::Rejected(reason) => EvalError::Rejected(named(reason)),
            EvalError::Fatal(reason) => EvalError::Fatal(named(reason)),
        })?;
        if let Some(i) = response.values.iter().position(|y| !y.is_finite()) {
            let (value, place) = (response.values[i], self.asked.describe(i));
            return Err(EvalError::Rejected(named(format!("the response is {value} at {place}"))));
        }
        Ok(response)
    }

    /// Makes the response available to the parts after.
    fn hand_on(&self, response: &Response, state: &mut State) {
        for output in &self.handed {
            let length = output.grid.as_ref().map_or(1, |(at, _)| at.len());
            let values = &response.values[output.begin..output.begin + length];
            if let Some(function) = output.function(values) {
                state.scenario.functions.retain(|known| known.name != output.name);
                state.scenario.functions.push(Arc::new(function));
            } else {
                let (name, value, unit) = (output.name.clone(), values[0], output.unit.clone());
                state.values.retain(|(known, ..)| known != &name);
                state.values.push((name.clone(), value, unit.clone()));
                state.scenario.values.retain(|known| known.name != name);
                state.scenario.values.push(Condition { name, value, unit: Some(unit) });
            }
        }
    }
}

impl Component for Composed {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.parts.is_empty() {
            complaints.at("parts").say("a chain has at least one part");
        }
        self.parts.iter().enumerate().for_each(|(i, part)| part.check(i, complaints));
        let links = match self.links(context) {
            Ok(links) => links,
            Err(Misfit { part, reason }) => {
                complaints.at(&format!("parts.{part}")).say(reason);
                return;
            }
        };
        each(&links, context, |i, link, own| {
            pass_on(i, &nested::complaints(|said| link.model.check(own, said)), complaints);
        });
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let Ok(links) = self.links(context) else { return };
        each(&links, context, |i, link, own| {
            pass_on(i, &nested::complaints(|said| link.model.environment(own, said)), complaints);
        });
    }

    fn faults(&self) -> Vec<Arc<Fault>> {
        self.parts.iter().flat_map(Part::faults).collect()
    }

    fn libraries(&self) -> Vec<&'static Library> {
        self.parts.iter().flat_map(Part::libraries).collect()
    }

    fn revisions(&self) -> BTreeMap<String, u32> {
        self.parts.iter().flat_map(Part::revisions).collect()
    }
}

/// Visits each part in its own context, in which the outputs of the parts before it are given.
fn each(
    links: &[Link<'_>],
    context: &Context<'_>,
    mut look: impl FnMut(usize, &Link<'_>, &Context<'_>),
) {
    let mut scenarios = context.scenarios.to_vec();
    let mut outputs: Vec<Given> = Vec::new();
    for (i, link) in links.iter().enumerate() {
        // A part receives only those of the chain's inputs that it takes.
        let takes = |given: &&Given| link.signature.inputs.iter().any(|x| x.name == given.name);
        let all = context.given.iter().chain(&outputs);
        let given: Vec<Given> = all.filter(takes).cloned().collect();
        let own = Context {
            given: &given,
            scenarios: &scenarios,
            starts_programs: context.starts_programs,
            ..Context::new(context.directory, context.parameters, &link.asked)
        };
        look(i, link, &own);
        announce(&link.handed, &mut outputs, &mut scenarios);
    }
}

impl Model for Composed {
    fn signature(&self, context: &Context<'_>) -> Signature {
        let links = self.links(context).unwrap_or_default();
        match links.last() {
            Some(last) if links.len() == self.parts.len() => Signature {
                inputs: Self::inputs(&links),
                layout: last.signature.layout.clone(),
                resamples: last.signature.resamples,
            },
            // For a chain with an invalid part the check reports the cause.
            _ => given::signature(context, &BTreeMap::new()),
        }
    }

    fn unused(&self, context: &Context<'_>) -> Vec<String> {
        let Ok(links) = self.links(context) else { return Vec::new() };
        let mut used = Vec::new();
        each(&links, context, |_, link, own| {
            let idle = link.model.unused(own);
            let names = link.signature.inputs.iter().map(|input| input.name.clone());
            used.extend(names.filter(|name| !idle.contains(name)));
        });
        let names = Self::inputs(&links).into_iter().map(|input| input.name);
        names.filter(|name| !used.contains(name)).collect()
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        if call.names.len() != call.inputs.len() {
            let (expected, found) = (call.names.len(), call.inputs.len());
            return Err(EvalError::Fatal(format!("expected {expected} inputs, found {found}")));
        }
        let given =
            |(name, unit): (&String, &Unit)| Given { name: name.clone(), unit: Some(unit.clone()) };
        let given: Vec<Given> = call.names.iter().zip(call.units).map(given).collect();
        let scenarios = [call.scenario.clone()];
        let context = Context {
            given: &given,
            scenarios: &scenarios,
            ..Context::new(call.study, &[], call.layout)
        };
        let links = self.links(&context).map_err(|misfit| EvalError::Fatal(misfit.reason))?;
        if links.len() < self.parts.len() {
            return Err(EvalError::Fatal("the options of a part are wrong".to_owned()));
        }
        let values = call.names.iter().zip(call.inputs).zip(call.units);
        let values = values.map(|((name, x), unit)| (name.clone(), *x, unit.clone()));
        let mut state = State { values: values.collect(), scenario: call.scenario.clone() };
        let mut facts: Vec<Fact> = Vec::new();
        let mut valid = true;
        let mut values = Vec::new();
        for link in &links {
            let response = link.answer(&state, call.study, call.directory)?;
            link.hand_on(&response, &mut state);
            let named =
                |fact: &Fact| Fact::new(format!("{}: {}", link.name, fact.name), &fact.value);
            facts.extend(response.facts.iter().map(named));
            valid &= response.valid;
            values = response.values;
        }
        Ok(Response { values, valid, facts })
    }

    fn files(&self, directory: &Path) -> Vec<PathBuf> {
        let models = self.parts.iter().filter_map(|part| part.section().ok());
        models.flat_map(|section| section.built.plugin.files(directory)).collect()
    }
}

lacuna::register!(Model, "composed", Composed);
