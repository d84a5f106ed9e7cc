//! Probabilities of rare events against the rest of the study.

use lacuna::text::{Complaints, Node, Problems};

use crate::study::reliability::Event;
use crate::study::resolve::Study;

/// Reports quantities that there are not, limits that do not fit, and names that are used twice.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let nodes = root.get("reliability").map(Node::elements).unwrap_or_default();
    let asked = study.asked();
    for (i, (section, node)) in study.reliability.iter().zip(nodes).enumerate() {
        let path = format!("reliability.{}", node.name().unwrap_or("?"));
        problems.within(&path, |problems| {
            let mut complaints = Complaints::new(node, problems);
            let name = &section.common.name;
            if study.reliability[..i].iter().any(|other| other.common.name == *name) {
                let message = format!("there are two of the name `{}`", name.as_str());
                complaints.at("name").say(message).help("give each a name of its own");
            }
            if let Err(misfits) = Event::of(study, section, &asked) {
                for misfit in misfits {
                    misfit.report(&mut complaints);
                }
            }
        });
    }
}
