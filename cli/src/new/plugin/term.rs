//! `skeleton`: a loss proportional to the state.

use lacuna::expression;
use lacuna::plugin::amend::State;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Context, Term};
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A linear loss: a state decreases in proportion to itself, or to an expression of states.
///
/// ```text
/// rate = … - coefficient u,   coefficient ≥ 0
/// ```
///
/// A leak, a decay, a first-order reaction. `linear_friction` has the same form for velocities, and `relaxation` is for
/// a decay to a nonzero level.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Quantity that is lost, `u`, as an expression of states; the state itself by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
}

impl Component for Skeleton {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let Some(text) = &self.of else { return };
        if let Err(fault) = expression::check(text) {
            complaints
                .at("of")
                .say(fault.to_string())
                .expected("an expression of states, such as `x - y`");
        }
    }
}

impl Term for Skeleton {
    fn describe(&self) -> Description {
        Description {
            title: "a linear loss: a state falls in proportion to itself".into(),
            formula: "- coefficient * u".into(),
            source: "standard: first-order kinetics".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        let of = |state: &&State| Table::from_iter([("of".to_owned(), state.name.as_str().into())]);
        std::iter::once(Table::new()).chain(site.others.iter().map(of)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = self.of.as_deref().unwrap_or(&place.state.name);
        Ok(Summand { shape: format!("-({u})"), sign: Sign::Positive, ..Summand::default() })
    }
}

lacuna::register!(Term, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::Unit;

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::term("skeleton", &Skeleton::default()), Ok(()));
    }

    #[test]
    fn the_state_itself_is_lost_where_nothing_else_is_named() {
        let state = State {
            name: "n".into(),
            unit: Unit::dimensionless(),
            rate: "0".into(),
            start: "1".into(),
            ..State::default()
        };
        let place = Place { state: &state, name: "loss", time: None, size: &|_| Ok(1.0) };
        let shape = |of: Option<&str>| {
            Skeleton { of: of.map(str::to_owned) }.summand(&place).unwrap().shape
        };
        assert_eq!([shape(None), shape(Some("n - m"))], ["-(n)", "-(n - m)"]);
    }
}
