//! Effects against the rest of the study: their names, and the places where they act.

use crate::data::{Axis, Coordinates};
use crate::study::components::effect_name;
use crate::study::nearest::{nearest, one_of};
use crate::study::resolve::Study;
use crate::study::{Complaints, Node, Problems};

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
        for (axis, labels) in &section.common.on {
            place(study, axis, labels, &mut complaints);
        }
    }
}

/// One axis of an effect's `on`, which some block of scenarios must have with each of the labels.
fn place(study: &Study, name: &str, labels: &[String], complaints: &mut Complaints<'_>) {
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
        let spot = complaints.at("on");
        let problem = spot.say(format!("the response has no axis of labels `{name}`"));
        if names.is_empty() {
            problem.help("the response is one curve: leave `on` out");
        } else {
            problem.expected(one_of(names));
        }
        return;
    }
    if labels.is_empty() {
        let path = format!("on.{name}");
        complaints.at(&path).say("an effect that acts nowhere").expected("at least one label");
    }
    for label in labels.iter().filter(|label| !known.contains(label)) {
        let names = known.iter().map(String::as_str);
        let path = format!("on.{name}");
        let problem = complaints.at(&path).say(format!("the axis `{name}` has no `{label}`"));
        problem.expected(one_of(names.clone()));
        if let Some(near) = nearest(label, names) {
            problem.help(format!("did you mean `{near}`?"));
        }
    }
}
