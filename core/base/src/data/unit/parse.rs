//! The grammar of units: `product = ["1"] power { (" " | "*" | "·" | "." | "/") power }`.

use std::ops::Range;

use super::{Meaning, UnitError, symbols};

/// Longest text of a unit, in bytes.
const LONGEST: usize = 2000;
/// Deepest nesting of parentheses.
const DEEPEST: usize = 100;

/// Meaning of a complete text.
pub(super) fn parse(text: &str) -> Result<Meaning, UnitError> {
    let mut parser = Parser { text, at: 0, factors: 0, depth: 0, affine: None };
    if text.trim().is_empty() {
        return Ok(Meaning::ONE);
    }
    if text.len() > LONGEST {
        let message = format!("a text of {} bytes is too long for a unit", text.len());
        return Err(parser.wrong(0..0, message));
    }
    let meaning = parser.product()?;
    if parser.peek() == Some(')') {
        return Err(parser.wrong(parser.at..parser.at + 1, "there is no `(` for this `)`"));
    }
    match parser.affine.clone() {
        Some((offset, _)) if parser.factors == 1 => Ok(Meaning { offset, ..meaning }),
        Some((_, range)) => {
            let symbol = &text[range.clone()];
            let message = format!("`{symbol}`, with its own zero, cannot be in a product or power");
            let mut error = parser.wrong(range, message);
            error.nearest = Some("K".to_owned());
            Err(error)
        }
        None => Ok(meaning),
    }
}

struct Parser<'t> {
    text: &'t str,
    at: usize,
    /// Number of symbols and powers read so far.
    factors: usize,
    /// Number of open parentheses.
    depth: usize,
    /// Offset of a unit that has one (`degC`), and its byte range.
    affine: Option<(f64, Range<usize>)>,
}

impl Parser<'_> {
    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn bump(&mut self) {
        self.at += self.peek().map_or(0, char::len_utf8);
    }

    /// Advances past the characters that `accept` accepts and returns their byte range.
    fn take_while(&mut self, accept: impl Fn(char) -> bool) -> Range<usize> {
        let start = self.at;
        while self.peek().is_some_and(&accept) {
            self.bump();
        }
        start..self.at
    }

    fn skip_spaces(&mut self) -> bool {
        !self.take_while(char::is_whitespace).is_empty()
    }

    fn wrong(&self, range: Range<usize>, message: impl Into<String>) -> UnitError {
        UnitError { text: self.text.to_owned(), range, message: message.into(), nearest: None }
    }

    /// Reads factors up to the end or a closing parenthesis.
    fn product(&mut self) -> Result<Meaning, UnitError> {
        self.skip_spaces();
        let mut product = self.power()?;
        let mut divided = false;
        loop {
            let spaces = self.skip_spaces();
            let operator = self.at;
            let divide = match self.peek() {
                None | Some(')') => return Ok(product),
                Some('/') => true,
                Some('*' | '·' | '.' | '⋅' | '×') => false,
                Some(_) if spaces => false,
                Some(c) => {
                    let range = operator..operator + c.len_utf8();
                    return Err(self.wrong(range, format!("`{c}` does not belong here")));
                }
            };
            if matches!(self.peek(), Some('/' | '*' | '·' | '.' | '⋅' | '×')) {
                self.bump();
                self.skip_spaces();
            }
            let start = self.at;
            let factor = self.power()?;
            if divided && !divide {
                let message = "after `/`, put all that is divided by in parentheses";
                return Err(self.wrong(start..self.at, message));
            }
            divided |= divide;
            let factor = if divide { self.raise(factor, -6, operator)? } else { factor };
            product = product
                .times(factor)
                .ok_or_else(|| self.wrong(0..self.at, "the powers of this unit are too large"))?;
        }
    }

    /// Reads a symbol or parenthesis with its exponent.
    fn power(&mut self) -> Result<Meaning, UnitError> {
        let start = self.at;
        let base = self.base()?;
        match self.exponent()? {
            None => Ok(base),
            Some(sixths) => {
                self.factors += 1;
                self.raise(base, sixths, start)
            }
        }
    }

    fn raise(&self, base: Meaning, sixths: i16, start: usize) -> Result<Meaning, UnitError> {
        let message = "this power is too large or no whole, half or third power";
        base.power(sixths).ok_or_else(|| self.wrong(start..self.at, message))
    }

    fn base(&mut self) -> Result<Meaning, UnitError> {
        let start = self.at;
        self.factors += 1;
        match self.peek() {
            Some('(') => {
                self.bump();
                self.depth += 1;
                if self.depth > DEEPEST {
                    return Err(self.wrong(start..start + 1, "there are too many `(`"));
                }
                let inside = self.product()?;
                self.depth -= 1;
                if self.peek() != Some(')') {
                    return Err(self.wrong(start..start + 1, "this `(` is not closed"));
                }
                self.bump();
                Ok(inside)
            }
            Some('1') => {
                self.bump();
                let more = self.take_while(|c| c.is_ascii_alphanumeric());
                if more.is_empty() {
                    return Ok(Meaning::ONE);
                }
                Err(self.wrong(start..more.end, "the only number in a unit is `1`"))
            }
            _ => self.symbol(),
        }
    }

    fn symbol(&mut self) -> Result<Meaning, UnitError> {
        let is_symbol = |c: char| c.is_alphabetic() || matches!(c, '%' | '°' | '℃' | 'µ' | '_');
        let range = self.take_while(is_symbol);
        if range.is_empty() {
            let end = self.at + self.peek().map_or(0, char::len_utf8);
            let message = match self.peek() {
                None => "a unit is missing at the end".to_owned(),
                Some(c) if c.is_ascii_digit() => "the only number in a unit is `1`".to_owned(),
                Some(c) => format!("a unit is missing before `{c}`"),
            };
            return Err(self.wrong(range.start..end, message));
        }
        let symbol = &self.text[range.clone()];
        let Some(meaning) = symbols::find(symbol) else {
            let mut error = self.wrong(range, format!("`{symbol}` is not a unit known here"));
            error.nearest = symbols::nearest(symbol);
            return Err(error);
        };
        if meaning.offset != 0.0 {
            self.affine = Some((meaning.offset, range));
        }
        Ok(meaning)
    }

    /// Reads an exponent, in sixths, if one follows: `2`, `-2`, `^2`, `^-2`, `^0.5`, `^(1/2)`, `²`, `⁻²`.
    fn exponent(&mut self) -> Result<Option<i16>, UnitError> {
        let start = self.at;
        let raised: String = self.text[start..].chars().map_while(superscript).collect();
        if !raised.is_empty() {
            self.take_while(|c| superscript(c).is_some());
            return self.sixths(&raised, start).map(Some);
        }
        let caret = self.peek() == Some('^');
        if caret {
            self.bump();
        }
        let open = caret && self.peek() == Some('(');
        if open {
            self.bump();
            let range = self.take_while(|c| c != ')');
            if self.peek().is_none() {
                return Err(self.wrong(range.start - 1..range.start, "this `(` is not closed"));
            }
            self.bump();
            let written = self.text[range].to_owned();
            return self.sixths(&written, start).map(Some);
        }
        let signed = self.text[self.at..].strip_prefix(['-', '+']).unwrap_or(&self.text[self.at..]);
        if !caret && !signed.starts_with(|c: char| c.is_ascii_digit()) {
            return Ok(None);
        }
        if matches!(self.peek(), Some('-' | '+')) {
            self.bump();
        }
        // Without a caret a point is a multiplication sign: `s2.A`.
        self.take_while(|c| c.is_ascii_digit() || (caret && c == '.'));
        let written = self.text[start..self.at].trim_start_matches('^').to_owned();
        self.sixths(&written, start).map(Some)
    }

    fn sixths(&self, written: &str, start: usize) -> Result<i16, UnitError> {
        let (above, below) = written.split_once('/').unwrap_or((written, "1"));
        let number = |text: &str| text.trim().parse::<f64>().ok();
        let exponent = number(above).zip(number(below)).map(|(above, below)| 6.0 * above / below);
        match exponent {
            Some(sixths) if sixths.fract() == 0.0 && sixths != 0.0 && sixths.abs() <= 120.0 => {
                Ok(sixths as i16)
            }
            _ => {
                let message = "an exponent is a whole number, a half or a third, such as `^-2`";
                Err(self.wrong(start..self.at, message))
            }
        }
    }
}

/// The ordinary character that corresponds to a superscript.
fn superscript(c: char) -> Option<char> {
    Some(match c {
        '⁻' => '-',
        '⁰' => '0',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        '⁴' => '4',
        '⁵' => '5',
        '⁶' => '6',
        '⁷' => '7',
        '⁸' => '8',
        '⁹' => '9',
        _ => return None,
    })
}
