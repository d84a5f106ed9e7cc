//! `[[start]]`: where the search for the best fit begins, besides draws of the prior.

use lacuna::text::values::Finite;
use lacuna::text::{Complaints, Node, Problems, nearest};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plain::Study;

/// A value of a parameter at which the search for the best fit begins: a guess, or the result of an earlier fit. Parameters
/// without one begin at the median of the prior. The search also begins at points of the prior and ends at the best
/// point that it finds; the posterior does not depend on a start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartSection {
    /// Name of the parameter; of one that belongs to a scenario: `name[scenario]`.
    pub name: String,
    /// Value, in the parameter's unit.
    pub value: Finite,
}

impl Study {
    /// The starting value of each parameter, in the order of the study.
    pub fn start(&self) -> Vec<Option<f64>> {
        let of = |name: &str| self.starts.iter().find(|start| start.name == name);
        self.parameters.iter().map(|p| of(&p.name).map(|start| start.value.get())).collect()
    }
}

/// Reports starts that belong to no parameter, or lie where the prior has no density.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let mut complaints = Complaints::new(root, problems);
    for (i, start) in study.starts.iter().enumerate() {
        let name = &start.name;
        let path = format!("start.{name}");
        if study.starts[..i].iter().any(|other| other.name == *name) {
            complaints
                .at(&format!("{path}.name"))
                .say(format!("there are two starting values of `{name}`"))
                .help("keep one of them");
            continue;
        }
        let names = || study.parameters.iter().map(|parameter| parameter.name.as_str());
        let Some(parameter) = study.parameters.iter().find(|p| p.name == *name) else {
            let problem = complaints
                .at(&format!("{path}.name"))
                .say(format!("there is no parameter `{name}`"))
                .expected(nearest::one_of(names()));
            if let Some(near) = nearest::nearest(name, names()) {
                problem.help(format!("did you mean `{near}`?"));
            }
            continue;
        };
        if !parameter.prior.log_density(start.value.get()).is_finite() {
            let (low, high) = parameter.prior.support();
            complaints
                .at(&format!("{path}.value"))
                .say(format!("the prior of `{name}` is zero at its start"))
                .expected(format!("a value between {low} and {high}"))
                .found(start.value.get());
        }
    }
}
