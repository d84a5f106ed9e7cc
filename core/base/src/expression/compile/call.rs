//! Compilation of function calls.

use std::ops::Range;
use std::sync::Arc;

use super::value::{Argument, Kind, Value, fit};
use super::{Compiler, Fault};
use crate::data::{Field, Interpolation};
use crate::expression::curve::Curve;
use crate::expression::function::{Action as Does, Function, Reduction};
use crate::expression::operator::{Binary, Unary};
use crate::expression::program::{Action, Place};

impl Compiler {
    pub(super) fn call(
        &mut self,
        function: &Function,
        arguments: &[Argument],
        span: &Range<usize>,
    ) -> Result<Value, Fault> {
        match function.action {
            Does::Unary(operation) => {
                let a = arguments[0].number()?;
                Ok(self.unary(operation, a))
            }
            Does::Binary(operation) => {
                let values = numbers(arguments, span)?;
                Ok(self.binary(operation, values[0], values[1]))
            }
            Does::Fold(operation, reduction) => self.fold(operation, reduction, arguments, span),
            Does::If => self.choose(arguments, span),
            Does::Sum => self.reduced(Reduction::Sum, &arguments[0]),
            Does::Mean => {
                let sum = self.reduced(Reduction::Sum, &arguments[0])?;
                let count = self.number(arguments[0].value.place.length as f64);
                Ok(self.binary(Binary::Divide, sum, count))
            }
            Does::Dot => {
                let (a, b) = (arguments[0].vector()?, arguments[1].vector()?);
                fit(&[&arguments[0], &arguments[1]], span)?;
                let products = self.binary(Binary::Multiply, a, b);
                Ok(self.reduce(Reduction::Sum, products))
            }
            Does::Length => {
                let length = arguments[0].vector()?.place.length;
                Ok(self.number(length as f64))
            }
            Does::MatrixProduct => self.matrix_product(&arguments[0], &arguments[1]),
            Does::Recurrence => self.recurrence(arguments, span),
            Does::Interpolate => self.interpolate(arguments),
            Does::Density(density) => {
                let values = numbers(arguments, span)?;
                Ok(self.density(density, &values))
            }
        }
    }

    fn fold(
        &mut self,
        operation: Binary,
        reduction: Reduction,
        arguments: &[Argument],
        span: &Range<usize>,
    ) -> Result<Value, Fault> {
        if let [only] = arguments {
            return self.reduced(reduction, only);
        }
        let values = numbers(arguments, span)?;
        let (first, rest) =
            values.split_first().unwrap_or_else(|| unreachable!("arity is checked"));
        Ok(rest.iter().fold(*first, |folded, value| self.binary(operation, folded, *value)))
    }

    fn choose(&mut self, arguments: &[Argument], span: &Range<usize>) -> Result<Value, Fault> {
        let [condition, yes, no] = arguments else { unreachable!("arity is checked") };
        let values = (condition.condition()?, yes.number()?, no.number()?);
        fit(&[condition, yes, no], span)?;
        Ok(self.select(values.0, values.1, values.2))
    }

    fn reduced(&mut self, reduction: Reduction, argument: &Argument) -> Result<Value, Fault> {
        let vector = argument.vector()?;
        Ok(self.reduce(reduction, vector))
    }

    fn reduce(&mut self, reduction: Reduction, vector: Value) -> Value {
        let place = self.emit(Action::Reduce(reduction, vector.place), 1);
        Value { kind: Kind::Number, place, vector: false }
    }

    fn matrix_product(&mut self, matrix: &Argument, vector: &Argument) -> Result<Value, Fault> {
        let Kind::Matrix(table) = matrix.value.kind else {
            return Err(Fault::new(matrix.span.clone(), "this is not a matrix")
                .expected("data that are a list of rows"));
        };
        let value = vector.vector()?;
        let (rows, columns) =
            (self.tables.matrices[table].rows(), self.tables.matrices[table].columns());
        if value.place.length != columns {
            return Err(Fault::new(vector.span.clone(), "the vector does not fit the matrix")
                .expected(format!("{columns} elements, one for each column"))
                .found(format!("{}", value.place.length)));
        }
        let place = self.emit(Action::MatrixProduct(table, value.place), rows);
        Ok(Value { kind: Kind::Number, place, vector: true })
    }

    fn recurrence(&mut self, arguments: &[Argument], span: &Range<usize>) -> Result<Value, Fault> {
        let [start, factor, input] = arguments else { unreachable!("arity is checked") };
        let (first, factors, inputs) = (start.number()?, factor.number()?, input.vector()?);
        if first.vector {
            return Err(Fault::new(start.span.clone(), "a vector stands where one number belongs")
                .expected("the number before the first element"));
        }
        fit(&[factor, input], span)?;
        let action = Action::Recurrence(first.place, factors.place, inputs.place);
        Ok(Value { place: self.emit(action, inputs.place.length), ..inputs })
    }

    fn interpolate(&mut self, arguments: &[Argument]) -> Result<Value, Fault> {
        let [x, nodes, values] = arguments else { unreachable!("arity is checked") };
        let at = x.number()?;
        let table = |argument: &Argument| {
            self.known(argument.vector()?).ok_or_else(|| {
                Fault::new(argument.span.clone(), "the table depends on an unknown")
                    .expected("a vector of data")
            })
        };
        let (at_nodes, heights) = (table(nodes)?, table(values)?);
        if at_nodes.len() != heights.len() {
            let (nodes, found) = (at_nodes.len(), heights.len());
            return Err(Fault::new(
                values.span.clone(),
                "the table has another length than its nodes",
            )
            .expected(format!("{nodes} values"))
            .found(format!("{found}")));
        }
        let falling = at_nodes.windows(2).find(|pair| pair[0] >= pair[1]);
        if let Some(&[before, after]) = falling {
            return Err(Fault::new(nodes.span.clone(), "the nodes do not ascend")
                .expected("each node above the one before")
                .found(format!("{after} after {before}")));
        }
        let curve = Curve::new(at_nodes, heights, Interpolation::Linear);
        self.tables.curves.push(Arc::new(curve));
        let action = Action::Interpolate(self.tables.curves.len() - 1, at.place);
        Ok(Value { place: self.emit(action, at.place.length), ..at })
    }

    /// Compiles a call of a function given by a table.
    pub(super) fn table(&mut self, name: &str, argument: &Argument) -> Result<Value, Fault> {
        let at = argument.number()?;
        if let Some(field) = self.fields.get(name).cloned() {
            return self.field(&field, at, &argument.span);
        }
        let curve = if let Some(curve) = self.curves.get(name) {
            *curve
        } else {
            let function = &self.functions[name];
            let (nodes, values) = (function.at.clone(), function.values.clone());
            let curve = Curve::new(nodes, values, function.interpolation);
            self.tables.curves.push(Arc::new(curve));
            self.curves.insert(name.to_owned(), self.tables.curves.len() - 1);
            self.tables.curves.len() - 1
        };
        Ok(self.interpolated(curve, at))
    }

    fn interpolated(&mut self, curve: usize, at: Value) -> Value {
        let place = self.emit(Action::Interpolate(curve, at.place), at.place.length);
        Value { place, ..at }
    }

    /// Compiles the value of a random field at a place: its level and the sum of its modes times their coefficients.
    fn field(&mut self, field: &Field, at: Value, span: &Range<usize>) -> Result<Value, Fault> {
        let coefficients = self.names.get(&field.vector()).copied();
        let given = coefficients.filter(|value| value.place.length == field.terms());
        let Some(coefficients) = given else {
            let message = format!("the coefficients of the field `{}` are not known", field.name);
            return Err(Fault::new(span.clone(), message));
        };
        let first = self.curves_of(field);
        let mut sum = self.interpolated(first, at);
        for k in 0..field.terms() {
            let mode = self.interpolated(first + 1 + k, at);
            let place =
                Place { start: coefficients.place.start + k, length: 1, ..coefficients.place };
            let coefficient = Value { kind: Kind::Number, place, vector: false };
            let term = self.binary(Binary::Multiply, mode, coefficient);
            sum = self.binary(Binary::Add, sum, term);
        }
        Ok(if field.log_normal { self.unary(Unary::Exp, sum) } else { sum })
    }

    /// Index in the tables of the level of a field, which its modes follow.
    fn curves_of(&mut self, field: &Field) -> usize {
        if let Some(first) = self.curves.get(&field.name) {
            return *first;
        }
        let first = self.tables.curves.len();
        let curves = std::iter::once(&field.level[..]).chain(field.modes.iter_rows());
        let curves = curves
            .map(|values| Curve::new(field.at.clone(), values.to_vec(), Interpolation::Spline));
        self.tables.curves.extend(curves.map(Arc::new));
        self.curves.insert(field.name.clone(), first);
        first
    }
}

/// Numbers or vectors of the arguments, after their shapes have been checked.
fn numbers(arguments: &[Argument], span: &Range<usize>) -> Result<Vec<Value>, Fault> {
    let values = arguments.iter().map(Argument::number).collect::<Result<Vec<Value>, Fault>>()?;
    fit(&arguments.iter().collect::<Vec<_>>(), span)?;
    Ok(values)
}
