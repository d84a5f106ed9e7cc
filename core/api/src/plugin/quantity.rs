//! Quantities of interest: the numbers for whose prediction a model is calibrated, such as a peak or a fatigue damage.

use std::ops::Range;

use lacuna_base::data::Unit;
use lacuna_base::expression::Fault;
use lacuna_base::text::Complaints;
use lacuna_base::text::quantity::Quantity as Value;

use super::Component;

/// A number that follows from one curve of the response, or from other numbers of a study.
///
/// The engine evaluates it at draws of the posterior, with and without the errors of the prediction.
pub trait Quantity: Component {
    /// True for a quantity of a curve; false for a quantity of named numbers: parameters, derived quantities and other
    /// quantities.
    fn of_curve(&self) -> bool {
        true
    }

    /// The quantity as a function of these arguments: of a curve, or of numbers, as [`Quantity::of_curve`] says.
    ///
    /// # Errors
    /// Options that do not fit the arguments, such as a place outside the curve or a wrong unit.
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>>;
}

/// A quantity that is ready to be computed.
pub trait Functional: Send + Sync {
    /// Unit of the value.
    fn unit(&self) -> &Unit;

    /// Value of the quantity. `arguments` are the values of the curve, in its unit, or the numbers in the order in which
    /// they were named. NaN where the quantity is undefined; NaN arguments that it depends on give NaN.
    fn value(&self, arguments: &[f64]) -> f64;
}

/// Arguments of a quantity.
#[derive(Debug, Clone, Copy)]
pub enum Arguments<'a> {
    /// The values of a curve.
    Curve(Curve<'a>),
    /// Named numbers.
    Numbers(&'a [Number<'a>]),
}

impl<'a> Arguments<'a> {
    /// The curve.
    ///
    /// # Errors
    /// If the arguments are numbers, which the engine gives only to quantities of numbers.
    pub fn curve(&self) -> Result<Curve<'a>, Vec<Misfit>> {
        match self {
            Self::Curve(curve) => Ok(*curve),
            Self::Numbers(_) => Err(vec![Misfit::new("use", "the quantity needs a curve")]),
        }
    }
}

/// A curve of the response: its values along the last axis of numbers, usually a record over time.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    /// Name of the response, such as `strain`.
    pub name: &'a str,
    /// Unit of the values.
    pub unit: &'a Unit,
    /// Name of the axis, such as `time`.
    pub axis: &'a str,
    /// Points of the axis at which the curve has values, increasing, at least one.
    pub grid: &'a [f64],
    /// Unit of the axis.
    pub grid_unit: &'a Unit,
}

impl Curve<'_> {
    /// An option that states a value of the response, in the unit of the response.
    ///
    /// # Errors
    /// If its unit does not convert.
    pub fn level(&self, key: &str, value: &Value) -> Result<f64, Vec<Misfit>> {
        in_unit(key, value, self.unit)
    }

    /// An option that states a point of the axis or a length along it, in the unit of the axis.
    ///
    /// # Errors
    /// If its unit does not convert.
    pub fn point(&self, key: &str, value: &Value) -> Result<f64, Vec<Misfit>> {
        in_unit(key, value, self.grid_unit)
    }
}

/// An option in a unit; a plain number is in that unit already.
///
/// # Errors
/// If the unit of the option does not convert.
pub fn in_unit(key: &str, value: &Value, unit: &Unit) -> Result<f64, Vec<Misfit>> {
    value.in_unit(unit).ok_or_else(|| {
        let found = value.unit.as_ref().map_or_else(String::new, |unit| format!("`{unit}`"));
        let expected = format!("a unit that converts to `{unit}`");
        vec![Misfit::new(key, "the value has another unit").expected(expected).found(found)]
    })
}

/// A number on which a quantity may depend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number<'a> {
    /// Name of the number.
    pub name: &'a str,
    /// Unit of the number; `None` if the study states none.
    pub unit: Option<&'a Unit>,
}

/// An option that does not fit the arguments of a quantity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Misfit {
    /// Key of the option, a dotted path from the section of the quantity.
    pub key: String,
    /// Byte range at fault inside the option, which is a text; `None` for the whole option.
    pub part: Option<Range<usize>>,
    /// Description of the fault, in one line.
    pub message: String,
    /// The correct form, phrased to follow "expected".
    pub expected: Option<String>,
    /// The value present, phrased to follow "found".
    pub found: Option<String>,
    /// Advice to the user.
    pub help: Option<String>,
}

impl Misfit {
    /// A misfit of the option with this key.
    pub fn new(key: &str, message: impl Into<String>) -> Self {
        Self {
            key: key.to_owned(),
            part: None,
            message: message.into(),
            expected: None,
            found: None,
            help: None,
        }
    }

    /// A fault of an option that is an expression.
    pub fn of_expression(key: &str, fault: Fault) -> Self {
        Self {
            key: key.to_owned(),
            part: Some(fault.span),
            message: fault.message,
            expected: fault.expected.map(String::from),
            found: fault.found.map(String::from),
            help: fault.help.map(String::from),
        }
    }

    /// Adds the correct form.
    #[must_use]
    pub fn expected(mut self, expected: impl Into<String>) -> Self {
        self.expected = Some(expected.into());
        self
    }

    /// Adds the value present; an empty text adds nothing.
    #[must_use]
    pub fn found(mut self, found: impl ToString) -> Self {
        self.found = Some(found.to_string()).filter(|found| !found.is_empty());
        self
    }

    /// Adds advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Reports the misfit; the section is that of the quantity.
    pub fn report(self, complaints: &mut Complaints<'_>) {
        let spot = complaints.at(&self.key);
        let problem = match self.part {
            Some(part) => spot.inside(part).say(self.message),
            None => spot.say(self.message),
        };
        problem.expected = self.expected;
        problem.found = self.found;
        problem.help.extend(self.help);
    }
}

/// A quantity from its unit and a formula for its value.
pub fn functional(
    unit: Unit,
    value: impl Fn(&[f64]) -> f64 + Send + Sync + 'static,
) -> Box<dyn Functional> {
    Box::new(Formula { unit, value })
}

struct Formula<F> {
    unit: Unit,
    value: F,
}

impl<F: Fn(&[f64]) -> f64 + Send + Sync> Functional for Formula<F> {
    fn unit(&self) -> &Unit {
        &self.unit
    }

    fn value(&self, arguments: &[f64]) -> f64 {
        (self.value)(arguments)
    }
}
