//! Consistency of `[gap.companion]` with the rest of the study: a companion answers as the simulator does.

use lacuna::data::Layout;
use lacuna::plugin::model::{Input, Signature};
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Complaints, Node, Problems};

use crate::study::Study;
use crate::study::gap::companion::Companion;

/// Reports inputs without a value, constants that are no inputs, and responses that do not fit; `node` is the section.
pub(super) fn check(study: &Study, companion: &Companion, node: &Node, problems: &mut Problems) {
    let mut complaints = Complaints::new(node, problems);
    if study.surrogate.is_none() {
        complaints
            .at("")
            .say("a companion stands beside the emulator of a simulator, and the study has no `[surrogate]`")
            .help("without a surrogate the model itself is evaluated: name candidates in `[[gap.switch]]` or `[[gap.term]]`");
        return;
    }
    let Some(model) = &companion.study.model else { return };
    let model = &*model.built.plugin;
    for (place, scenario) in companion.study.scenarios.iter().enumerate() {
        let Some((layout, _)) = companion.study.layouts.of_scenario(&scenario.name) else {
            continue;
        };
        let context = companion.study.context_of(&layout);
        model.check(&context, &mut complaints);
        let signature = model.signature(&context);
        responds(&layout, &signature, &mut complaints);
        constants(companion, &signature, &mut complaints);
        inputs(companion, place, &signature, &mut complaints);
    }
    around(companion, &mut complaints);
    added(companion, &mut complaints);
    problems.dedup();
    super::inside::check(&companion.study, node, problems);
}

fn responds(layout: &Layout, signature: &Signature, complaints: &mut Complaints<'_>) {
    if layout.unit.factor_to(&signature.layout.unit).is_none() {
        complaints
            .at("use")
            .say("the companion's response has another dimension than the study's")
            .expected(format!("a unit that converts to `{}`", layout.unit))
            .found(format!("`{}`", signature.layout.unit));
    }
    let names = |layout: &Layout| layout.axes.iter().map(|a| a.name.clone()).collect::<Vec<_>>();
    if names(layout) != names(&signature.layout) {
        complaints
            .at("use")
            .say("the companion's response has other axes than the study's")
            .expected(names(layout).join(", "))
            .found(names(&signature.layout).join(", "));
    }
}

fn constants(companion: &Companion, signature: &Signature, complaints: &mut Complaints<'_>) {
    let names = || signature.inputs.iter().map(|input| input.name.as_str());
    for constant in &companion.keys.parameter {
        let name = constant.name.as_str();
        let path = format!("parameter.{name}.name");
        match signature.inputs.iter().find(|input| input.name == name) {
            None => {
                let problem = complaints
                    .at(&path)
                    .say(format!("the companion does not use `{name}`"))
                    .expected(one_of(names()));
                if let Some(near) = nearest(name, names()) {
                    problem.help(format!("did you mean `{near}`?"));
                }
            }
            Some(input) if constant.unit.factor_to(&input.unit).is_none() => {
                complaints
                    .at(&format!("parameter.{name}.unit"))
                    .say(format!("`{name}` has another unit in the companion"))
                    .expected(format!("a unit that converts to `{}`", input.unit))
                    .found(format!("`{}`", constant.unit));
            }
            Some(_) => {}
        }
        let own = &companion.study.unknowns[..companion.own()];
        if own.iter().any(|unknown| unknown.name == name) {
            complaints
                .at(&path)
                .say(format!("`{name}` is a parameter of the study"))
                .help("its value is that of the parameter: take it out here");
        }
    }
    let known = |name: &String| companion.keys.parameter.iter().any(|c| c.name.as_str() == name);
    for name in companion.keys.constants.keys().filter(|name| !known(name)) {
        complaints
            .at(&format!("constants.{name}"))
            .say(format!("`{name}` is no constant of the companion"))
            .help("list it in `[[gap.companion.parameter]]`, or give it in `fixed`");
    }
}

/// Reports inputs that nothing sets, and a companion that uses none of the study's parameters.
fn inputs(
    companion: &Companion,
    scenario: usize,
    signature: &Signature,
    complaints: &mut Complaints<'_>,
) {
    let study = &companion.study;
    let of_study = |name: &str| {
        study.unknowns.iter().any(|unknown| unknown.name == name && unknown.acts_in(scenario))
    };
    let set = |input: &&Input| {
        of_study(&input.name)
            || study.scenarios[scenario].value(&input.name).is_some()
            || study.model.iter().any(|model| model.common.fixed.contains_key(&input.name))
            || input.default.is_some()
    };
    if let Some(input) = signature.inputs.iter().find(|input| !set(input)) {
        complaints
            .at("use")
            .say(format!("nothing sets the companion's input `{}`", input.name))
            .help(format!("add it to `fixed = {{ {} = … }}`", input.name))
            .help("or to `[[gap.companion.parameter]]`, to identify it from the runs");
    }
    for name in companion.keys.fixed.keys() {
        if !signature.inputs.iter().any(|input| &input.name == name) {
            complaints
                .at(&format!("fixed.{name}"))
                .say(format!("the companion has no input `{name}`"))
                .expected(one_of(signature.inputs.iter().map(|input| input.name.as_str())));
        }
    }
    let own = &study.unknowns[..companion.own()];
    if !own.iter().any(|unknown| signature.inputs.iter().any(|input| input.name == unknown.name)) {
        complaints
            .at("use")
            .say("the companion uses none of the study's parameters")
            .expected(one_of(own.iter().map(|unknown| unknown.name.as_str())))
            .help("it answers as the simulator does only if it depends on the same parameters");
    }
}

/// Reports values of parameters and candidates that the study does not have.
fn around(companion: &Companion, complaints: &mut Complaints<'_>) {
    let own = &companion.study.parameters[..companion.own()];
    for name in companion.keys.around.keys() {
        let known = own.iter().any(|parameter| &parameter.name == name);
        if !known && !companion.keys.add.contains(name) {
            complaints
                .at(&format!("around.{name}"))
                .say(format!("the study has no parameter and `add` no candidate `{name}`"))
                .expected(one_of(own.iter().map(|parameter| parameter.name.as_str())));
        }
    }
}

/// Reports candidates that are added although the companion's constants are not known.
fn added(companion: &Companion, complaints: &mut Complaints<'_>) {
    if companion.keys.add.is_empty() || companion.stated().is_some() {
        return;
    }
    let names: Vec<&str> = companion.keys.parameter.iter().map(|c| c.name.as_str()).collect();
    complaints
        .at("add")
        .say("candidates are added, but the constants of the companion have no values")
        .expected(format!("`constants` with {}", names.join(", ")))
        .help("`lacuna gap` writes both");
}
