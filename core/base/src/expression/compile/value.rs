//! Values during compilation: their types and shapes, and checks of them.

use std::ops::Range;

use crate::expression::Fault;
use crate::expression::program::Place;

/// The compiled value of a subexpression.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    pub kind: Kind,
    pub place: Place,
    /// True for a vector (which may have a single element), false for a number.
    pub vector: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Number,
    Condition,
    /// Index of a matrix in the data.
    Matrix(usize),
}

/// A value and its byte range in the text.
#[derive(Clone, Debug)]
pub(super) struct Argument {
    pub value: Value,
    pub span: Range<usize>,
}

impl Argument {
    pub fn number(&self) -> Result<Value, Fault> {
        match self.value.kind {
            Kind::Number => Ok(self.value),
            Kind::Condition => Err(Fault::new(self.span.clone(), "a condition is not a number")
                .help("`if(condition, 1, 0)` makes a number of it")),
            Kind::Matrix(_) => Err(Fault::new(self.span.clone(), "a matrix is not a number")
                .help("`matrix_product(matrix, vector)` makes a vector of it")),
        }
    }

    pub fn condition(&self) -> Result<Value, Fault> {
        match self.value.kind {
            Kind::Condition => Ok(self.value),
            _ => Err(Fault::new(self.span.clone(), "a number is not a condition")
                .expected("a comparison such as `x > 0`")),
        }
    }

    pub fn scalar(&self) -> Result<Value, Fault> {
        let value = self.number()?;
        if !value.vector {
            return Ok(value);
        }
        Err(Fault::new(self.span.clone(), "a vector stands where one number belongs")
            .expected("one number")
            .found(format!("a vector of {}", value.place.length)))
    }

    pub fn vector(&self) -> Result<Value, Fault> {
        let value = self.number()?;
        if value.vector {
            return Ok(value);
        }
        Err(Fault::new(self.span.clone(), "one number stands where a vector belongs")
            .expected("a vector"))
    }
}

/// Requires that all vectors have the same length.
pub(super) fn fit(arguments: &[&Argument], span: &Range<usize>) -> Result<(), Fault> {
    let vectors = arguments.iter().filter(|argument| argument.value.vector);
    let mut lengths = vectors.map(|argument| argument.value.place.length);
    let Some(first) = lengths.next() else { return Ok(()) };
    match lengths.find(|length| *length != first) {
        None => Ok(()),
        Some(other) => Err(Fault::new(span.clone(), "vectors of different lengths")
            .expected("vectors of one length")
            .found(format!("{first} and {other} elements"))),
    }
}
