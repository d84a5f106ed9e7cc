//! Predictions under conditions that were not measured.

use lacuna::data::Scenario;

use super::{Finding, Rule, Severity};

const CODE: &str = "unmeasured_conditions";

const LOOK: &str = "measure there, or read these predictions as those of the model: `lacuna next STUDY` ranks measurements";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "the conditions of scenarios without measurements (`measured = false`)"
            .to_owned(),
        threshold:
            "a value outside the range of the measured scenarios, or a function of its own: note"
                .to_owned(),
        why: "nothing measured tells whether model and discrepancy hold there: their errors are those of the measured \
              scenarios",
        action: LOOK,
    }]
}

/// Finding about a scenario without measurements whose conditions lie outside those of the measured scenarios.
pub fn beyond(scenario: &Scenario, all: &[Scenario]) -> Option<Finding> {
    let measured = || all.iter().filter(|other| !other.unmeasured);
    let mut outside = Vec::new();
    for condition in &scenario.values {
        let factor = |unit: &Option<lacuna::data::Unit>| match (unit, &condition.unit) {
            (Some(from), Some(to)) => from.factor_to(to),
            _ => Some(1.0),
        };
        let known: Vec<f64> = measured()
            .flat_map(|other| other.values.iter().filter(|value| value.name == condition.name))
            .filter_map(|value| Some(value.value * factor(&value.unit)?))
            .collect();
        let low = known.iter().copied().fold(f64::INFINITY, f64::min);
        let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !(low..=high).contains(&condition.value) {
            let (name, value) = (&condition.name, condition.value);
            let range = if known.is_empty() {
                "stated for no measured scenario".to_owned()
            } else {
                format!("measured from {low} to {high}")
            };
            outside.push(format!("`{name}` is {value}, {range}"));
        }
    }
    for function in &scenario.functions {
        let same = |other: &&Scenario| other.functions.iter().any(|known| known == function);
        if !measured().any(|other| same(&other)) {
            outside
                .push(format!("the function `{}` is that of no measured scenario", function.name));
        }
    }
    if outside.is_empty() {
        return None;
    }
    let name = &scenario.name;
    let message = format!(
        "predictions for `{name}` are extrapolations: {}; their errors are those of the measured scenarios",
        outside.join("; ")
    );
    let count = outside.len() as f64;
    Some(Finding::new((CODE, name), (count, 1.0), Severity::Note, message, LOOK))
}

#[cfg(test)]
mod tests {
    use lacuna::data::{Condition, Unit};

    use super::*;

    fn scenario(name: &str, value: f64, unit: &str, unmeasured: bool) -> Scenario {
        let unit = Some(Unit::parse(unit).unwrap());
        let values = vec![Condition { name: "power".to_owned(), value, unit }];
        Scenario { name: name.to_owned(), values, unmeasured, ..Scenario::default() }
    }

    #[test]
    fn a_condition_outside_the_measured_range_is_an_extrapolation() {
        let all = [
            scenario("low", 750.0, "kW", false),
            scenario("high", 1.4, "MW", false),
            scenario("between", 1.0, "MW", true),
            scenario("double", 2.8, "MW", true),
        ];
        assert_eq!(beyond(&all[2], &all), None);
        let found = beyond(&all[3], &all).unwrap();
        assert_eq!((found.code.as_str(), found.severity), (CODE, Severity::Note));
        assert!(found.message.contains("`power` is 2.8, measured from 0.75 to 1.4"), "{found:?}");
    }
}
