//! Terms: named pieces of physics that the equations of a model may lack.

use lacuna_base::data::{Layout, Unit};
use lacuna_base::math::distribution::Distribution;
use toml::Table;

use super::Component;
use super::amend::State;
use super::effect::Description;

/// A summand of the rate of a state, with a coefficient.
///
/// The engine supplies the coefficient: its unit is that of the rate divided by that of the shape, and its prior is
/// scaled by the size of the rate that the term is added to.
pub trait Term: Component {
    /// Description for the user.
    fn describe(&self) -> Description;

    /// Returns true if the name identifies the physics; a term that a study writes out itself is named after its
    /// coefficient.
    fn listed(&self) -> bool {
        true
    }

    /// Names of terms that it contains as special cases: a law with an unknown exponent contains those with a fixed one.
    /// Where one of them is a candidate as well, the general form has a smaller prior mass.
    fn contains(&self) -> &'static [&'static str] {
        &[]
    }

    /// Options with which a search may propose the term at a site without being told; empty if the term needs
    /// information that only a study has.
    fn proposals(&self, _site: &Site<'_>) -> Vec<Table> {
        Vec::new()
    }

    /// The summand that is added to the rate of a state.
    fn summand(&self, place: &Place<'_>) -> Result<Summand, String>;
}

/// A state whose rate may lack a term.
pub struct Site<'a> {
    /// State concerned.
    pub state: &'a State,
    /// States that are integrals of another one (their rate is another state alone) and that are linked to this state:
    /// the rate depends on them, or this state is their rate. For a velocity these are the positions.
    pub positions: &'a [&'a State],
    /// Other states on which the rate depends, besides the state itself.
    pub others: &'a [&'a State],
}

impl Site<'_> {
    /// Positions on which the rate depends, such as those of springs.
    pub fn springs(&self) -> Vec<&State> {
        let uses = &self.state.uses;
        self.positions.iter().copied().filter(|position| uses.contains(&position.name)).collect()
    }

    /// Expressions of which the rate has the difference to the state itself.
    pub fn references(&self) -> impl Iterator<Item = &str> {
        let own = &self.state.name;
        self.state.references.iter().filter(move |[name, _]| name == own).map(|[_, at]| at.as_str())
    }
}

/// Place at which a term is added.
pub struct Place<'a> {
    /// State concerned.
    pub state: &'a State,
    /// Name of the coefficient, which is the prefix of all other names that the term introduces.
    pub name: &'a str,
    /// Time variable, if the model has one.
    pub time: Option<Time<'a>>,
    /// Root mean square of an expression of states along the run at the middle of the priors.
    pub size: &'a dyn Fn(&str) -> Result<f64, String>,
}

/// Time variable of a model, as a term sees it.
#[derive(Debug, Clone, Copy)]
pub struct Time<'a> {
    /// Name of the time in expressions.
    pub name: &'a str,
    /// Unit of the time.
    pub unit: &'a Unit,
    /// Duration of the response.
    pub duration: f64,
    /// Shortest time step of the response.
    pub step: f64,
}

impl<'a> Time<'a> {
    /// The time of a response: its numeric axis, if it has one.
    pub fn of(layout: &'a Layout) -> Option<Self> {
        let (name, at, unit) = layout.abscissa()?;
        let duration = at.last()? - at.first()?;
        let steps = at.windows(2).map(|w| w[1] - w[0]);
        Some(Self { name, unit, duration, step: steps.fold(f64::INFINITY, f64::min).min(duration) })
    }
}

/// Summand that a term adds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Summand {
    /// Expression that the coefficient multiplies.
    pub shape: String,
    /// Allowed signs of the coefficient.
    pub sign: Sign,
    /// Shapes that the same coefficient adds to the rates of other states.
    pub beside: Vec<(String, String)>,
    /// Further unknowns that the shape uses.
    pub indices: Vec<Index>,
    /// Further states that the shape uses.
    pub states: Vec<State>,
    /// Expression for the magnitude of the shape, if the shape uses indices or states of the term; `None` for a
    /// magnitude of one.
    pub scale: Option<String>,
    /// Description of choices that the term made itself, such as a width that data would not determine.
    pub fixed: Option<String>,
}

/// Allowed signs of a coefficient.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Sign {
    /// Either sign.
    #[default]
    Either,
    /// Positive only.
    Positive,
}

/// A further unknown of a term, such as a frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct Index {
    /// Name in the shape.
    pub name: String,
    /// Unit of the unknown.
    pub unit: Unit,
    /// Prior of the unknown.
    pub prior: Distribution,
    /// Starting values, so close to each other that a fit from one of them finds every mode.
    pub starts: Vec<f64>,
}
