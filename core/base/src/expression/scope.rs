//! Names of expressions: unknowns, data, definitions.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::Fault;
use super::compile::Compiler;
use super::function::functions;
use super::program::Program;
use super::token::is_name;
use super::tree::{NodeKind, Tree};
use crate::data;
use crate::matrix::Matrix;

/// Names that expressions may use: unknowns, data, and definitions in terms of both.
///
/// ```
/// # use lacuna_base as lacuna;
/// use lacuna::expression::{Data, Scope};
///
/// let mut scope = Scope::new();
/// for name in ["intercept", "slope", "sigma"] {
///     scope.unknown(name)?;
/// }
/// scope.data("x", Data::Vector(vec![0.0, 1.0, 2.0]))?;
/// scope.data("y", Data::Vector(vec![0.9, 3.1, 5.0]))?;
/// scope.define("line", "intercept + slope * x")?;
/// scope.define("density", "sum(normal_log_density(y, line, sigma))")?;
/// let density = scope.compile(&["density"]).expect("no fault");
/// let (value, gradient) = density.gradient(&[1.0, 2.0, 0.1]);
/// assert!((value - 3.1509396794).abs() < 1e-9);
/// assert!((gradient[0] - 0.0).abs() < 1e-9 && (gradient[1] - 10.0).abs() < 1e-9);
/// # Ok::<(), lacuna::expression::Fault>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Scope {
    /// Unknowns, in the order of the coordinates of a point.
    pub(super) unknowns: Vec<String>,
    pub(super) data: BTreeMap<String, Data>,
    pub(super) functions: BTreeMap<String, Arc<data::Function>>,
    pub(super) fields: BTreeMap<String, Arc<data::Field>>,
    pub(super) definitions: BTreeMap<String, Tree>,
}

/// Known numbers that expressions may use.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// One number.
    Number(f64),
    /// A vector with at least one element.
    Vector(Vec<f64>),
    /// A matrix, for `matrix_product`.
    Matrix(Matrix),
}

impl Scope {
    /// An empty scope; `pi` and `e` are predefined, and any declared name may hide them.
    pub fn new() -> Self {
        Self::default()
    }

    /// Declares the next coordinate of a point: a name such as `sigma`, or an element such as `theta[1]` of a vector.
    ///
    /// The elements of a vector count from 1 and may be declared in any order. Coefficients of a field are declared
    /// after it ([`Scope::field`]).
    pub fn unknown(&mut self, name: &str) -> Result<(), Fault> {
        let base = element(name).map_or(name, |(base, _)| base);
        if !self.fields.values().any(|field| field.vector() == base) {
            self.declare(base, name)?;
        }
        self.unknowns.push(name.to_owned());
        Ok(())
    }

    /// Declares data.
    ///
    /// # Errors
    /// If the name is not valid or already taken.
    pub fn data(&mut self, name: &str, data: Data) -> Result<(), Fault> {
        self.declare(name, name)?;
        let empty = match &data {
            Data::Number(_) => false,
            Data::Vector(elements) => elements.is_empty(),
            Data::Matrix(matrix) => matrix.rows() == 0 || matrix.columns() == 0,
        };
        if empty {
            let fault = Fault::new(0..0, format!("the data `{name}` are empty"));
            return Err(fault.expected("at least one number"));
        }
        self.data.insert(name.to_owned(), data);
        Ok(())
    }

    /// Declares a function that is given by a table: constant beyond the first and the last point.
    /// Expressions defined afterwards call it as `name(x)`.
    ///
    /// ```
    /// # use lacuna_base as lacuna;
    /// use lacuna::data::{Function, Interpolation, Unit};
    /// use lacuna::expression::Scope;
    ///
    /// let unit = |text: &str| Unit::parse(text).expect("a unit");
    /// let force = Function {
    ///     name: "force".to_owned(),
    ///     at: vec![0.0, 1.0, 3.0],
    ///     at_unit: unit("s"),
    ///     values: vec![0.0, 4.0, 2.0],
    ///     unit: unit("N"),
    ///     interpolation: Interpolation::Linear,
    /// };
    /// let mut scope = Scope::new();
    /// scope.unknown("t")?;
    /// scope.function(force.into())?;
    /// scope.define("work_rate", "force(t) * 2 {m/s}")?;
    /// let program = scope.compile(&["work_rate"]).expect("no fault");
    /// assert_eq!(program.gradient(&[2.0]), (6.0, vec![-2.0]));
    /// assert_eq!(program.gradient(&[5.0]), (4.0, vec![0.0]));
    /// # Ok::<(), lacuna::expression::Fault>(())
    /// ```
    pub fn function(&mut self, function: Arc<data::Function>) -> Result<(), Fault> {
        self.tabulated(&function.name, &function.at, function.values.len())?;
        self.functions.insert(function.name.clone(), function);
        Ok(())
    }

    /// Declares a random field. Expressions defined afterwards call it as `name(x)`; its coefficients
    /// ([`data::Field::coefficients`]) are unknowns, which are declared afterwards too.
    pub fn field(&mut self, field: Arc<data::Field>) -> Result<(), Fault> {
        self.tabulated(&field.name, &field.at, field.level.len())?;
        self.fields.insert(field.name.clone(), field);
        Ok(())
    }

    /// Rejects a table that cannot be called by this name.
    fn tabulated(&self, name: &str, at: &[f64], values: usize) -> Result<(), Fault> {
        self.declare(name, name)?;
        let fault =
            |message: String| Err(Fault::new(0..0, format!("the function `{name}` {message}")));
        if functions().any(|built_in| built_in.name == name) {
            return fault("has the name of one that expressions know".to_owned());
        }
        let places = at.len();
        if places == 0 || places != values {
            return fault(format!("has {places} places and {values} values"));
        }
        let ascends = |pair: &[f64]| pair[0].partial_cmp(&pair[1]) == Some(Ordering::Less);
        if let Some(&[before, after]) = at.windows(2).find(|pair| !ascends(pair)) {
            return fault(format!("has places that do not ascend: {after} after {before}"));
        }
        Ok(())
    }

    /// Names that expressions call besides the built-in functions.
    pub(super) fn tables(&self) -> Vec<&str> {
        self.functions.keys().chain(self.fields.keys()).map(String::as_str).collect()
    }

    /// Defines an expression that no other expression can use: its key is a text that is not a valid name.
    pub fn result(&mut self, key: &str, text: &str) -> Result<(), Fault> {
        if is_name(key) || self.definitions.contains_key(key) {
            let message = format!("`{key}` cannot be the key of a result, or is one already");
            return Err(Fault::new(0..0, message).within(key));
        }
        self.read(key, text)
    }

    /// Defines a named expression; the order of definitions does not matter. Only the syntax is checked here:
    /// [`Scope::compile`] looks up the names once all of them are known.
    pub fn define(&mut self, name: &str, text: &str) -> Result<(), Fault> {
        self.declare(name, name).map_err(|fault| fault.within(name))?;
        self.read(name, text)
    }

    fn read(&mut self, name: &str, text: &str) -> Result<(), Fault> {
        let tree = Tree::parse(text, &self.tables()).map_err(|fault| fault.within(name))?;
        self.definitions.insert(name.to_owned(), tree);
        Ok(())
    }

    /// Rejects invalid names and names that are already taken.
    fn declare(&self, base: &str, name: &str) -> Result<(), Fault> {
        if !is_name(base) {
            return Err(Fault::new(0..0, format!("`{name}` cannot be a name in an expression"))
                .expected("letters, digits and `_`, not beginning with a digit")
                .help("`and`, `or` and `not` are words of the language"));
        }
        let taken_by_unknown = self.unknowns.iter().any(|other| match element(other) {
            Some((other_base, _)) => other == name || (other_base == base && base == name),
            None => other == base,
        });
        let taken = taken_by_unknown
            || self.data.contains_key(base)
            || self.functions.contains_key(base)
            || self.fields.contains_key(base)
            || self.definitions.contains_key(base);
        if taken {
            return Err(Fault::new(0..0, format!("there are two of the name `{name}`"))
                .help("give one of them another name"));
        }
        Ok(())
    }

    /// Compiles the definitions with these names to one program with these outputs. Every definition is checked,
    /// including those that no output needs. A definition may be a condition or a vector, an output may be a vector.
    ///
    /// # Errors
    /// One fault for each definition that fails by itself; definitions that fail only because of others give none.
    pub fn compile(&self, outputs: &[&str]) -> Result<Program, Vec<Fault>> {
        let order = self.order()?;
        let mut compiler = Compiler::new(self)?;
        let mut faults = Vec::new();
        let mut failed: BTreeSet<&str> = BTreeSet::new();
        for name in order {
            let tree = &self.definitions[name];
            if tree.names().any(|used| failed.contains(used)) {
                failed.insert(name);
            } else if let Err(fault) = compiler.define(name, tree) {
                failed.insert(name);
                faults.push(fault.within(name));
            }
        }
        if faults.is_empty() {
            compiler.finish(self, outputs).map_err(|f| vec![f])
        } else {
            Err(faults)
        }
    }

    /// Names of the definitions in topological order, each after those it uses.
    pub(super) fn order(&self) -> Result<Vec<&str>, Vec<Fault>> {
        let mut left: Vec<&str> = self.definitions.keys().map(String::as_str).collect();
        let mut order: Vec<&str> = Vec::with_capacity(left.len());
        loop {
            let waits = |name: &&str| self.definitions[*name].names().any(|n| left.contains(&n));
            let (waiting, ready): (Vec<&str>, Vec<&str>) =
                left.iter().copied().partition(|name| waits(name));
            order.extend(&ready);
            if waiting.is_empty() {
                return Ok(order);
            }
            if ready.is_empty() {
                return Err(vec![self.circle(&waiting)]);
            }
            left = waiting;
        }
    }

    /// The fault for definitions that depend on each other in a cycle.
    fn circle(&self, waiting: &[&str]) -> Fault {
        let next = |name: &str| {
            let tree = &self.definitions[name];
            let used = tree.nodes.iter().find_map(|node| match &node.kind {
                NodeKind::Name(used) => {
                    let used = waiting.iter().find(|name| *name == used)?;
                    Some((*used, node.span.clone()))
                }
                _ => None,
            });
            used.unwrap_or_else(|| unreachable!("a definition that waits uses one that waits"))
        };
        // From any definition, as many steps as there are definitions end inside a cycle.
        let start = waiting.iter().fold(waiting[0], |name, _| next(name).0);
        let mut path = vec![format!("`{start}`")];
        let (mut name, span) = next(start);
        while name != start {
            path.push(format!("`{name}`"));
            name = next(name).0;
        }
        path.push(format!("`{start}`"));
        Fault::new(span, format!("`{start}` is defined by itself"))
            .found(path.join(" by "))
            .within(start)
    }
}

/// Base and index of a name such as `theta[3]`.
pub(super) fn element(name: &str) -> Option<(&str, usize)> {
    let (base, index) = name.strip_suffix(']')?.split_once('[')?;
    Some((base, index.parse().ok()?))
}
