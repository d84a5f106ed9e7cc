//! `expression`: a formula of the study.

use std::collections::BTreeMap;

use lacuna::data::Unit;
use lacuna::expression::{Fault, Scope};
use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Expression: a formula of parameters, of values that `[model]` fixes, of conditions of the scenario, of derived quantities, and
/// of other quantities.
///
/// ```toml
/// [[quantity]]
/// name = "peak"
/// use = "maximum"
/// on = { sensor = ["R"] }
///
/// [[quantity]]
/// name = "margin"
/// use = "expression"
/// formula = "1e-3 - peak_R"
/// ```
///
/// A quantity of curves is known under its full name, with the labels of its curve: `peak_R`. Quantities written as
/// expressions may use those written before them. Units are checked. In a study with scenarios an expression that uses
/// numbers of a scenario has one value per scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expression {
    /// Formula, in the language of all expressions of a study.
    pub formula: String,
}

impl Component for Expression {}

/// The name under which the scope holds the formula.
const WHOLE: &str = "formula ";

impl Quantity for Expression {
    fn of_curve(&self) -> bool {
        false
    }

    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let Arguments::Numbers(numbers) = arguments else {
            return Err(vec![Misfit::new("formula", "an expression has no curve")]);
        };
        let told = |faults: Vec<Fault>| -> Vec<Misfit> {
            let one = |fault| Misfit::of_expression("formula", fault);
            faults.into_iter().map(one).collect()
        };
        let mut scope = Scope::new();
        let mut units: BTreeMap<String, Unit> = BTreeMap::new();
        for number in *numbers {
            scope.unknown(number.name).map_err(|fault| told(vec![fault]))?;
            units.extend(number.unit.map(|unit| (number.name.to_owned(), unit.clone())));
        }
        scope.result(WHOLE, &self.formula).map_err(|fault| told(vec![fault]))?;
        let program = scope.compile(&[WHOLE]).map_err(told)?;
        if program.outputs() != 1 {
            let fault = Fault::new(0..self.formula.len(), "the formula is a vector");
            return Err(told(vec![fault.expected("one number")]));
        }
        let mut found = scope.check_units(&units).map_err(told)?;
        let unit = found.remove(WHOLE).unwrap_or_default();
        Ok(functional(unit, move |values| program.value(values)[0]))
    }
}

lacuna::register!(Quantity, "expression", Expression);

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use lacuna::plugin::quantity::Number;

    fn bound(formula: &str) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let [force, area] = ["kN", "mm2"].map(|unit| Unit::parse(unit).unwrap());
        let numbers = [
            Number { name: "force", unit: Some(&force) },
            Number { name: "area", unit: Some(&area) },
        ];
        Expression { formula: formula.to_owned() }.bind(&Arguments::Numbers(&numbers))
    }

    #[test]
    fn units_are_found_and_checked() {
        let stress = bound("force / area").unwrap();
        let to = stress.unit().factor_to(&Unit::parse("MPa").unwrap()).unwrap();
        assert!((stress.value(&[3.0, 60.0]) * to - 50.0).abs() < 1e-12);
        let wrong = bound("force + area").map(|_| ()).unwrap_err();
        assert_eq!((wrong[0].key.as_str(), wrong[0].part.is_some()), ("formula", true));
        assert!(bound("speed + force").is_err());
    }
}
