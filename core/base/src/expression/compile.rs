//! Compilation of trees to instructions: names are looked up, shapes checked, constants folded, common subexpressions
//! shared.

mod call;
mod density;
mod value;

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use super::function::{functions, table_usage};
use super::operator::{Binary, Lanes, Unary};
use super::program::{Action, Instruction, Place, Program, Tables, WIDE};
use super::scope::{Data, Scope, element};
use super::token::is_name;
use super::tree::{Id, Node, NodeKind, Tree};
use super::{Fault, forward};
use crate::data;
use crate::text::nearest::nearest;
use value::{Argument, Kind, Value, fit};

pub(super) struct Compiler {
    names: BTreeMap<String, Value>,
    unknowns: usize,
    registers: usize,
    constants: Vec<Lanes<1>>,
    /// Numbers that are already in `constants`, keyed by their bits.
    numbers: BTreeMap<u64, Place>,
    instructions: Vec<Instruction>,
    /// Results of the instructions emitted so far, for common subexpressions.
    results: BTreeMap<Action, Place>,
    tables: Tables,
    /// Functions given by tables.
    functions: BTreeMap<String, Arc<data::Function>>,
    fields: BTreeMap<String, Arc<data::Field>>,
    /// Index in `tables` of the functions that have been used; of a field that of its level, followed by its modes.
    curves: BTreeMap<String, usize>,
}

impl Compiler {
    /// A compiler that knows the unknowns and the data of the scope.
    pub fn new(scope: &Scope) -> Result<Self, Vec<Fault>> {
        let unknowns = scope.unknowns.len();
        let mut compiler = Self {
            names: BTreeMap::new(),
            unknowns,
            registers: unknowns,
            constants: Vec::new(),
            numbers: BTreeMap::new(),
            instructions: Vec::new(),
            results: BTreeMap::new(),
            tables: Tables::default(),
            functions: scope.functions.clone(),
            fields: scope.fields.clone(),
            curves: BTreeMap::new(),
        };
        for (name, x) in [("pi", std::f64::consts::PI), ("e", std::f64::consts::E)] {
            let value = compiler.number(x);
            compiler.names.insert(name.to_owned(), value);
        }
        compiler.unknowns(&scope.unknowns)?;
        for (name, data) in &scope.data {
            let value = match data {
                Data::Number(x) => compiler.number(*x),
                Data::Vector(elements) => compiler.vector(elements),
                Data::Matrix(matrix) => {
                    compiler.tables.matrices.push(matrix.clone());
                    let kind = Kind::Matrix(compiler.tables.matrices.len() - 1);
                    Value { kind, ..compiler.number(0.0) }
                }
            };
            compiler.names.insert(name.clone(), value);
        }
        Ok(compiler)
    }

    fn unknowns(&mut self, unknowns: &[String]) -> Result<(), Vec<Fault>> {
        let mut vectors: BTreeMap<&str, BTreeMap<usize, usize>> = BTreeMap::new();
        for (register, name) in unknowns.iter().enumerate() {
            if let Some((base, index)) = element(name) {
                vectors.entry(base).or_default().insert(index, register);
            } else {
                let place = Place { constant: false, start: register, length: 1 };
                let value = Value { kind: Kind::Number, place, vector: false };
                self.names.insert(name.clone(), value);
            }
        }
        for (base, elements) in vectors {
            let missing = (1..).zip(elements.keys()).find(|(expected, index)| expected != *index);
            if let Some((expected, _)) = missing {
                let message = format!("the vector `{base}` has no element `{base}[{expected}]`");
                return Err(vec![Fault::new(0..0, message).help("elements count from 1")]);
            }
            let registers: Vec<usize> = elements.into_values().collect();
            let part = |start: &usize| Place { constant: false, start: *start, length: 1 };
            let in_order = registers.windows(2).all(|pair| pair[0] + 1 == pair[1]);
            let place = if in_order {
                Place { length: registers.len(), ..part(&registers[0]) }
            } else {
                self.emit(Action::Join(registers.iter().map(part).collect()), registers.len())
            };
            self.names.insert(base.to_owned(), Value { kind: Kind::Number, place, vector: true });
        }
        Ok(())
    }

    /// Compiles a definition whose dependencies have been compiled.
    pub fn define(&mut self, name: &str, tree: &Tree) -> Result<(), Fault> {
        let mut values: Vec<Value> = Vec::with_capacity(tree.nodes.len());
        for node in &tree.nodes {
            let value = self.node(tree, node, &values)?;
            values.push(value);
        }
        self.names.extend(values.pop().map(|whole| (name.to_owned(), whole)));
        Ok(())
    }

    /// The program that computes the outputs.
    pub fn finish(self, scope: &Scope, outputs: &[&str]) -> Result<Program, Fault> {
        let mut places = Vec::new();
        for name in outputs {
            let value = self.names.get(*name).copied();
            let tree = scope.definitions.get(*name);
            let (Some(value), Some(tree)) = (value, tree) else {
                return Err(Fault::new(0..0, format!("there is no definition `{name}`")));
            };
            let whole = Argument { value, span: 0..tree.text.len() };
            let value = whole.number().map_err(|fault| fault.within(name))?;
            places.push(value.place);
        }
        let program = Program {
            instructions: self.instructions,
            tables: self.tables,
            unknowns: self.unknowns,
            wide_constants: self.constants.iter().map(|lane| [lane[0]; WIDE]).collect(),
            constants: self.constants,
            registers: self.registers,
            outputs: places,
        };
        Ok(program.pruned())
    }

    fn number(&mut self, x: f64) -> Value {
        let constants = &mut self.constants;
        let place = *self.numbers.entry(x.to_bits()).or_insert_with(|| {
            constants.push([x]);
            Place { constant: true, start: constants.len() - 1, length: 1 }
        });
        Value { kind: Kind::Number, place, vector: false }
    }

    fn vector(&mut self, elements: &[f64]) -> Value {
        let place = Place { constant: true, start: self.constants.len(), length: elements.len() };
        self.constants.extend(elements.iter().map(|x| [*x]));
        Value { kind: Kind::Number, place, vector: true }
    }

    /// The elements of a value that does not depend on the point; `None` if it does.
    fn known(&self, value: Value) -> Option<Vec<f64>> {
        let elements = || self.constants[value.place.range()].iter().map(|lane| lane[0]).collect();
        value.place.constant.then(elements)
    }

    /// The place of a result: a folded constant if all arguments are constant, an existing place if the same result has
    /// been computed, otherwise that of a new instruction.
    fn emit(&mut self, action: Action, length: usize) -> Place {
        if let Some(place) = self.results.get(&action) {
            return *place;
        }
        let constant = action.places().iter().all(|place| place.constant);
        let start = if constant { self.constants.len() } else { self.registers };
        if constant {
            let mut out = vec![[0.0]; length];
            forward::step(&action, &self.tables, &self.constants, &[], &mut out);
            self.constants.extend(out);
        } else {
            self.registers += length;
            self.instructions.push(Instruction { action: action.clone(), start, length });
        }
        let place = Place { constant, start, length };
        self.results.insert(action, place);
        place
    }

    fn unary(&mut self, operation: Unary, a: Value) -> Value {
        Value { place: self.emit(Action::Unary(operation, a.place), a.place.length), ..a }
    }

    /// The result of an operation on values whose shapes fit.
    fn binary(&mut self, operation: Binary, a: Value, b: Value) -> Value {
        if operation == Binary::Power && b.place.constant && !b.vector {
            let exponent = self.constants[b.place.start][0];
            if let Some(operations) = simple_power(exponent) {
                return operations.iter().fold(a, |a, operation| self.unary(*operation, a));
            }
        }
        let yields_condition = operation.compares() || operation.joins_conditions();
        Value {
            kind: if yields_condition { Kind::Condition } else { Kind::Number },
            place: self.emit(
                Action::Binary(operation, a.place, b.place),
                a.place.length.max(b.place.length),
            ),
            vector: a.vector || b.vector,
        }
    }

    /// One of two values according to a condition; all shapes fit.
    fn select(&mut self, condition: Value, yes: Value, no: Value) -> Value {
        let parts = [condition, yes, no];
        let length = parts.iter().map(|part| part.place.length).max().unwrap_or(1);
        Value {
            kind: Kind::Number,
            place: self.emit(Action::Select(condition.place, yes.place, no.place), length),
            vector: parts.iter().any(|part| part.vector),
        }
    }

    fn node(&mut self, tree: &Tree, node: &Node, values: &[Value]) -> Result<Value, Fault> {
        let argument =
            |id: &Id| Argument { value: values[*id], span: tree.nodes[*id].span.clone() };
        match &node.kind {
            NodeKind::Number(x, _) => Ok(self.number(*x)),
            NodeKind::Name(name) => self.name(name, &node.span),
            NodeKind::Unary(Unary::Not, a) => {
                let a = argument(a).condition()?;
                Ok(self.unary(Unary::Not, a))
            }
            NodeKind::Unary(operation, a) => {
                let a = argument(a).number()?;
                Ok(self.unary(*operation, a))
            }
            NodeKind::Binary(operation, a, b) => {
                let (a, b) = (argument(a), argument(b));
                fit(&[&a, &b], &node.span)?;
                let check = if operation.joins_conditions() {
                    Argument::condition
                } else {
                    Argument::number
                };
                Ok(self.binary(*operation, check(&a)?, check(&b)?))
            }
            NodeKind::Call(function, ids) => {
                let arguments: Vec<Argument> = ids.iter().map(argument).collect();
                self.call(function, &arguments, &node.span)
            }
            NodeKind::Table(name, id) => self.table(name, &argument(id)),
            NodeKind::Index(base, index) => self.index(&argument(base), &argument(index)),
            NodeKind::Slice(base, first, last) => {
                let ends = [first, last].map(|end| end.as_ref().map(argument));
                self.slice(&argument(base), &ends, &node.span)
            }
            NodeKind::List(ids) => {
                let values: Result<Vec<Value>, Fault> =
                    ids.iter().map(|id| argument(id).number()).collect();
                let parts: Vec<Place> = values?.iter().map(|value| value.place).collect();
                let length = parts.iter().map(|place| place.length).sum();
                let place = self.emit(Action::Join(parts), length);
                Ok(Value { kind: Kind::Number, place, vector: true })
            }
        }
    }

    fn name(&self, name: &str, span: &Range<usize>) -> Result<Value, Fault> {
        if let Some(value) = self.names.get(name) {
            return Ok(*value);
        }
        let fault = Fault::new(span.clone(), format!("unknown name `{name}`"));
        if let Some(function) = functions().find(|function| function.name == name) {
            return Err(fault.help(format!("a function is called as `{}`", function.usage())));
        }
        if self.functions.contains_key(name) || self.fields.contains_key(name) {
            return Err(fault.help(format!("a function is called as `{}`", table_usage(name))));
        }
        // `e` and `pi` are too short to suggest for a misspelt name, and keys of results are not names.
        let meant = |name: &&str| !matches!(*name, "e" | "pi") && is_name(name);
        let names = self.names.keys().map(String::as_str).filter(meant);
        if let Some(near) = nearest(name, names.clone()) {
            return Err(fault.help(format!("did you mean `{near}`?")));
        }
        let listed: Vec<String> = names.take(12).map(|name| format!("`{name}`")).collect();
        Err(if listed.is_empty() {
            fault
        } else {
            fault.help(format!("names that are known: {}", listed.join(", ")))
        })
    }

    fn index(&mut self, base: &Argument, index: &Argument) -> Result<Value, Fault> {
        let vector = base.vector()?;
        let indices = self.indices(index, vector.place.length)?;
        let kind = Kind::Number;
        if let ([index], false) = (&indices[..], index.value.vector) {
            let place = Place { start: vector.place.start + index, length: 1, ..vector.place };
            return Ok(Value { kind, place, vector: false });
        }
        let length = indices.len();
        self.tables.indices.push(indices);
        let table = self.tables.indices.len() - 1;
        let place = self.emit(Action::Gather(vector.place, table), length);
        Ok(Value { kind, place, vector: true })
    }

    fn slice(
        &mut self,
        base: &Argument,
        ends: &[Option<Argument>; 2],
        span: &Range<usize>,
    ) -> Result<Value, Fault> {
        let vector = base.vector()?;
        let length = vector.place.length;
        let mut bounds = [0, length - 1];
        for (bound, end) in bounds.iter_mut().zip(ends) {
            if let Some(end) = end {
                let end = Argument { value: end.scalar()?, ..end.clone() };
                *bound = self.indices(&end, length)?[0];
            }
        }
        let [first, last] = bounds;
        if first > last {
            return Err(Fault::new(span.clone(), "the slice has no elements")
                .expected("a first element that is not behind the last")
                .found(format!("`{}:{}`", first + 1, last + 1)));
        }
        let place =
            Place { start: vector.place.start + first, length: last + 1 - first, ..vector.place };
        Ok(Value { kind: Kind::Number, place, vector: true })
    }

    /// Zero-based indices into a vector of this length.
    fn indices(&self, index: &Argument, length: usize) -> Result<Vec<usize>, Fault> {
        let value = index.number()?;
        let Some(elements) = self.known(value) else {
            return Err(Fault::new(index.span.clone(), "the index depends on an unknown")
                .expected("a number, or a vector of data"));
        };
        let wrong = |x: &f64| x.fract() != 0.0 || !(1.0..=length as f64).contains(x);
        if let Some(x) = elements.iter().find(|x| wrong(x)) {
            return Err(Fault::new(index.span.clone(), "there is no element of this index")
                .expected(format!("a whole number from 1 to {length}"))
                .found(format!("{x}")));
        }
        Ok(elements.into_iter().map(|x| x as usize - 1).collect())
    }
}

/// Powers that can be computed without a logarithm.
fn simple_power(exponent: f64) -> Option<&'static [Unary]> {
    const POWERS: [(f64, &[Unary]); 6] = [
        (1.0, &[]),
        (2.0, &[Unary::Square]),
        (3.0, &[Unary::Cube]),
        (4.0, &[Unary::Square, Unary::Square]),
        (-1.0, &[Unary::Reciprocal]),
        (-2.0, &[Unary::Square, Unary::Reciprocal]),
    ];
    POWERS.into_iter().find(|(power, _)| *power == exponent).map(|(_, operations)| operations)
}
