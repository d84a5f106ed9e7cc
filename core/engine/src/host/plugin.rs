//! A plugin of a library, whatever its kind.

use std::ffi::c_void;
use std::sync::Arc;

use lacuna::plugin::{Component, Context, Hyperparameter};
use lacuna::run::Fault;
use lacuna::text::Complaints;
use lacuna_abi::table::{Answer, ComponentFunctions, Text};
use lacuna_abi::wire::{Complaint, OwnedContext};
use lacuna_abi::{Object, Refusal, Reply};

/// A plugin of a library: the functions of its kind, and those of all kinds.
pub struct Plugin<F> {
    pub(super) object: Object<F>,
    component: ComponentFunctions,
}

/// A function that answers something.
type Told = unsafe extern "C" fn(*mut c_void, *const Answer) -> i32;
/// One of the checks in a table.
type Look = unsafe extern "C" fn(*mut c_void, Text, *const Answer) -> i32;

impl<F> Plugin<F> {
    /// The plugin that an object is.
    pub fn new(object: Object<F>, component: ComponentFunctions) -> Self {
        Self { object, component }
    }

    /// All its options with the defaults; `None` where it leaves them as they were given.
    pub fn options(&self) -> Result<Option<Reply>, Refusal> {
        let options = self.component.options;
        // SAFETY: the function belongs to the plugin.
        let call = |options: Told, answer| unsafe { options(self.object.this, answer) };
        self.object.ask("options", options, call).if_any()
    }

    fn look(
        &self,
        what: &'static str,
        look: Option<Look>,
        context: &Context<'_>,
        complaints: &mut Complaints<'_>,
    ) {
        if look.is_none() {
            return;
        }
        let asked = || -> Result<Vec<Complaint>, Refusal> {
            let context = serde_json::to_string(&OwnedContext::from(context))?;
            let text = Text::of(&context);
            // SAFETY: the function belongs to the plugin, and the text is there until it returns.
            let call = |look: Look, answer| unsafe { look(self.object.this, text, answer) };
            let reply = self.object.ask(what, look, call).if_any()?.unwrap_or_default();
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
