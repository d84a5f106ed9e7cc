//! Effects against the rest of the study: their names, and the places where they act.

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Axis, Coordinates};
use lacuna::plugin::effect::On;
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Complaints, Node, Problems};

use crate::study::components::effect_name;
use crate::study::hierarchy::of_effect;
use crate::study::resolve::Study;

/// Reports names that are taken, and places that the response does not have.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let nodes = root.get("effect").map(Node::elements).unwrap_or_default();
    for (i, (section, node)) in study.effects.iter().zip(nodes).enumerate() {
        let mut complaints = Complaints::new(node, problems);
        let name = effect_name(section);
        if study.effects[..i].iter().any(|other| effect_name(other) == name) {
            complaints
                .at("name")
                .say(format!("there are two effects `{name}`"))
                .help(format!("give one of them a name of its own, such as `name = \"{name}_2\"`"));
        }
        places(study, "on", &section.common.on, &mut complaints);
        of_effect(study, section, &mut complaints);
        if let Some(by) = &section.common.by {
            groups(study, by, &mut complaints);
            if !section.built.plugin.switches().is_empty() {
                complaints
                    .at("by")
                    .say("the effect changes inputs of the model, which are the same in all scenarios")
                    .help("make the input a `[[parameter]]` with `by`");
            }
        }
    }
}

/// Reports a label that a scenario does not have.
fn groups(study: &Study, by: &str, complaints: &mut Complaints<'_>) {
    let unnamed = |scenario: &&lacuna::data::Scenario| scenario.name.is_empty();
    let without = |scenario: &&lacuna::data::Scenario| {
        unnamed(scenario) || (by != SCENARIO && !scenario.labels.contains_key(by))
    };
    let Some(scenario) = study.scenarios.iter().find(without) else { return };
    let problem = complaints.at("by").say(if unnamed(&scenario) {
        "the study has no scenarios that could be grouped".to_owned()
    } else {
        format!("the scenario `{}` has no label `{by}`", scenario.name)
    });
    let labels = study.scenarios.iter().flat_map(|s| s.labels.keys().map(String::as_str));
    let mut known: Vec<&str> = labels.chain([SCENARIO]).collect();
    known.sort_unstable();
    known.dedup();
    problem.expected(one_of(known));
    problem.found(format!("\"{by}\""));
}

/// Reports axes and labels, written under the key `path`, that no block of scenarios has.
pub(super) fn places(study: &Study, path: &str, on: &On, complaints: &mut Complaints<'_>) {
    for (axis, labels) in on {
        place(study, path, axis, labels, complaints);
    }
}

fn place(
    study: &Study,
    path: &str,
    name: &str,
    labels: &[String],
    complaints: &mut Complaints<'_>,
) {
    let all = || study.layouts.blocks.iter().flat_map(|block| &block.axes);
    let is_label = |axis: &&Axis| matches!(axis.coordinates, Coordinates::Labels(_));
    let known: Vec<String> = all()
        .filter(is_label)
        .filter(|axis| axis.name == name)
        .flat_map(|axis| (0..axis.len()).map(|i| axis.text(i)))
        .collect();
    if known.is_empty() {
        let mut names: Vec<&str> = all().filter(is_label).map(|axis| axis.name.as_str()).collect();
        names.dedup();
        let spot = complaints.at(path);
        let problem = spot.say(format!("the response has no axis of labels `{name}`"));
        if names.is_empty() {
            problem.help(format!("the response is one curve: leave `{path}` out"));
        } else {
            problem.expected(one_of(names));
        }
        return;
    }
    if labels.is_empty() {
        let path = format!("{path}.{name}");
        complaints.at(&path).say("a place without labels").expected("at least one label");
    }
    for label in labels.iter().filter(|label| !known.contains(label)) {
        let names = known.iter().map(String::as_str);
        let path = format!("{path}.{name}");
        let problem = complaints.at(&path).say(format!("the axis `{name}` has no `{label}`"));
        problem.expected(one_of(names.clone()));
        if let Some(near) = nearest(label, names) {
            problem.help(format!("did you mean `{near}`?"));
        }
    }
}
