//! Parsing of TOML text to [`Node`]s, with all syntax errors of the text at once.

use toml::Spanned;
use toml::de::{DeInteger, DeTable, DeValue, Error};

use super::node::{Key, Node, Value};
use super::problem::Problems;
use super::source::{Place, SourceId, Sources};

/// The tree of a complete text; `None` if there are syntax errors, all of which have been reported.
pub fn read(source: SourceId, sources: &Sources, problems: &mut Problems) -> Option<Node> {
    let before = problems.len();
    let (table, errors) = DeTable::parse_recoverable(&sources.get(source).text);
    report(&errors, source, 0, problems);
    let mut reader = Reader { source, offset: 0, problems };
    let value = Value::Table(reader.entries(table.into_inner()));
    (problems.len() == before).then(|| Node { value, place: Place::whole(source) })
}

/// The tree of one value, which begins at byte `offset` of `source`.
///
/// # Errors
/// The syntax errors.
pub fn read_value(
    text: &str,
    source: SourceId,
    offset: usize,
    problems: &mut Problems,
) -> Result<Node, Vec<Error>> {
    let (value, errors) = DeValue::parse_recoverable(text);
    if !errors.is_empty() {
        return Err(errors);
    }
    Ok(Reader { source, offset, problems }.node(value))
}

/// Reports syntax errors as problems.
pub fn report(errors: &[Error], source: SourceId, offset: usize, problems: &mut Problems) {
    for error in errors {
        let place = error.span().map_or_else(
            || Place::whole(source),
            |span| Place { source, span: span.start + offset..span.end + offset },
        );
        let nothing_there = place.span.is_empty();
        let (message, expected) = match error.message().split_once(", expected ") {
            Some((message, expected)) => (message, Some(expected)),
            None => (error.message(), None),
        };
        // The parser mentions strings because an unquoted word is the most frequent mistake.
        match message {
            "string values must be quoted" if nothing_there => {
                problems.report(Some(place), "a value is missing")
            }
            "string values must be quoted" => {
                problems.report(Some(place), "this is not a value").help("a string needs quotes")
            }
            _ => {
                let problem = problems.report(Some(place), message);
                problem.expected = expected.map(str::to_owned);
                problem
            }
        };
    }
}

struct Reader<'p> {
    source: SourceId,
    offset: usize,
    problems: &'p mut Problems,
}

impl Reader<'_> {
    fn place<T>(&self, spanned: &Spanned<T>) -> Place {
        let span = spanned.span();
        Place { source: self.source, span: span.start + self.offset..span.end + self.offset }
    }

    fn entries(&mut self, table: DeTable<'_>) -> Vec<(Key, Node)> {
        table
            .into_iter()
            .map(|(key, value)| {
                let place = self.place(&key);
                let key = Key { name: key.into_inner().into_owned(), place };
                (key, self.node(value))
            })
            .collect()
    }

    fn node(&mut self, spanned: Spanned<DeValue<'_>>) -> Node {
        let place = self.place(&spanned);
        let value = match spanned.into_inner() {
            DeValue::String(text) => Value::String(text.into_owned()),
            DeValue::Integer(digits) => Value::Integer(self.integer(&digits, &place)),
            DeValue::Float(digits) => Value::Float(self.float(digits.as_str(), &place)),
            DeValue::Boolean(b) => Value::Boolean(b),
            DeValue::Datetime(date) => Value::Datetime(date.to_string()),
            DeValue::Array(elements) => {
                Value::Array(elements.into_iter().map(|element| self.node(element)).collect())
            }
            DeValue::Table(table) => Value::Table(self.entries(table)),
        };
        Node { value, place }
    }

    fn integer(&mut self, digits: &DeInteger<'_>, place: &Place) -> i64 {
        i64::from_str_radix(digits.as_str(), digits.radix()).unwrap_or_else(|_| {
            self.problems
                .report(Some(place.clone()), "the whole number is too large")
                .expected(format!("at most {}", i64::MAX))
                .found(digits);
            0
        })
    }

    fn float(&mut self, digits: &str, place: &Place) -> f64 {
        match digits.parse::<f64>() {
            Ok(x) if x.is_infinite() == digits.contains("inf") => x,
            _ => {
                self.problems
                    .report(Some(place.clone()), "the number is too large")
                    .expected(format!("at most {:e}", f64::MAX))
                    .found(digits);
                0.0
            }
        }
    }
}
