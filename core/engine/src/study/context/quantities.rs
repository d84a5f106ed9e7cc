//! Quantities of interest against the rest of the study: their curves, units and expressions.

use lacuna::text::{Complaints, Node, Problems};

use super::effects::places;
use crate::study::quantity::asked;
use crate::study::resolve::Study;

/// Reports places that the response does not have, and options that do not fit. Returns false if a quantity of a library that
/// was not loaded could not be asked.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) -> bool {
    let nodes = root.get("quantity").map(Node::elements).unwrap_or_default();
    let mut wrong = vec![false; nodes.len()];
    for (i, (section, node)) in study.quantities.iter().zip(nodes).enumerate() {
        let before = problems.len();
        within(node, problems, |complaints| {
            if study.target.is_none() {
                places(study, "on", &section.common.on, complaints);
            }
            if let Some(value) = section.common.reference.filter(|value| !value.is_finite()) {
                let problem = complaints.at("reference").say("the reference is not a number");
                problem.expected("a finite number").found(value);
            }
        });
        wrong[i] = problems.len() > before;
    }
    let (_, misfits, is_known) = asked(study);
    for (i, misfit) in misfits {
        // A place that is wrong has been reported.
        if let Some(node) = nodes.get(i).filter(|_| !wrong[i]) {
            within(node, problems, |complaints| misfit.report(complaints));
        }
    }
    is_known
}

fn within(node: &Node, problems: &mut Problems, look: impl FnOnce(&mut Complaints<'_>)) {
    let path = format!("quantity.{}", node.name().unwrap_or("?"));
    problems.within(&path, |problems| look(&mut Complaints::new(node, problems)));
}
