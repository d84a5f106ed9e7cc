//! `[[dependence]]` and `[[constraint]]`: what the joint prior of the parameters has besides their own priors.

mod constraints;
mod earlier;
mod facts;
mod groups;
mod keys;
mod matrix;
mod prior;
mod represent;
mod run;

use std::path::Path;
use std::sync::Arc;

use lacuna::data::{Dependence, Field, JointPrior, Parameter, Population};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::text::decode::decode;
use lacuna::text::{Node, Problems};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

pub use earlier::Earlier;
pub use keys::{ConstraintSection, CopulaName, DependenceSection};
pub use matrix::Correlations;
pub use prior::Prior;
pub use represent::Check;

use super::file::ParameterSection;
use super::plain::Study;
use super::unknowns::Unknown;

/// The sections as written.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sections {
    /// `[[dependence]]`.
    pub dependence: Vec<DependenceSection>,
    /// `[[constraint]]`.
    pub constraint: Vec<ConstraintSection>,
    /// Priors that are posteriors of earlier runs.
    pub earlier: Vec<Earlier>,
}

impl Sections {
    /// Reads them from a study; `None` if something is wrong.
    pub(super) fn read(root: &Node, problems: &mut Problems) -> Option<Self> {
        let dependence = tables(root, "dependence", problems);
        let constraint = tables(root, "constraint", problems);
        Some(Self { dependence: dependence?, constraint: constraint?, earlier: Vec::new() })
    }

    /// Reads the runs that parameters name as their priors.
    pub(super) fn read_runs(
        &mut self,
        parameters: &[ParameterSection],
        directory: &Path,
        root: &Node,
        problems: &mut Problems,
    ) {
        self.earlier = earlier::earlier(parameters, directory, root, problems);
    }

    /// Prior of a parameter by itself, of an interval the law of its design points; `None` if the study gives none.
    pub(super) fn prior(&self, section: &ParameterSection) -> Option<Distribution> {
        let name = section.name.as_str();
        match &section.prior {
            Some(Prior::Own(law)) => Some(law.clone()),
            Some(Prior::Earlier { .. }) => self.of_run(name),
            // The law of the design points. Nothing else may draw from it.
            Some(Prior::Interval { interval }) => Some(Distribution::Uniform(*interval)),
            None => self.prior_of_share(name),
        }
    }

    fn of_run(&self, name: &str) -> Option<Distribution> {
        self.earlier.iter().find_map(|run| {
            let place = run.parameters.iter().position(|other| other == name)?;
            Some(run.marginals[place].clone())
        })
    }

    /// Run directory from which a parameter has its prior.
    pub(super) fn run_of(&self, name: &str) -> Option<&Path> {
        let run = self.earlier.iter().find(|run| run.parameters.iter().any(|other| other == name));
        run.map(|run| run.run.as_path())
    }

    /// The prior of a parameter that is a share of a Dirichlet distribution: its beta distribution.
    fn prior_of_share(&self, name: &str) -> Option<Distribution> {
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
    populations: Vec<Population>,
    (parameters, unknowns, fields): (&[Parameter], &[Unknown], &[Arc<Field>]),
    seed: u64,
    root: &Node,
    problems: &mut Problems,
) -> Option<Dependence> {
    let before = problems.len();
    let groups = groups::groups(sections, parameters, root, problems);
    let constraints = constraints::constraints(
        &sections.constraint,
        (parameters, unknowns, fields),
        root,
        problems,
    );
    if problems.len() > before {
        return None;
    }
    let mut dependence = Dependence { groups, populations, constraints, share: None };
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

    /// Identity of results that depend on the priors: `laws` alone where the parameters are independent.
    pub fn prior_identity(&self, laws: Value) -> Value {
        if self.dependence.is_none() { laws } else { json!([laws, self.dependence]) }
    }
}
