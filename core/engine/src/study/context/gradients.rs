//! Checks of a surrogate that is fitted to derivatives of the response as well.

use lacuna::text::Complaints;

use crate::study::Study;

const KEY: &str = "surrogate.gradients";
const WITHOUT: &str = "`gradients = false`";

/// Reports what a fit to derivatives lacks: runs of the model, and a surrogate that takes them.
pub(super) fn check(study: &Study, complaints: &mut Complaints<'_>) {
    let Some(surrogate) = study.surrogate.as_ref().filter(|s| s.common.gradients) else { return };
    if let Err(why) = surrogate.built.plugin.takes_gradients() {
        let name = surrogate.built.name;
        complaints
            .at(KEY)
            .say(format!("the surrogate `{name}` takes no derivatives of the response: {why}"))
            .expected(format!("another surrogate, other options of it, or {WITHOUT}"));
    }
    let read = study.simulations.as_ref().is_some_and(|s| s.built.plugin.names_files());
    let (Some(model), Some(_), false) = (&study.model, &study.design, read) else {
        complaints
            .at(KEY)
            .say("the study makes no runs of which it could ask the derivatives")
            .expected(format!("`[model]` and `[design]`, or {WITHOUT}"));
        return;
    };
    if model.common.seed.is_some() {
        complaints
            .at(KEY)
            .say("the response of the model is random, as `seed` in `[model]` says: its derivatives are those of the noise")
            .expected(WITHOUT);
    }
    if study.low_fidelity.is_some() {
        complaints
            .at(KEY)
            .say("a surrogate of two ensembles is fitted to the responses alone")
            .expected(format!("no `[low_fidelity]`, or {WITHOUT}"));
    }
}

/// Reports a model that gives no derivatives; a model on a server is asked there.
pub(in crate::study) fn of_model(study: &Study, complaints: &mut Complaints<'_>) {
    let asked = study.surrogate.as_ref().is_some_and(|section| section.common.gradients);
    let Some(model) = study.model.as_ref().filter(|_| asked) else { return };
    if model.built.plugin.gradient().is_none() {
        complaints
            .at(KEY)
            .say(format!("the model `{}` gives no derivatives of its response", model.built.name))
            .expected(format!("a model that gives them, or {WITHOUT}"))
            .help(
                "models of equations give derivatives, and functions in Python, servers and libraries of plugins that \
                 implement them (docs/models.md)",
            );
    }
}
