//! `[[constraint]]`: conditions on the parameters.

use std::collections::BTreeMap;
use std::sync::Arc;

use lacuna::data::{Constraint, Dependence, Field, Parameter, Unit};
use lacuna::expression::{Fault, Program, Scope};
use lacuna::text::{Complaints, Node, Problems};

use super::keys::ConstraintSection;
use crate::study::unknowns::Unknown;

/// Smallest probability of the constraints under the priors. Below it the constraints replace the priors, and its estimate by
/// a million draws has a standard error above 10 %.
const LEAST: f64 = 1e-4;
/// Name of the condition in its scope.
const NAME: &str = "constraint_holds";

/// The conditions of all sections; what is wrong is left out and reported.
pub(super) fn constraints(
    sections: &[ConstraintSection],
    of: (&[Parameter], &[Unknown], &[Arc<Field>]),
    root: &Node,
    problems: &mut Problems,
) -> Vec<Constraint> {
    let nodes = root.get("constraint").map(Node::elements).unwrap_or_default();
    let mut constraints = Vec::new();
    for (section, node) in sections.iter().zip(nodes) {
        match compiled(&section.formula, of) {
            Ok((program, places)) => {
                constraints.push(Constraint::new(&section.formula, move |point| {
                    let unknowns: Vec<f64> = places.iter().map(|&j| point[j]).collect();
                    program.value(&unknowns)[0] == 1.0
                }));
            }
            Err(faults) => problems.within("constraint", |problems| {
                for fault in faults {
                    report(fault, node, problems);
                }
            }),
        }
    }
    constraints
}

/// The condition as a program that gives 1 where it holds, and the parameters behind its unknowns.
fn compiled(
    formula: &str,
    (parameters, unknowns, fields): (&[Parameter], &[Unknown], &[Arc<Field>]),
) -> Result<(Program, Vec<usize>), Vec<Fault>> {
    let mut scope = Scope::new();
    let (mut units, mut places) = (BTreeMap::<String, Unit>::new(), Vec::new());
    for field in fields {
        scope.field(field.clone()).map_err(|fault| vec![fault])?;
    }
    for (j, unknown) in unknowns.iter().enumerate().filter(|(_, u)| u.is_shared()) {
        scope.unknown(&unknown.name).map_err(|fault| vec![fault])?;
        units.insert(unknown.name.clone(), parameters[j].unit.clone());
        places.push(j);
    }
    scope.define(NAME, &format!("{BEFORE}{formula}{AFTER}")).map_err(|fault| vec![fault])?;
    let program = scope.compile(&[NAME])?;
    scope.check_units(&units)?;
    Ok((program, places))
}

/// Rule by which a condition becomes a number.
const BEFORE: &str = "if(";
const AFTER: &str = ", 1, 0)";

fn report(fault: Fault, node: &Node, problems: &mut Problems) {
    let shifted = |at: usize| at.saturating_sub(BEFORE.len());
    let span = shifted(fault.span.start)..shifted(fault.span.end);
    let mut complaints = Complaints::new(node, problems);
    let problem = complaints.at("formula").inside(span).say(fault.message);
    problem.expected = fault.expected.map(String::from);
    problem.found = fault.found.map(String::from);
    problem.help.extend(fault.help.map(String::from));
}

/// Reports constraints that no draw of the priors fulfils, or too few.
pub(super) fn reachable(dependence: &Dependence, root: &Node, problems: &mut Problems) {
    let Some(share) = dependence.share else { return };
    let probability = share.inside as f64 / share.draws as f64;
    if probability >= LEAST {
        return;
    }
    let mut complaints = Complaints::new(root, problems);
    let message = match share.inside {
        0 => format!("none of {} draws of the priors fulfils the constraints", share.draws),
        some => {
            format!("only {some} of {} draws of the priors fulfil the constraints", share.draws)
        }
    };
    complaints
        .at("constraint")
        .say(message)
        .expected(format!("a probability of at least {LEAST} under the priors"))
        .help("choose priors that agree with the constraints, or compute a parameter from the others in `[model] computed`");
}
