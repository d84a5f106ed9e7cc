//! The unknowns of a study: shared by all scenarios, or one per scenario or group of scenarios.

use lacuna::data::{Parameter, Population, Scenario};
use lacuna::math::distribution::Distribution;
use lacuna::text::node::Node;
use lacuna::text::{Complaints, Problems, nearest};

use super::file::{ParameterSection, Prior};
use super::hierarchy::{Member, members, of_sections};
use super::table::PluginSections;

/// Unknown to which a parameter of a study belongs.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Unknown {
    /// Name in inputs and expressions: that of the parameter without its scenario.
    pub name: String,
    /// Scenario to which it belongs; `None` if it is shared by all.
    pub scenario: Option<usize>,
    /// Group to which it belongs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub member: Option<Member>,
    /// Kind of the unknown.
    #[serde(skip_serializing_if = "is_parameter")]
    pub kind: UnknownKind,
    /// True if bounds of its value are known and no distribution; its prior is then that of the design points.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub interval: bool,
    /// True if the data do not update it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub cut: bool,
}

/// Kinds of unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UnknownKind {
    /// A parameter of the model.
    Parameter,
    /// Location or scale of a population, on which no response depends directly.
    Population,
    /// A coefficient of a random field.
    Field,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature of `skip_serializing_if`")]
fn is_parameter(kind: &UnknownKind) -> bool {
    *kind == UnknownKind::Parameter
}

impl Unknown {
    /// Returns true for location and scale of a population.
    pub fn of_population(&self) -> bool {
        self.kind == UnknownKind::Population
    }

    /// Returns true for a coefficient of a random field.
    pub fn of_field(&self) -> bool {
        self.kind == UnknownKind::Field
    }

    /// An unknown that all scenarios share.
    pub fn shared(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            scenario: None,
            member: None,
            kind: UnknownKind::Parameter,
            interval: false,
            cut: false,
        }
    }

    /// Returns true if it acts in a scenario.
    pub fn acts_in(&self, scenario: usize) -> bool {
        !self.of_population()
            && self.scenario.is_none_or(|own| own == scenario)
            && self.member.as_ref().is_none_or(|own| own.scenarios.contains(&scenario))
    }

    /// Returns true if it has one value for all scenarios.
    pub fn is_shared(&self) -> bool {
        self.scenario.is_none() && self.member.is_none() && !self.of_population()
    }

    /// Returns true if expressions of a scenario, or of none, may use it.
    pub fn is_known_in(&self, scenario: Option<usize>) -> bool {
        scenario.map_or_else(|| self.is_shared(), |scenario| self.acts_in(scenario))
    }
}

/// The parameters of a study, their unknowns and populations: `"each"` makes one parameter per scenario, and `by` one per
/// group.
pub(super) fn unknowns(
    sections: &[ParameterSection],
    scenarios: &[Scenario],
    plugins: &PluginSections,
    prior: impl Fn(&ParameterSection) -> Option<Distribution>,
    root: &Node,
    problems: &mut Problems,
) -> (Vec<Parameter>, Vec<Unknown>, Vec<Population>) {
    of_sections(sections, plugins.surrogate.is_some(), root, problems);
    let margin = plugins.design.as_ref().and_then(|design| design.common.margin);
    let (mut parameters, mut unknowns) = (Vec::new(), Vec::new());
    let mut populations = Vec::new();
    let mut all = (&mut parameters, &mut unknowns);
    let add = |(parameters, unknowns): &mut (&mut Vec<Parameter>, &mut Vec<Unknown>),
               section: &ParameterSection,
               prior: &Distribution,
               scenario: Option<usize>| {
        let name = section.name.as_str().to_owned();
        let full = |base: &str| match scenario {
            Some(i) => format!("{base}[{}]", scenarios[i].name),
            None => base.to_owned(),
        };
        parameters.push(Parameter {
            symbol: full(section.symbol.as_deref().unwrap_or(&name)),
            name: full(&name),
            unit: section.unit.clone(),
            design: section.design.clone().unwrap_or_else(|| match margin {
                Some(margin) => widened(prior, margin.get()),
                None => prior.clone(),
            }),
            prior: prior.clone(),
            reference: section.reference,
        });
        let interval = matches!(section.prior, Some(Prior::Interval { .. }));
        let cut = section.cut;
        unknowns.push(Unknown { scenario, interval, cut, ..Unknown::shared(&name) });
    };
    let named: Vec<&str> =
        scenarios.iter().map(|s| s.name.as_str()).filter(|name| !name.is_empty()).collect();
    for section in sections {
        let own = prior(section);
        if section.by.is_some() && (own.is_some() || section.population.is_some()) {
            let places = (&mut *all.0, &mut *all.1);
            populations.extend(members(section, own.as_ref(), scenarios, places, root, problems));
            continue;
        }
        let Some(prior) = own else {
            if section.prior.is_none() {
                let mut complaints = Complaints::new(root, problems);
                complaints.at(&format!("parameter.{}", section.name)).say("missing key `prior`");
            }
            continue;
        };
        if margin.is_some() && section.design.is_none() && !reaches_out(&prior) {
            let mut complaints = Complaints::new(root, problems);
            let (name, law) = (&section.name, prior.name());
            complaints
                .at(&format!("parameter.{name}.prior"))
                .say(format!("`[design] margin` cannot widen the {law} prior of `{name}`"))
                .expected("a uniform or log-uniform prior, or a `design` of the parameter's own");
        }
        let Some(scenario) = &section.scenario else {
            add(&mut all, section, &prior, None);
            continue;
        };
        let place = scenarios.iter().position(|s| &s.name == scenario && !s.name.is_empty());
        match place {
            Some(place) => add(&mut all, section, &prior, Some(place)),
            None if scenario == "each" && !named.is_empty() => {
                (0..scenarios.len()).for_each(|i| add(&mut all, section, &prior, Some(i)));
            }
            None => {
                let mut complaints = Complaints::new(root, problems);
                let path = format!("parameter.{}.scenario", section.name);
                let complaint = complaints.at(&path);
                if named.is_empty() {
                    complaint.say("the study has no scenarios").help("add `[[scenario]]` sections");
                    continue;
                }
                let problem = complaint.say(format!("there is no scenario `{scenario}`"));
                problem.expected(nearest::one_of(named.iter().copied().chain(["each"])));
                if let Some(near) = nearest::nearest(scenario, named.iter().copied()) {
                    problem.help(format!("did you mean `{near}`?"));
                }
            }
        }
    }
    (parameters, unknowns, populations)
}

/// A bounded law over a wider range; any other law is returned unchanged, because its runs reach as far as its tails.
fn widened(prior: &Distribution, margin: f64) -> Distribution {
    let wider = |low: f64, high: f64| [low - margin * (high - low), high + margin * (high - low)];
    match *prior {
        Distribution::Uniform([low, high]) => Distribution::Uniform(wider(low, high)),
        Distribution::LogUniform([low, high]) => {
            Distribution::LogUniform(wider(low.ln(), high.ln()).map(f64::exp))
        }
        ref other => other.clone(),
    }
}

/// Returns true if the runs can lie outside the prior's range: it can be widened, or it is unbounded on at least one
/// side.
fn reaches_out(prior: &Distribution) -> bool {
    let (low, high) = prior.support();
    let boxed = matches!(prior, Distribution::Uniform(_) | Distribution::LogUniform(_));
    boxed || !(low.is_finite() && high.is_finite())
}
