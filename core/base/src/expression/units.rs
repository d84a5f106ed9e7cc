//! Units of expressions, determined before anything is computed.

use std::collections::BTreeMap;
use std::ops::Range;

use super::Fault;
use super::function::{Action, Density, Function};
use super::operator::{Binary, Unary};
use super::scope::Scope;
use super::tree::{Id, NodeKind, Tree};
use crate::data::Unit;

/// Unit of a subexpression, as far as it is known.
#[derive(Clone, Debug)]
enum Measure {
    /// Zero is compatible with every unit.
    Any,
    Of(Unit),
}

/// A subexpression.
struct Part {
    measure: Measure,
    /// Value, if it follows from the text alone: exponents need it.
    value: Option<f64>,
    span: Range<usize>,
}

impl Scope {
    /// The unit of every definition, from those of the unknowns and data; a name that is not in `units` is
    /// dimensionless.
    ///
    /// Sums, comparisons, `min`, `max`, `if`, lists and tables need equal units (`mm` and `m` are not equal: numbers
    /// are not converted); functions such as `exp` need dimensionless arguments, angles are in radians; powers need a
    /// constant exponent whose result is a unit. A number in the text is dimensionless unless its unit is given, as in
    /// `9.81 {m/s2}`; zero is compatible with every unit. Log densities are dimensionless: `normal_log_density` needs
    /// the same unit for all its arguments, and its density is per that unit.
    ///
    /// ```
    /// # use lacuna_base as lacuna;
    /// use lacuna::data::Unit;
    /// use lacuna::expression::Scope;
    ///
    /// let mut scope = Scope::new();
    /// scope.unknown("density")?;
    /// scope.unknown("sound_speed")?;
    /// scope.define("bulk_modulus", "density * sound_speed^2")?;
    /// let unit = |text: &str| Unit::parse(text).expect("a unit");
    /// let units = [("density", unit("kg/m3")), ("sound_speed", unit("m/s"))];
    /// let units = units.map(|(name, unit)| (name.to_owned(), unit)).into();
    /// let found = scope.check_units(&units).expect("no fault");
    /// assert_eq!(found["bulk_modulus"], unit("Pa"));
    /// # Ok::<(), lacuna::expression::Fault>(())
    /// ```
    pub fn check_units(
        &self,
        units: &BTreeMap<String, Unit>,
    ) -> Result<BTreeMap<String, Unit>, Vec<Fault>> {
        let (found, faults) = self.find_units(units);
        if !faults.is_empty() {
            return Err(faults);
        }
        Ok(found.into_iter().map(|(name, unit)| (name, unit.unwrap_or_default())).collect())
    }

    /// Like [`Scope::check_units`], but returns the units that could be determined beside the faults; `None` is the
    /// unit of a definition that is zero and therefore compatible with every unit.
    pub fn find_units(
        &self,
        units: &BTreeMap<String, Unit>,
    ) -> (BTreeMap<String, Option<Unit>>, Vec<Fault>) {
        let mut known = units.clone();
        let mut found = BTreeMap::new();
        let order = match self.order() {
            Ok(order) => order,
            Err(faults) => return (found, faults),
        };
        let mut faults = Vec::new();
        for name in order {
            let tree = &self.definitions[name];
            // Definitions that use one of unknown unit are checked only once that one is correct.
            let settled =
                |used: &str| !self.definitions.contains_key(used) || found.contains_key(used);
            if !tree.names().all(settled) {
                continue;
            }
            match self.unit_of(tree, &known) {
                Ok(unit) => {
                    known.insert(name.to_owned(), unit.clone().unwrap_or_default());
                    found.insert(name.to_owned(), unit);
                }
                Err(fault) => faults.push(fault.within(name)),
            }
        }
        (found, faults)
    }

    fn unit_of(&self, tree: &Tree, units: &BTreeMap<String, Unit>) -> Result<Option<Unit>, Fault> {
        let mut parts: Vec<Part> = Vec::with_capacity(tree.nodes.len());
        for node in &tree.nodes {
            let measure = match &node.kind {
                NodeKind::Table(name, id) => {
                    let (at, unit) = match self.fields.get(name) {
                        Some(field) => (&field.at_unit, &field.unit),
                        None => (&self.functions[name].at_unit, &self.functions[name].unit),
                    };
                    parts[*id].demand(at)?;
                    Measure::Of(unit.clone())
                }
                kind => measure(kind, &node.span, &parts, tree, units)?,
            };
            let value = value(&node.kind, &parts);
            parts.push(Part { measure, value, span: node.span.clone() });
        }
        Ok(match parts.pop().map(|whole| whole.measure) {
            Some(Measure::Of(unit)) => Some(unit),
            _ => None,
        })
    }
}

fn measure(
    kind: &NodeKind,
    span: &Range<usize>,
    parts: &[Part],
    tree: &Tree,
    units: &BTreeMap<String, Unit>,
) -> Result<Measure, Fault> {
    let part = |id: &Id| &parts[*id];
    match kind {
        NodeKind::Number(x, None) if *x == 0.0 => Ok(Measure::Any),
        NodeKind::Number(_, None) | NodeKind::Unary(Unary::Not, _) => Ok(plain()),
        NodeKind::Number(_, Some(written)) => {
            let unit = Unit::parse(&tree.text[written.clone()]).map_err(|error| {
                let at = written.start + error.range.start..written.start + error.range.end;
                let fault = Fault::new(at, error.message);
                match error.nearest {
                    Some(near) => fault.help(format!("did you mean `{near}`?")),
                    None => fault,
                }
            })?;
            Ok(Measure::Of(unit))
        }
        NodeKind::Name(name) => Ok(units.get(name).map_or_else(plain, |u| Measure::Of(u.clone()))),
        NodeKind::Unary(_, a) | NodeKind::Slice(a, ..) | NodeKind::Table(_, a) => {
            Ok(part(a).measure.clone())
        }
        NodeKind::Index(base, index) => {
            part(index).demand_plain("an index")?;
            Ok(part(base).measure.clone())
        }
        NodeKind::List(ids) => same(ids.iter().map(part)),
        NodeKind::Binary(operator, a, b) => binary(*operator, part(a), part(b), span),
        NodeKind::Call(function, ids) => {
            let arguments: Vec<&Part> = ids.iter().map(part).collect();
            call(function, &arguments, span)
        }
    }
}

fn binary(operator: Binary, a: &Part, b: &Part, span: &Range<usize>) -> Result<Measure, Fault> {
    match operator {
        Binary::Multiply => product(&a.measure, &b.measure, 1.0, span),
        Binary::Divide => product(&a.measure, &b.measure, -1.0, span),
        Binary::Power => power(a, b, span),
        _ if operator.compares() => same([a, b].into_iter()).map(|_| plain()),
        _ if operator.joins_conditions() => Ok(plain()),
        Binary::Add | Binary::Subtract => sum(operator, a, b),
        _ => same([a, b].into_iter()),
    }
}

fn call(function: &Function, arguments: &[&Part], span: &Range<usize>) -> Result<Measure, Fault> {
    let first = || arguments[0].measure.clone();
    match function.action {
        Action::Unary(Unary::Abs | Unary::Floor | Unary::Ceil) | Action::Sum | Action::Mean => {
            Ok(first())
        }
        Action::Unary(Unary::Sign) | Action::Length => Ok(plain()),
        Action::Unary(Unary::Sqrt) => raised(&first(), 0.5, span),
        Action::Binary(Binary::Power) => power(arguments[0], arguments[1], span),
        Action::Binary(Binary::Atan2) => same(arguments.iter().copied()).map(|_| plain()),
        Action::Binary(Binary::Hypot) | Action::Fold(Binary::Min | Binary::Max, _) => {
            same(arguments.iter().copied())
        }
        Action::If => same(arguments[1..].iter().copied()),
        Action::Dot | Action::MatrixProduct => {
            product(&arguments[0].measure, &arguments[1].measure, 1.0, span)
        }
        Action::Recurrence => {
            arguments[1].demand_plain("the factor of `recurrence`")?;
            same([arguments[0], arguments[2]].into_iter())
        }
        Action::Interpolate => {
            same(arguments[..2].iter().copied())?;
            Ok(arguments[2].measure.clone())
        }
        Action::Density(density) => {
            let shared = of_one_unit(density);
            same(shared.iter().map(|i| arguments[*i]))?;
            for (i, argument) in arguments.iter().enumerate() {
                if !shared.contains(&i) {
                    argument.demand_plain(&format!("`{}`", function.arguments[i]))?;
                }
            }
            Ok(plain())
        }
        Action::Unary(_) | Action::Binary(_) | Action::Fold(..) => {
            for argument in arguments {
                argument.demand_plain(&format!("the argument of `{}`", function.name))?;
            }
            Ok(plain())
        }
    }
}

/// Indices of the arguments of a density that must have the unit of its variable.
fn of_one_unit(density: Density) -> &'static [usize] {
    match density {
        Density::Normal | Density::Uniform | Density::Cauchy => &[0, 1, 2],
        Density::StudentT => &[0, 2, 3],
        Density::Exponential => &[0, 1],
        Density::Gamma | Density::InverseGamma => &[0, 2],
        Density::LogNormal | Density::Beta | Density::Poisson | Density::Binomial => &[],
    }
}

fn plain() -> Measure {
    Measure::Of(Unit::dimensionless())
}

/// The common unit of all parts.
fn same<'a>(parts: impl Iterator<Item = &'a Part>) -> Result<Measure, Fault> {
    let mut common: Option<&Unit> = None;
    for part in parts {
        let Measure::Of(unit) = &part.measure else { continue };
        match common {
            None => common = Some(unit),
            Some(first) => part.demand(first)?,
        }
    }
    Ok(common.map_or(Measure::Any, |unit| Measure::Of(unit.clone())))
}

/// The unit of a sum or a difference: that of two temperatures in `degC` is a difference in `K`, which may be added to
/// one of them.
fn sum(operator: Binary, a: &Part, b: &Part) -> Result<Measure, Fault> {
    let (Measure::Of(left), Measure::Of(right)) = (&a.measure, &b.measure) else {
        return same([a, b].into_iter());
    };
    let step = left.difference();
    match operator {
        Binary::Subtract if left == right => Ok(Measure::Of(step)),
        _ if *right == step => Ok(a.measure.clone()),
        Binary::Add if *left == right.difference() => Ok(b.measure.clone()),
        _ => same([a, b].into_iter()),
    }
}

fn product(a: &Measure, b: &Measure, exponent: f64, span: &Range<usize>) -> Result<Measure, Fault> {
    let (Measure::Of(a), Measure::Of(_)) = (a, b) else { return Ok(Measure::Any) };
    let Measure::Of(b) = raised(b, exponent, span)? else { return Ok(Measure::Any) };
    let unit = a.times(&b).ok_or_else(|| with_own_zero(span))?;
    Ok(Measure::Of(unit))
}

fn power(base: &Part, exponent: &Part, span: &Range<usize>) -> Result<Measure, Fault> {
    exponent.demand_plain("an exponent")?;
    match (&base.measure, exponent.value) {
        (Measure::Of(unit), _) if *unit == Unit::dimensionless() => Ok(plain()),
        (measure, Some(exponent)) => raised(measure, exponent, span),
        (Measure::Any, None) => Ok(Measure::Any),
        (Measure::Of(unit), None) => Err(Fault::new(
            exponent.span.clone(),
            format!("the power of a quantity in `{unit}` has a unit that is not known"),
        )
        .expected("a number as exponent")),
    }
}

fn raised(measure: &Measure, exponent: f64, span: &Range<usize>) -> Result<Measure, Fault> {
    let Measure::Of(unit) = measure else { return Ok(Measure::Any) };
    if *unit == Unit::dimensionless() || exponent == 0.0 {
        return Ok(plain());
    }
    let raised = unit.power(exponent).ok_or_else(|| {
        Fault::new(span.clone(), format!("`{unit}` to the power {exponent} is not a unit"))
    })?;
    Ok(Measure::Of(raised))
}

fn with_own_zero(span: &Range<usize>) -> Fault {
    Fault::new(span.clone(), "a temperature with its own zero cannot be multiplied").help("use `K`")
}

impl Part {
    /// Requires a unit, or zero, which is compatible with every unit.
    fn demand(&self, wanted: &Unit) -> Result<(), Fault> {
        let Measure::Of(unit) = &self.measure else { return Ok(()) };
        if unit == wanted {
            return Ok(());
        }
        let fault = Fault::new(self.span.clone(), "the units do not agree")
            .expected(format!("`{wanted}`"))
            .found(format!("`{unit}`"));
        Err(if wanted.same_dimension(unit) {
            fault.help("numbers are not converted: use one unit for both")
        } else if self.value.is_some() {
            fault.help(format!("a number with its unit is written `2.5 {{{wanted}}}`"))
        } else {
            fault
        })
    }

    fn demand_plain(&self, what: &str) -> Result<(), Fault> {
        match &self.measure {
            Measure::Of(unit) if *unit != Unit::dimensionless() => {
                Err(Fault::new(self.span.clone(), format!("{what} has a unit"))
                    .expected("a plain number")
                    .found(format!("`{unit}`")))
            }
            _ => Ok(()),
        }
    }
}

/// Value of a subexpression that consists of numbers only.
fn value(kind: &NodeKind, parts: &[Part]) -> Option<f64> {
    let of = |id: &Id| parts[*id].value;
    Some(match kind {
        NodeKind::Number(x, _) => *x,
        NodeKind::Unary(Unary::Negate, a) => -of(a)?,
        NodeKind::Binary(operator, a, b) => match operator {
            Binary::Add => of(a)? + of(b)?,
            Binary::Subtract => of(a)? - of(b)?,
            Binary::Multiply => of(a)? * of(b)?,
            Binary::Divide => of(a)? / of(b)?,
            _ => return None,
        },
        _ => return None,
    })
}
