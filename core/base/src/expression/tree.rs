//! Syntax tree of an expression: a list of nodes in which operands precede the operation.

use std::ops::Range;

use super::function::Function;
use super::operator::{Binary, Unary};
use super::{Fault, parse};

/// Index of a node in its tree.
pub(super) type Id = usize;

/// A parsed expression whose names have not been looked up yet.
///
/// Nodes are kept in one list, operands first, so that deep nesting does not use the stack.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub text: String,
    /// The nodes; the last one is the root.
    pub nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
pub(super) struct Node {
    pub kind: NodeKind,
    /// Byte range of the node.
    pub span: Range<usize>,
}

#[derive(Clone, Debug)]
pub(super) enum NodeKind {
    /// A number and the byte range of its unit without the braces.
    Number(f64, Option<Range<usize>>),
    Name(String),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    Call(&'static Function, Vec<Id>),
    /// `name(x)`: a function given by a table.
    Table(String, Id),
    /// `base[index]`
    Index(Id, Id),
    /// `base[first:last]`
    Slice(Id, Option<Id>, Option<Id>),
    /// `[a, b, …]`
    List(Vec<Id>),
}

impl Tree {
    /// Parses an expression that may call these tables besides the built-in functions.
    pub fn parse(text: &str, tables: &[&str]) -> Result<Self, Fault> {
        Ok(Self { text: text.to_owned(), nodes: parse::nodes(text, tables)? })
    }

    /// Names that occur, in the order of the text, with repetitions.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.nodes.iter().filter_map(|node| match &node.kind {
            NodeKind::Name(name) => Some(name.as_str()),
            _ => None,
        })
    }

    /// Names of the tables that are called, in the order of the text, with repetitions.
    pub fn called(&self) -> impl Iterator<Item = &str> {
        self.nodes.iter().filter_map(|node| match &node.kind {
            NodeKind::Table(name, _) => Some(name.as_str()),
            _ => None,
        })
    }
}
