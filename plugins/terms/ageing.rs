//! `ageing`: a coefficient that changes with time.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of, of_each, quantity};

/// Ageing: a coefficient of the model that changes in proportion to the time, such as a stiffness that falls during a
/// test.
///
/// ```text
/// rate = … - coefficient u t / duration
/// ```
///
/// The coefficient is the change over the duration of the response; it is positive for a loss that grows or a spring that
/// becomes stiffer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ageing {
    /// Quantity `u` whose coefficient changes, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
}

impl Component for Ageing {}

impl Term for Ageing {
    fn describe(&self) -> Description {
        Description {
            title: "ageing: a coefficient that changes with time".into(),
            formula: "- coefficient * u * t / duration".into(),
            source: "standard: linear time-varying system".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        let own =
            std::iter::once(Table::new()).filter(|_| site.state.uses.contains(&site.state.name));
        own.chain(of_each(&site.springs())).chain(of_each(site.others)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let time = place.time.ok_or("the model has no time")?;
        let u = of(self.of.as_deref(), place);
        let duration = quantity(time.duration, time.unit);
        Ok(Summand {
            shape: format!("-({u}) * {} / ({duration})", time.name),
            sign: Sign::Either,
            fixed: Some(format!("duration = {duration}")),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "ageing", Ageing);
