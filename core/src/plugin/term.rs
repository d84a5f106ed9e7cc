//! Terms: named pieces of physics that the equations of a model may lack.

use toml::Table;

use super::Component;
use super::amend::State;
use super::effect::Description;
use crate::data::{Layout, Unit};
use crate::math::distribution::Distribution;

/// A summand of the rate of a state, with a coefficient of its own.
///
/// The engine gives it a coefficient, whose unit is that of the rate by that of the shape and whose prior has the
/// size of the rate that it is added to.
pub trait Term: Component {
    /// What it is, for people.
    fn describe(&self) -> Description;

    /// Whether its name says what it is; one that a study writes by itself is called as its coefficient.
    fn listed(&self) -> bool {
        true
    }

    /// Options with which it may be missing there when nobody names it; none where it needs what only a study knows.
    fn proposals(&self, _site: &Site<'_>) -> Vec<Table> {
        Vec::new()
    }

    /// What is added to the rate of a state.
    fn summand(&self, place: &Place<'_>) -> Result<Summand, String>;
}

/// A state whose rate may lack a term.
pub struct Site<'a> {
    /// The state.
    pub state: &'a State,
    /// The states that only move with others (their rate is another state alone) and that its rate depends on, or whose
    /// rate it is: the positions of a speed.
    pub positions: &'a [String],
    /// The other states, besides itself, on which its rate depends.
    pub others: &'a [String],
}

/// Where a term is added.
pub struct Place<'a> {
    /// The state.
    pub state: &'a State,
    /// The name of the coefficient, which begins the names of what else the term brings.
    pub name: &'a str,
    /// The time, where the model has one.
    pub time: Option<Time<'a>>,
    /// The root mean square of an expression of states along the run at the middle of the priors.
    pub size: &'a dyn Fn(&str) -> Result<f64, String>,
}

/// The time of a model, as a term sees it.
#[derive(Debug, Clone, Copy)]
pub struct Time<'a> {
    /// Its name in expressions.
    pub name: &'a str,
    /// Its unit.
    pub unit: &'a Unit,
    /// The length of the response along it.
    pub duration: f64,
    /// The shortest step of the response along it.
    pub step: f64,
}

impl<'a> Time<'a> {
    /// The time of a response: its axis of numbers, where it has one.
    pub fn of(layout: &'a Layout) -> Option<Self> {
        let (name, at, unit) = layout.abscissa()?;
        let duration = at.last()? - at.first()?;
        let steps = at.windows(2).map(|w| w[1] - w[0]);
        Some(Self { name, unit, duration, step: steps.fold(f64::INFINITY, f64::min).min(duration) })
    }
}

/// What a term adds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Summand {
    /// What the coefficient multiplies: an expression.
    pub shape: String,
    /// The signs that the coefficient may have.
    pub sign: Sign,
    /// Shapes that the same coefficient adds to the rates of other states.
    pub beside: Vec<(String, String)>,
    /// Further unknowns that the shape uses.
    pub indices: Vec<Index>,
    /// Further states that the shape uses.
    pub states: Vec<State>,
    /// An expression of the size of the shape, where that uses indices or states of the term; one where there is none.
    pub scale: Option<String>,
    /// What the term fixed by itself, such as a width that no data would tell, in words.
    pub fixed: Option<String>,
}

/// The signs that a coefficient may have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Sign {
    /// Both.
    #[default]
    Either,
    /// Above zero only.
    Positive,
}

/// A further unknown of a term, such as a frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct Index {
    /// Its name in the shape.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// Where it may lie.
    pub prior: Distribution,
    /// Values so near to each other that a fit from one of them finds every mode.
    pub starts: Vec<f64>,
}
