//! A plugin, or what it made: an object of the Python side and how its answers are taken.

use std::sync::Arc;

use lacuna::data::{Layout, Scenario};
use lacuna::matrix::Matrix;
use lacuna::plugin::model::EvalError;
use lacuna::plugin::{Component, Context, Hyperparameter, Target};
use lacuna::run::{Fault, Stop};
use lacuna::text::Complaints;
use lacuna_abi::check::{numbers_only, shaped};
use lacuna_abi::wire::{Complaint, OwnedContext};
use lacuna_abi::{Memo, Refusal, status};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json, json};

use crate::message::Message;
use crate::script::{Recipe, Request, Script};

/// An object of the Python side.
pub struct Object {
    script: Arc<Script>,
    recipe: Arc<Recipe>,
    fault: Arc<Fault>,
    /// Optional methods that the plugin has.
    has: Arc<Vec<String>>,
    conditions: Memo<Conditions, Arc<Recipe>>,
}

/// Conditions that many requests share: the names of the numbers, the layout and the scenario.
#[derive(PartialEq)]
struct Conditions {
    names: Vec<String>,
    layout: Layout,
    scenario: Option<Scenario>,
}

/// A question to an object, with its arguments.
#[derive(Default)]
pub struct Call<'a> {
    /// Name of the call.
    pub what: &'static str,
    /// Arguments in JSON.
    pub about: Map<String, Json>,
    /// Numbers.
    pub matrices: &'a [&'a Matrix],
    /// Bytes.
    pub bytes: &'a [u8],
    /// Conditions that many calls share.
    pub known: Option<Arc<Recipe>>,
    /// The log density of a sampler.
    pub target: Option<&'a dyn Target>,
}

impl<'a> Call<'a> {
    /// A call with these numbers.
    pub fn new(what: &'static str, matrices: &'a [&'a Matrix]) -> Self {
        Self { what, matrices, ..Self::default() }
    }

    /// With arguments, a JSON object.
    #[must_use]
    pub fn about(mut self, about: Json) -> Self {
        if let Json::Object(about) = about {
            self.about = about;
        }
        self
    }

    fn head(&self) -> Map<String, Json> {
        let mut head = self.about.clone();
        head.insert("do".to_owned(), json!(self.what));
        head
    }
}

impl Object {
    /// A plugin with its options, and the options that it has with their defaults.
    pub fn new(
        script: &Arc<Script>,
        (kind, name): (&str, &str),
        options: Json,
        has: Arc<Vec<String>>,
        fault: Arc<Fault>,
    ) -> Result<(Self, Json), Refusal> {
        let head = json!({ "do": "new", "kind": kind, "name": name, "options": options });
        let Json::Object(head) = head else { unreachable!("an object was written") };
        let recipe = script.recipe(None, Message { head, ..Message::default() });
        let made = script.made(&recipe)?;
        let options = made.head.get("options").cloned().unwrap_or_default();
        let (script, conditions) = (script.clone(), Memo::new());
        Ok((Self { script, recipe, fault, has, conditions }, options))
    }

    /// An object that a call makes, with the answer to the call.
    pub fn make(&self, call: &Call<'_>) -> Result<(Self, Message), Refusal> {
        let request = Message {
            head: call.head(),
            matrices: call.matrices.iter().map(|matrix| (*matrix).clone()).collect(),
            bytes: call.bytes.to_vec(),
        };
        let recipe = self.script.recipe(Some(self.recipe.clone()), request);
        let made = self.script.made(&recipe).map_err(|refusal| told(call.what, refusal))?;
        Ok((self.with(recipe), made))
    }

    /// An object like this one.
    fn with(&self, recipe: Arc<Recipe>) -> Self {
        let (script, fault, has) = (self.script.clone(), self.fault.clone(), self.has.clone());
        Self { script, recipe, fault, has, conditions: Memo::new() }
    }

    /// Answer to a call.
    pub fn ask(&self, call: &Call<'_>) -> Result<Message, Refusal> {
        let request = Request {
            object: &self.recipe,
            head: call.head(),
            known: call.known.as_ref(),
            matrices: call.matrices,
            bytes: call.bytes,
        };
        self.script.ask(&request, call.target).map_err(|refusal| told(call.what, refusal))
    }

    /// Conditions that calls share: they are sent to each worker once.
    pub fn known(
        &self,
        names: &[String],
        layout: &Layout,
        scenario: Option<&Scenario>,
    ) -> Result<Option<Arc<Recipe>>, Refusal> {
        let same = |known: &Conditions| {
            known.names == names && known.layout == *layout && known.scenario.as_ref() == scenario
        };
        let recipe = self.conditions.get(same, || -> Result<_, Refusal> {
            let about = json!({ "names": names, "layout": layout, "scenario": scenario });
            let head = json!({ "do": "know", "about": about });
            let Json::Object(head) = head else { unreachable!("an object was written") };
            let request = Message { head, ..Message::default() };
            let recipe = self.script.recipe(Some(self.recipe.clone()), request);
            let (names, layout, scenario) = (names.to_vec(), layout.clone(), scenario.cloned());
            Ok((Conditions { names, layout, scenario }, recipe))
        })?;
        Ok(Some((*recipe).clone()))
    }

    /// True for a plugin that has an optional method.
    pub fn has(&self, method: &str) -> bool {
        self.has.iter().any(|name| name == method)
    }

    /// The record of answers that failed.
    pub fn fault(&self) -> &Arc<Fault> {
        &self.fault
    }

    /// The answer, or else `otherwise`: then the plugin has a fault.
    pub fn or_fault<T>(&self, answered: Result<T, Refusal>, otherwise: impl FnOnce() -> T) -> T {
        answered.unwrap_or_else(|refusal| {
            self.fault.report(refusal.message);
            otherwise()
        })
    }

    /// The answer, or why a stage cannot go on.
    pub fn or_stop<T>(&self, answered: Result<T, Refusal>) -> Result<T, Stop> {
        answered.map_err(|refusal| Stop::new(self.said(&refusal)))
    }

    /// The answer, or why a model has none.
    pub fn or_error<T>(&self, answered: Result<T, Refusal>) -> Result<T, EvalError> {
        answered.map_err(|refusal| {
            let message = self.said(&refusal);
            match refusal.status {
                status::REJECTED => EvalError::Rejected(message),
                _ => EvalError::Fatal(message),
            }
        })
    }

    /// A refusal with the name of the plugin.
    pub fn said(&self, refusal: &Refusal) -> String {
        format!("{}: {}", self.fault.who(), refusal.message)
    }
}

/// A refusal that says of what.
fn told(what: &str, refusal: Refusal) -> Refusal {
    if refusal.status == status::REJECTED {
        return refusal;
    }
    Refusal { message: format!("`{what}`: {}", refusal.message), ..refusal }
}

/// Answer of a plugin in JSON.
pub fn answer<T: DeserializeOwned>(message: &Message) -> Result<T, Refusal> {
    let json = message.head.get("answer").cloned().unwrap_or_default();
    serde_json::from_value(json)
        .map_err(|error| Refusal::stop(format!("an answer is of the wrong form: {error}")))
}

/// The matrices of an answer.
pub fn matrices<const N: usize>(message: Message) -> Result<[Matrix; N], Refusal> {
    let count = message.matrices.len();
    message
        .matrices
        .try_into()
        .map_err(|_| Refusal::stop(format!("an answer has {count} arrays, expected {N}")))
}

/// The one matrix of an answer, of this shape and without NaN.
pub fn matrix(
    what: &'static str,
    message: Message,
    rows: usize,
    columns: usize,
) -> Result<Matrix, Refusal> {
    let [matrix] = matrices(message)?;
    shaped(what, &matrix, rows, columns)?;
    numbers_only(what, matrix.as_slice())?;
    Ok(matrix)
}

/// A row of numbers as a matrix.
pub fn row(values: &[f64]) -> Matrix {
    Matrix::from_vec(1, values.len(), values.to_vec())
}

/// An unknown as a plugin tells it; without a start it is the median of the prior.
#[derive(Deserialize)]
struct UnknownAbout {
    name: String,
    symbol: String,
    unit: lacuna::data::Unit,
    prior: lacuna::math::distribution::Distribution,
    #[serde(default)]
    log: bool,
    #[serde(default)]
    start: Option<f64>,
}

/// The unknowns that an answer lists, each with a name of its own.
pub fn unknowns(message: &Message) -> Result<Vec<Hyperparameter>, Refusal> {
    let all: Vec<UnknownAbout> = answer(message)?;
    for (i, own) in all.iter().enumerate() {
        if own.name.is_empty() || all[..i].iter().any(|other| other.name == own.name) {
            let (number, name) = (i + 1, &own.name);
            let message =
                format!("unknown {number} is called `{name}`, expected a name of its own");
            return Err(Refusal::stop(message));
        }
    }
    let known = |about: UnknownAbout| {
        let UnknownAbout { name, symbol, unit, prior, log, start } = about;
        let start = start.unwrap_or_else(|| prior.quantile(0.5));
        if log && start <= 0.0 {
            let message = format!("`{name}` starts at {start}, and its logarithm is sampled");
            return Err(Refusal::stop(message));
        }
        Ok(Hyperparameter { name, symbol, unit, prior, log, start })
    };
    all.into_iter().map(known).collect()
}

/// A plugin of a file, whatever its kind.
pub struct Plugin(pub Object);

impl Component for Plugin {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if !self.0.has("check") {
            return;
        }
        let context = json!({ "context": OwnedContext::from(context) });
        match self.0.ask(&Call::new("check", &[]).about(context)) {
            Ok(_) => {}
            Err(refusal) if refusal.status == status::REJECTED => {
                for complaint in Complaint::read(&refusal.message) {
                    complaint.report(complaints);
                }
            }
            Err(refusal) => {
                complaints.at("").say(self.0.said(&refusal));
            }
        }
    }

    fn faults(&self) -> Vec<Arc<Fault>> {
        vec![self.0.fault().clone()]
    }
}
