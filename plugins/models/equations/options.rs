//! Options of `equations` other than expressions.

use std::collections::BTreeMap;
use std::fmt;

use lacuna::data::Unit;
use lacuna::text::values::Positive;
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer};
use serde::{Deserialize, Serialize};

/// Number, or expression that is evaluated to a number.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Formula {
    /// A number, in the expected unit.
    Number(f64),
    /// Text of an expression.
    Text(String),
}

/// A state: its initial value, or a table `{ start = …, unit = … }`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum State {
    /// Initial value, which determines the unit of the state.
    Start(Formula),
    /// Initial value and unit.
    Table(StateTable),
}

/// A state with its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateTable {
    /// Initial value: a number in the unit of the state, or an expression of the inputs.
    pub start: Formula,
    /// Unit of the state. Default: the unit of `start`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
}

/// Observed quantities: one expression, or one for each label of the response's axis of labels.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Observe {
    /// The response itself.
    One(String),
    /// The response at each label.
    Each(BTreeMap<String, String>),
}

/// Integration method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// `runge_kutta`; if the system proves stiff or the explicit method fails, the run is repeated with an implicit
    /// method: `bdf`, or `esdirk` if the rates have more than fifty discontinuities.
    #[default]
    Auto,
    /// Explicit Runge-Kutta method of order 5 (Tsitouras 2011): for systems that are not stiff.
    RungeKutta,
    /// Backward differentiation formulas of orders 1 to 5 (Byrne and Hindmarsh 1975, Shampine and Reichelt 1997): for
    /// stiff systems with smooth rates.
    Bdf,
    /// Diagonally implicit Runge-Kutta method of order 4 with an explicit first stage (Jørgensen, Kristensen and
    /// Thomsen 2018): for stiff systems with frequent discontinuities.
    Esdirk,
}

/// Settings of the integration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Solver {
    /// Integration method.
    pub method: Method,
    /// Relative tolerance of the error per step. A smaller value is more accurate and takes more steps.
    pub relative_tolerance: Positive,
    /// Absolute tolerance of the error per step: one number for all states, each in its unit. Default: a hundredth of
    /// each state's largest magnitude in the run times `relative_tolerance`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absolute_tolerance: Option<Positive>,
    /// Maximum number of steps; a run that needs more fails.
    pub steps: usize,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            relative_tolerance: Positive::new(1e-8).unwrap_or_else(|_| unreachable!("above zero")),
            absolute_tolerance: None,
            steps: 1_000_000,
        }
    }
}

impl Method {
    /// Returns the name of the method in a study.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::RungeKutta => "runge_kutta",
            Self::Bdf => "bdf",
            Self::Esdirk => "esdirk",
        }
    }
}

impl Formula {
    /// Returns the formula as an expression.
    pub fn text(&self) -> String {
        match self {
            Self::Number(x) => format!("{x:?}"),
            Self::Text(text) => text.clone(),
        }
    }
}

impl State {
    /// Returns the initial value, and its key relative to the state's section.
    pub fn start(&self) -> (&Formula, &'static str) {
        match self {
            Self::Start(start) => (start, ""),
            Self::Table(table) => (&table.start, ".start"),
        }
    }

    /// Returns the unit if it is given.
    pub fn unit(&self) -> Option<&Unit> {
        match self {
            Self::Start(_) => None,
            Self::Table(table) => table.unit.as_ref(),
        }
    }
}

impl Observe {
    /// Returns for each observed quantity its label (empty if there is only one), its key in the section, and its
    /// expression.
    pub fn each(&self) -> Vec<(&str, String, &str)> {
        match self {
            Self::One(text) => vec![("", "observe".to_owned(), text)],
            Self::Each(labels) => {
                let each = labels.iter();
                each.map(|(label, text)| {
                    (label.as_str(), format!("observe.{label}"), text.as_str())
                })
                .collect()
            }
        }
    }
}

impl<'de> Deserialize<'de> for Formula {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FormulaVisitor)
    }
}

impl<'de> Deserialize<'de> for State {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(StateVisitor)
    }
}

impl<'de> Deserialize<'de> for Observe {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ObserveVisitor)
    }
}

/// Visitors that deserialise by the type of the value, so that errors inside keep their own position and message.
struct FormulaVisitor;
struct StateVisitor;
struct ObserveVisitor;

impl de::Visitor<'_> for FormulaVisitor {
    type Value = Formula;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number or an expression such as \"2 * mass\"")
    }

    fn visit_f64<E: de::Error>(self, x: f64) -> Result<Formula, E> {
        if x.is_finite() {
            return Ok(Formula::Number(x));
        }
        Err(E::custom(format!("expected a finite number, found {x}")))
    }

    fn visit_i64<E: de::Error>(self, x: i64) -> Result<Formula, E> {
        Ok(Formula::Number(x as f64))
    }

    fn visit_u64<E: de::Error>(self, x: u64) -> Result<Formula, E> {
        Ok(Formula::Number(x as f64))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Formula, E> {
        Ok(Formula::Text(text.to_owned()))
    }
}

impl<'de> de::Visitor<'de> for StateVisitor {
    type Value = State;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a start value or a table such as `{ start = 0.0, unit = \"m\" }`")
    }

    fn visit_f64<E: de::Error>(self, x: f64) -> Result<State, E> {
        FormulaVisitor.visit_f64(x).map(State::Start)
    }

    fn visit_i64<E: de::Error>(self, x: i64) -> Result<State, E> {
        FormulaVisitor.visit_i64(x).map(State::Start)
    }

    fn visit_u64<E: de::Error>(self, x: u64) -> Result<State, E> {
        FormulaVisitor.visit_u64(x).map(State::Start)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<State, E> {
        FormulaVisitor.visit_str(text).map(State::Start)
    }

    fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<State, A::Error> {
        StateTable::deserialize(MapAccessDeserializer::new(map)).map(State::Table)
    }
}

impl<'de> de::Visitor<'de> for ObserveVisitor {
    type Value = Observe;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an expression or a table with one for each label")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Observe, E> {
        Ok(Observe::One(text.to_owned()))
    }

    fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<Observe, A::Error> {
        BTreeMap::deserialize(MapAccessDeserializer::new(map)).map(Observe::Each)
    }
}
