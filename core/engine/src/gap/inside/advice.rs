//! Advice where no candidate has a name: inputs that the model has, a companion or further runs that would tell which
//! physics is missing inside the simulator.

use lacuna::text::nearest::one_of;

use crate::study::Study;

/// Runs for each dimension of a table from which a change that depends smoothly on the parameters and on its own size can
/// be learned (Loeppky, Sacks and Welch, Technometrics 51 (2009) 366).
const RUNS: usize = 10;

/// Sentences that say what would tell which physics is missing inside the model of a study; empty if its candidates are
/// inside the model already.
pub fn what_would_tell(study: &Study) -> Vec<String> {
    let inside = &study.gap.inside;
    let mut sentences = Vec::new();
    let held = held(study);
    if !held.is_empty() && study.design.is_some() {
        sentences.push(format!(
            "the model has inputs that the study holds fixed and the search did not try: {}; `[[gap.switch]]` tries them",
            one_of(held.iter().map(String::as_str))
        ));
    }
    let is_black_box = study.surrogate.is_some() && inside.is_empty();
    if is_black_box && study.gap.companion.is_none() && study.gap.runs.is_empty() {
        let runs = RUNS * (study.parameters.len() + 1);
        sentences.push(format!(
            "physics inside the simulator has no candidate here: a cheap model of the same equations in `[gap.companion]` \
             would tell which is missing, or for each suspected cause about {runs} further runs of the simulator with it, in \
             `[[gap.runs]]`"
        ));
    }
    sentences
}

/// Inputs of the model that the study holds at a value, and that no `[[gap.switch]]` sets free.
fn held(study: &Study) -> Vec<String> {
    let Some(model) = &study.model else { return Vec::new() };
    let Some(signature) = study.signature_of(&*model.built.plugin) else { return Vec::new() };
    let tried = |name: &str| study.gap.inside.switches.iter().any(|switch| switch.input == name);
    let names = signature.inputs.iter().map(|input| input.name.clone());
    names.filter(|name| study.held(name).is_some() && !tried(name)).collect()
}
