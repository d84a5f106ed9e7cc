//! `[[dependence]]` and `[[constraint]]`: what the joint prior of the parameters has besides their own priors.

mod constraints;
mod groups;
mod keys;
mod matrix;

use lacuna::data::{Dependence, JointPrior, Parameter};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::text::decode::decode;
use lacuna::text::{Node, Problems};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

pub use keys::{ConstraintSection, CopulaName, DependenceSection};
pub use matrix::Correlations;

use super::plain::Study;
use super::unknowns::Unknown;

/// The sections as written.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sections {
    /// `[[dependence]]`.
    pub dependence: Vec<DependenceSection>,
    /// `[[constraint]]`.
    pub constraint: Vec<ConstraintSection>,
}

impl Sections {
    /// Reads them from a study; `None` if something is wrong.
    pub(super) fn read(root: &Node, problems: &mut Problems) -> Option<Self> {
        let dependence = tables(root, "dependence", problems);
        let constraint = tables(root, "constraint", problems);
        Some(Self { dependence: dependence?, constraint: constraint? })
    }

    /// The prior of a parameter that is a share of a Dirichlet distribution: its beta distribution.
    pub(super) fn prior_of_share(&self, name: &str) -> Option<Distribution> {
        self.dependence.iter().find_map(|section| groups::prior_of_share(section, name))
    }
}

fn tables<T: DeserializeOwned>(root: &Node, list: &str, problems: &mut Problems) -> Option<Vec<T>> {
    let elements = root.get(list).map(Node::elements).unwrap_or_default();
    let decoded: Vec<Option<T>> = elements
        .iter()
        .map(|node| problems.within(list, |problems| decode(node, problems)))
        .collect();
    decoded.into_iter().collect()
}

/// The dependence of a study's parameters; `None` if something is wrong.
pub(super) fn dependence(
    sections: &Sections,
    (parameters, unknowns): (&[Parameter], &[Unknown]),
    seed: u64,
    root: &Node,
    problems: &mut Problems,
) -> Option<Dependence> {
    let before = problems.len();
    let groups = groups::groups(&sections.dependence, parameters, root, problems);
    let constraints =
        constraints::constraints(&sections.constraint, (parameters, unknowns), root, problems);
    if problems.len() > before {
        return None;
    }
    let mut dependence = Dependence { groups, constraints, share: None };
    let stream = Stream::root(seed).named("constraints");
    dependence.share = JointPrior::new(parameters, &dependence).share(&stream);
    constraints::reachable(&dependence, root, problems);
    (problems.len() == before).then_some(dependence)
}

impl Study {
    /// The joint prior of the parameters.
    pub fn prior(&self) -> JointPrior<'_> {
        JointPrior::new(&self.parameters, &self.dependence)
    }

    /// What identifies results that depend on the priors: `laws` alone where the parameters are independent.
    pub fn prior_identity(&self, laws: Value) -> Value {
        if self.dependence.is_none() { laws } else { json!([laws, self.dependence]) }
    }
}
