//! A plugin of a library, whatever its kind.

use std::sync::Arc;

use super::Object;
use crate::plugin::abi::table::{Answer, ComponentFunctions, Text, status};
use crate::plugin::abi::wire::{Complaint, OwnedContext};
use crate::plugin::abi::{Refusal, Reply};
use crate::plugin::{Component, Context, Fact, Fault, Hyperparameter};
use crate::study::Complaints;

/// A plugin of a library: the functions of its kind, and those of all kinds.
pub struct Plugin<F> {
    pub(super) object: Object<F>,
    component: ComponentFunctions,
}

/// One of the checks in a table.
type Look = Option<unsafe extern "C" fn(*mut std::ffi::c_void, Text, *const Answer) -> i32>;

impl<F> Plugin<F> {
    /// The plugin that an object is.
    pub fn new(object: Object<F>, component: ComponentFunctions) -> Self {
        Self { object, component }
    }

    /// All its options with the defaults; `None` where it leaves them as they were given.
    pub fn options(&self) -> Result<Option<Reply>, Refusal> {
        let Some(options) = self.component.options else { return Ok(None) };
        // SAFETY: the function belongs to the plugin.
        self.object.ask("options", |answer| unsafe { options(self.object.this, answer) })
    }

    fn look(
        &self,
        what: &'static str,
        look: Look,
        context: &Context<'_>,
        complaints: &mut Complaints<'_>,
    ) {
        let Some(look) = look else { return };
        let asked = || -> Result<Vec<Complaint>, Refusal> {
            let context = serde_json::to_string(&OwnedContext::from(context))?;
            // SAFETY: the function belongs to the plugin, and the text is there until it returns.
            let call = |answer| unsafe { look(self.object.this, Text::of(&context), answer) };
            let reply = self.object.ask(what, call)?.unwrap_or_default();
            Ok(if reply.text.is_empty() { Vec::new() } else { Complaint::read(&reply.string()) })
        };
        match asked() {
            Ok(all) => all.into_iter().for_each(|complaint| complaint.report(complaints)),
            Err(refusal) => {
                let message = format!("{}: {}", self.object.fault().who(), refusal.message);
                complaints.at("").say(message);
            }
        }
    }
}

impl<F: Send + Sync> Component for Plugin<F> {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.look("check", self.component.check, context, complaints);
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.look("environment", self.component.environment, context, complaints);
    }

    fn faults(&self) -> Vec<Arc<Fault>> {
        vec![self.object.fault().clone()]
    }
}

/// A list of texts that a call may answer.
pub(super) fn texts(reply: Option<Reply>) -> Result<Vec<String>, Refusal> {
    Ok(reply.unwrap_or_default().json_if_any()?.unwrap_or_default())
}

/// Facts that a call may answer.
pub(super) fn facts(reply: Option<Reply>) -> Result<Vec<Fact>, Refusal> {
    Ok(reply.unwrap_or_default().json_if_any()?.unwrap_or_default())
}

/// Unknowns that a call answers, each with a name of its own and a start that it can have.
pub(super) fn unknowns(reply: Reply) -> Result<Vec<Hyperparameter>, Refusal> {
    let all: Vec<Hyperparameter> = reply.json()?;
    for (i, own) in all.iter().enumerate() {
        let (name, start) = (&own.name, own.start);
        if name.is_empty() || all[..i].iter().any(|other| other.name == *name) {
            let message =
                format!("unknown {} is called `{name}`, expected a name of its own", i + 1);
            return Err(Refusal::stop(message));
        }
        if own.log && start <= 0.0 {
            let message = format!("`{name}` starts at {start}, and its logarithm is sampled");
            return Err(Refusal::stop(message));
        }
    }
    Ok(all)
}

/// Calls a function that may be null.
pub(super) fn optional<F>(function: Option<F>, call: impl FnOnce(F) -> i32) -> i32 {
    function.map_or(status::ABSENT, call)
}
