//! Consistency of `[gap.companion]` with the rest of the study: a companion answers as the simulator does.

use lacuna::data::Layout;
use lacuna::plugin::model::{Input, Signature};
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Complaints, Node, Problems};

use crate::study::Study;
use crate::study::gap::SwitchSection;
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
    places(companion, node, problems);
}

/// Inputs that are the same physics at several places have one law, in one unit, and places of their own.
fn places(companion: &Companion, node: &Node, problems: &mut Problems) {
    let nodes = node.get("switch").map(Node::elements).unwrap_or_default();
    let switches = &companion.keys.switch;
    for (i, (switch, node)) in switches.iter().zip(nodes).enumerate() {
        let Some(place) = &switch.place else { continue };
        let mut others =
            switches[..i].iter().filter_map(|other| Some((other, other.place.as_ref()?)));
        let same = others.clone().find(|(_, other)| other.of == place.of);
        let twice = others.find(|(_, other)| other.of == place.of && other.at == place.at);
        problems.within("switch", |problems| {
            let mut complaints = Complaints::new(node, problems);
            if !place.at.is_finite() {
                complaints.at("place.at").say("the place is no finite number");
            }
            if let Some((other, _)) = twice {
                let (at, input) = (place.at, &other.input);
                complaints
                    .at("place.at")
                    .say(format!("`{input}` is `{}` at {at} too", place.of))
                    .help("give each input a place of its own");
            }
            let law = |of: &SwitchSection| (of.prior.clone(), of.unit.clone(), of.absent);
            if let Some((other, _)) = same.filter(|(other, _)| law(other) != law(switch)) {
                complaints
                    .at("prior")
                    .say(format!(
                        "`{}` has another law, unit or absent value at `{}`",
                        place.of, other.input
                    ))
                    .help("the size is one unknown: state the same for all places");
            }
        });
    }
    for (switch, place) in switches.iter().filter_map(|own| Some((own, own.place.as_ref()?))) {
        let is_other =
            |other: &&SwitchSection| other.place.is_none() && other.input == place.of.as_str();
        if switches.iter().any(|other| is_other(&other)) {
            Complaints::new(node, problems)
                .at("switch")
                .say(format!(
                    "`{}`, the physics of `{}`, is also the name of an input",
                    place.of, switch.input
                ))
                .help("choose another name for `of`");
        }
    }
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
    for (name, quantity) in &companion.keys.fixed {
        if !quantity.value.is_finite() {
            complaints
                .at(&format!("fixed.{name}"))
                .say(format!("`{name}` is not finite"))
                .expected("a finite number")
                .found(quantity.value);
        }
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
