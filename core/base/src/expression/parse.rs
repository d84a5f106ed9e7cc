//! Parser of expressions: Pratt's method, with a binding power for every operator.
//!
//! V. R. Pratt, Top down operator precedence, POPL 1973.

use std::ops::Range;

use super::Fault;
use super::function::{self, Function};
use super::operator::{Binary, Unary};
use super::token::{Kind, Token, tokens};
use super::tree::{Id, Node, NodeKind};

/// Largest nesting depth of parentheses, signs and powers.
const DEEPEST: usize = 200;

/// Binding powers, loosest first.
const OR: u8 = 1;
const AND: u8 = 2;
const COMPARISON: u8 = 4;
const SUM: u8 = 5;
const PRODUCT: u8 = 6;
const SIGN: u8 = 7;
const POWER: u8 = 8;

/// Parses a whole text to nodes.
pub(super) fn nodes(text: &str, tables: &[&str]) -> Result<Vec<Node>, Fault> {
    let tokens = tokens(text)?;
    let mut parser = Parser { text, tables, tokens, at: 0, nodes: Vec::new(), depth: 0 };
    if parser.peek().kind == Kind::End {
        return Err(Fault::new(0..0, "the expression is empty"));
    }
    parser.expression(OR)?;
    match parser.peek().kind {
        Kind::End => Ok(parser.nodes),
        _ => Err(parser.misplaced()),
    }
}

struct Parser<'t> {
    text: &'t str,
    /// Names of functions given by tables.
    tables: &'t [&'t str],
    tokens: Vec<Token>,
    at: usize,
    nodes: Vec<Node>,
    depth: usize,
}

/// The infix operator that a symbol denotes, and its binding power.
fn infix(kind: Kind) -> Option<(Binary, u8)> {
    let Kind::Symbol(symbol) = kind else { return None };
    Some(match symbol {
        "or" => (Binary::Or, OR),
        "and" => (Binary::And, AND),
        "<" => (Binary::Less, COMPARISON),
        "<=" => (Binary::AtMost, COMPARISON),
        ">" => (Binary::Greater, COMPARISON),
        ">=" => (Binary::AtLeast, COMPARISON),
        "==" => (Binary::Equal, COMPARISON),
        "!=" => (Binary::Unequal, COMPARISON),
        "+" => (Binary::Add, SUM),
        "-" => (Binary::Subtract, SUM),
        "*" => (Binary::Multiply, PRODUCT),
        "/" => (Binary::Divide, PRODUCT),
        "^" => (Binary::Power, POWER),
        _ => return None,
    })
}

impl Parser<'_> {
    fn peek(&self) -> &Token {
        &self.tokens[self.at]
    }

    /// Returns the next token and advances; the end token stays.
    fn next(&mut self) -> Token {
        let token = self.peek().clone();
        self.at += usize::from(token.kind != Kind::End);
        token
    }

    fn accept(&mut self, symbol: &'static str) -> bool {
        let there = self.peek().kind == Kind::Symbol(symbol);
        self.at += usize::from(there);
        there
    }

    fn push(&mut self, kind: NodeKind, span: Range<usize>) -> Id {
        self.nodes.push(Node { kind, span });
        self.nodes.len() - 1
    }

    fn span(&self, id: Id) -> Range<usize> {
        self.nodes[id].span.clone()
    }

    /// Parses an expression of operators with at least this binding power.
    fn expression(&mut self, least: u8) -> Result<Id, Fault> {
        self.depth += 1;
        if self.depth > DEEPEST {
            let message = format!("more than {DEEPEST} levels of nesting");
            return Err(Fault::new(self.peek().span.clone(), message)
                .help("give parts of it names of their own"));
        }
        let mut left = self.prefix()?;
        while let Some((operator, power)) = infix(self.peek().kind).filter(|o| o.1 >= least) {
            self.next();
            // A power is right-associative: a^b^c is a^(b^c).
            let right = self.expression(if power == POWER { POWER } else { power + 1 })?;
            let span = self.span(left).start..self.span(right).end;
            left = self.push(NodeKind::Binary(operator, left, right), span);
            if power == COMPARISON && infix(self.peek().kind).is_some_and(|o| o.1 == COMPARISON) {
                return Err(Fault::new(self.peek().span.clone(), "comparisons cannot be chained")
                    .help("write `a < b and b < c`"));
            }
        }
        self.depth -= 1;
        Ok(left)
    }

    /// Parses a value with its prefix operators.
    fn prefix(&mut self) -> Result<Id, Fault> {
        let (operator, power) = match self.peek().kind {
            Kind::Symbol("-") => (Some(Unary::Negate), SIGN),
            Kind::Symbol("+") => (None, SIGN),
            Kind::Symbol("not") => (Some(Unary::Not), COMPARISON),
            _ => return self.postfix(),
        };
        let start = self.next().span.start;
        let operand = self.expression(power)?;
        let span = start..self.span(operand).end;
        let Some(operator) = operator else {
            self.nodes[operand].span = span;
            return Ok(operand);
        };
        Ok(self.push(NodeKind::Unary(operator, operand), span))
    }

    /// Parses a value with its postfix index or slice.
    fn postfix(&mut self) -> Result<Id, Fault> {
        let mut base = self.atom()?;
        while self.peek().kind == Kind::Symbol("[") {
            let open = self.next().span;
            let first = self.bound(":")?;
            let slice = self.accept(":");
            let last = if slice { self.bound("]")? } else { None };
            let end = self.close("]", "[", &open)?;
            let span = self.span(base).start..end;
            let kind = match (slice, first) {
                (true, first) => NodeKind::Slice(base, first, last),
                (false, Some(index)) => NodeKind::Index(base, index),
                (false, None) => {
                    let fault = Fault::new(open.start..end, "the index is missing");
                    return Err(fault.expected("an index such as `[1]` or `[2:5]`"));
                }
            };
            base = self.push(kind, span);
        }
        Ok(base)
    }

    /// Parses one end of a slice; `None` if it is omitted.
    fn bound(&mut self, after: &'static str) -> Result<Option<Id>, Fault> {
        let kind = self.peek().kind;
        let left_out = kind == Kind::Symbol(after) || kind == Kind::Symbol("]");
        if left_out { Ok(None) } else { self.expression(OR).map(Some) }
    }

    fn atom(&mut self) -> Result<Id, Fault> {
        let token = self.next();
        let span = token.span.clone();
        match token.kind {
            Kind::Number(x) => Ok(self.number(x, span)),
            Kind::Name if self.peek().kind == Kind::Symbol("(") => self.call(span),
            Kind::Name => {
                let name = self.text[span.clone()].to_owned();
                Ok(self.push(NodeKind::Name(name), span))
            }
            Kind::Symbol("(") => {
                let inside = self.expression(OR)?;
                let end = self.close(")", "(", &span)?;
                self.nodes[inside].span = span.start..end;
                Ok(inside)
            }
            Kind::Symbol("[") => {
                let elements = self.list("]", "[", &span)?;
                let end = self.tokens[self.at - 1].span.end;
                if elements.is_empty() {
                    return Err(Fault::new(span.start..end, "an empty list has no values"));
                }
                Ok(self.push(NodeKind::List(elements), span.start..end))
            }
            Kind::Unit => Err(Fault::new(span, "there is no number before this unit")
                .help("a number with its unit is written `9.81 {m/s2}`")),
            Kind::Symbol(_) | Kind::End => Err(Fault::new(span, "a value is missing")
                .expected("a number, a name or `(`")
                .found(token.describe(self.text))),
        }
    }

    fn number(&mut self, x: f64, span: Range<usize>) -> Id {
        if self.peek().kind != Kind::Unit {
            return self.push(NodeKind::Number(x, None), span);
        }
        let braces = self.next().span;
        let unit = braces.start + 1..braces.end - 1;
        self.push(NodeKind::Number(x, Some(unit)), span.start..braces.end)
    }

    fn call(&mut self, name: Range<usize>) -> Result<Id, Fault> {
        let word = &self.text[name.clone()];
        let function = if self.tables.contains(&word) {
            None
        } else {
            Some(function::find(word, &name, self.tables)?)
        };
        let open = self.next().span;
        let arguments = self.list(")", "(", &open)?;
        let span = name.start..self.tokens[self.at - 1].span.end;
        let kind = match (function, &arguments[..]) {
            (Some(function), _) if function.takes(arguments.len()) => {
                NodeKind::Call(function, arguments)
            }
            (None, [argument]) => NodeKind::Table(word.to_owned(), *argument),
            (function, _) => {
                let usage = function.map_or_else(|| function::table_usage(word), Function::usage);
                return Err(wrong_count(word, &usage, arguments.len(), span));
            }
        };
        Ok(self.push(kind, span))
    }

    /// Parses values separated by commas, up to the closing bracket.
    fn list(
        &mut self,
        closing: &'static str,
        opening: &'static str,
        open: &Range<usize>,
    ) -> Result<Vec<Id>, Fault> {
        let mut elements = Vec::new();
        if self.accept(closing) {
            return Ok(elements);
        }
        loop {
            elements.push(self.expression(OR)?);
            if !self.accept(",") {
                self.close(closing, opening, open)?;
                return Ok(elements);
            }
        }
    }

    /// Consumes the closing bracket and returns its end.
    fn close(
        &mut self,
        closing: &'static str,
        opening: &'static str,
        open: &Range<usize>,
    ) -> Result<usize, Fault> {
        let token = self.peek().clone();
        if self.accept(closing) {
            return Ok(token.span.end);
        }
        if token.kind == Kind::End {
            return Err(Fault::new(open.clone(), format!("this `{opening}` is not closed"))
                .expected(format!("`{closing}`"))
                .found("the end"));
        }
        let fault = self.misplaced();
        Err(Fault { expected: Some(format!("`{closing}` or an operator").into()), ..fault })
    }

    /// The fault for a token that follows a complete value.
    fn misplaced(&self) -> Fault {
        let token = self.peek();
        let found = token.describe(self.text);
        let fault = Fault::new(token.span.clone(), format!("{found} does not belong here"))
            .expected("an operator")
            .found(found);
        match token.kind {
            Kind::Symbol("=") => fault.help("equality is written `==`"),
            Kind::Symbol("**") => fault.help("a power is written `^`"),
            Kind::Symbol(")" | "]" | "}") => Fault {
                message: format!("nothing is open before {}", token.describe(self.text)),
                ..fault
            },
            Kind::Name | Kind::Number(_) | Kind::Symbol("(") => {
                fault.help("a product is written with `*`")
            }
            Kind::Unit => fault.help("only a number has a unit of its own"),
            _ => fault,
        }
    }
}

fn wrong_count(name: &str, usage: &str, count: usize, span: Range<usize>) -> Fault {
    let found = match count {
        0 => "no argument".to_owned(),
        1 => "1 argument".to_owned(),
        n => format!("{n} arguments"),
    };
    Fault::new(span, format!("wrong number of arguments for `{name}`"))
        .expected(format!("`{usage}`"))
        .found(found)
}
