//! Numbers as required by input decks: the shortest text that reads back the same, or C's `printf` formats.

use std::iter::Peekable;
use std::str::Chars;

/// Number format: a conversion of C's `printf` for one floating-point number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    /// Text in front of a number that is not negative.
    positive: &'static str,
    fill: Fill,
    width: usize,
    precision: usize,
    conversion: Conversion,
    capital: bool,
}

/// Padding up to the width.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fill {
    BlanksBefore,
    BlanksAfter,
    Zeros,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Conversion {
    Fixed,
    Exponent,
    General,
}

/// Largest accepted width and precision; larger values are taken to be mistakes.
const MOST: usize = 100;

impl Format {
    /// Parses a format: `%`, flags among `-+ 0`, a width, a point with a precision, and one of `e E f F g G`.
    pub fn parse(text: &str) -> Option<Self> {
        let mut rest = text.strip_prefix('%')?.chars().peekable();
        let mut flags = [false; 4];
        while let Some(flag) = rest.peek().and_then(|c| "-+ 0".find(*c)) {
            flags[flag] = true;
            rest.next();
        }
        let width = digits(&mut rest).unwrap_or(0);
        let precision =
            if rest.next_if_eq(&'.').is_some() { digits(&mut rest).unwrap_or(0) } else { 6 };
        let letter = rest.next()?;
        let conversion = match letter.to_ascii_lowercase() {
            'e' => Conversion::Exponent,
            'f' => Conversion::Fixed,
            'g' => Conversion::General,
            _ => return None,
        };
        let [left, plus, blank, zeros] = flags;
        let sound = rest.next().is_none() && width <= MOST && precision <= MOST;
        sound.then_some(Self {
            positive: match (plus, blank) {
                (true, _) => "+",
                (false, true) => " ",
                (false, false) => "",
            },
            fill: match (left, zeros) {
                (true, _) => Fill::BlanksAfter,
                (false, true) => Fill::Zeros,
                (false, false) => Fill::BlanksBefore,
            },
            width,
            precision,
            conversion,
            capital: letter.is_ascii_uppercase(),
        })
    }

    /// Formats a finite number.
    pub fn write(self, x: f64) -> String {
        let size = x.abs();
        let mut digits = match self.conversion {
            Conversion::Fixed => format!("{size:.*}", self.precision),
            Conversion::Exponent => exponential(size, self.precision),
            Conversion::General => general(size, self.precision.max(1)),
        };
        if self.capital {
            digits.make_ascii_uppercase();
        }
        let sign = if x.is_sign_negative() { "-" } else { self.positive };
        let count = self.width.saturating_sub(sign.len() + digits.len());
        match self.fill {
            Fill::BlanksAfter => format!("{sign}{digits}{}", " ".repeat(count)),
            Fill::Zeros => format!("{sign}{}{digits}", "0".repeat(count)),
            Fill::BlanksBefore => format!("{}{sign}{digits}", " ".repeat(count)),
        }
    }
}

fn digits(rest: &mut Peekable<Chars<'_>>) -> Option<usize> {
    let mut number = None;
    while let Some(digit) = rest.peek().and_then(|c| c.to_digit(10)) {
        number = Some(number.unwrap_or(0_usize).saturating_mul(10).saturating_add(digit as usize));
        rest.next();
    }
    number
}

/// Formats one digit, a point and `precision` digits, and an exponent of at least two digits.
fn exponential(size: f64, precision: usize) -> String {
    let text = format!("{size:.precision$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let (sign, exponent) = exponent.strip_prefix('-').map_or(('+', exponent), |rest| ('-', rest));
    format!("{mantissa}e{sign}{exponent:0>2}")
}

/// Formats as in C11, 7.21.6.1: in the style of `%e` if the exponent is below -4 or not below the precision, else in
/// that of `%f`; without trailing zeros.
fn general(size: f64, precision: usize) -> String {
    let rounded = format!("{size:.*e}", precision - 1);
    let exponent: i32 = rounded.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    let bare = |text: &str| {
        let text = if text.contains('.') { text.trim_end_matches('0') } else { text };
        text.trim_end_matches('.').to_owned()
    };
    if exponent < -4 || exponent >= precision as i32 {
        let text = exponential(size, precision - 1);
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "+00"));
        return format!("{}e{exponent}", bare(mantissa));
    }
    bare(&format!("{size:.*}", (precision as i32 - 1 - exponent) as usize))
}

/// Returns the shortest decimal that reads back as the same number.
pub fn shortest(x: f64) -> String {
    format!("{x:?}")
}
