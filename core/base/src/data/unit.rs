//! Units as people write them: `kg/m3`, `m/s^2`, `microstrain`, `1/s`.
//!
//! Names, symbols and prefixes follow the SI brochure (BIPM, 9th edition, 2019, tables 1 to 8). Powers of ten are
//! stored separately from other factors, so that `g/cm3` is exactly 1000 `kg/m3`.

use std::borrow::Cow;
use std::fmt::{self, Display};
use std::ops::Range;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer};
use serde::{Deserialize, Serialize, Serializer};

mod parse;
mod symbols;

/// Number of base quantities: length, mass, time, current, temperature, amount, intensity.
const BASES: usize = 7;

/// A unit of measurement: the text as written and its meaning.
#[derive(Clone, Debug)]
pub struct Unit {
    text: String,
    meaning: Meaning,
}

/// A unit as a multiple of the coherent SI unit of its dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Meaning {
    /// Conversion factor without its powers of ten.
    factor: f64,
    /// Power of ten of the conversion factor.
    decimals: i32,
    /// Offset added after multiplication, in the SI unit; nonzero for `degC` only.
    offset: f64,
    /// Exponents of the base quantities, in sixths, so that square and cube roots are exact.
    sixths: [i16; BASES],
}

impl Meaning {
    const ONE: Self = Self { factor: 1.0, decimals: 0, offset: 0.0, sixths: [0; BASES] };
    /// Largest exponent of a base quantity, in sixths.
    const LARGEST: i16 = 6 * 500;
    /// Largest power of ten.
    const MOST_DECIMALS: i32 = 300;

    /// The unit, unless it is too large to be computed with.
    fn bounded(self) -> Option<Self> {
        let is_sound =
            self.sixths.iter().all(|sixths| sixths.unsigned_abs() <= Self::LARGEST.unsigned_abs())
                && self.decimals.unsigned_abs() <= Self::MOST_DECIMALS.unsigned_abs()
                && self.factor.is_normal();
        is_sound.then_some(self)
    }

    /// Product; `None` if it is too large.
    fn times(self, other: Self) -> Option<Self> {
        let mut sixths = self.sixths;
        for (sum, term) in sixths.iter_mut().zip(other.sixths) {
            *sum = sum.checked_add(term)?;
        }
        let decimals = self.decimals.checked_add(other.decimals)?;
        Self { factor: self.factor * other.factor, decimals, offset: 0.0, sixths }.bounded()
    }

    /// The unit raised to the power `sixths / 6`; `None` if an exponent of the result is not a multiple of 1/6, or too
    /// large.
    fn power(self, sixths: i16) -> Option<Self> {
        let scale = |exponent: i32| {
            let product = exponent.checked_mul(i32::from(sixths))?;
            (product % 6 == 0).then_some(product / 6)
        };
        let mut exponents = [0; BASES];
        for (result, exponent) in exponents.iter_mut().zip(self.sixths) {
            *result = i16::try_from(scale(i32::from(exponent))?).ok()?;
        }
        let power = f64::from(sixths) / 6.0;
        let (decimals, rest) = match scale(self.decimals) {
            Some(decimals) => (decimals, 1.0),
            None => (0, 10f64.powf(f64::from(self.decimals) * power)),
        };
        let factor = if sixths % 6 == 0 {
            self.factor.powi(i32::from(sixths / 6))
        } else {
            self.factor.powf(power)
        };
        Self { factor: factor * rest, decimals, offset: 0.0, sixths: exponents }.bounded()
    }
}

/// Error: the text is not a unit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.sentence())]
pub struct UnitError {
    /// The whole text.
    pub text: String,
    /// Byte range of the text that is wrong.
    pub range: Range<usize>,
    /// Description of the fault.
    pub message: String,
    /// The known symbol closest to the wrong one, if any.
    pub nearest: Option<String>,
}

impl UnitError {
    /// The error in the form in which decoding errors state what was expected and what was found.
    fn sentence(&self) -> String {
        let help = match &self.nearest {
            Some(near) => format!("{}; did you mean `{near}`?", self.message),
            None => self.message.clone(),
        };
        format!("expected a unit such as `m/s2`, found {:?}; help: {help}", self.text)
    }
}

impl Unit {
    /// Parses a unit.
    ///
    /// Products are written with a space, `*`, `·` or `.`; quotients with `/`; powers as `s2`, `s^2`, `s²`, `s^-2`,
    /// `Hz^0.5` or `Hz^(1/2)`. More than one factor after `/` needs parentheses: `J/(kg K)`. The empty text and `1` are
    /// the dimensionless unit.
    ///
    /// # Errors
    /// If the text is not a unit: the byte range at fault, and the closest known symbol.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        Ok(Self { text: text.trim().to_owned(), meaning: parse::parse(text)? })
    }

    /// The dimensionless unit.
    pub fn dimensionless() -> Self {
        Self { text: "1".to_owned(), meaning: Meaning::ONE }
    }

    /// The unit as written.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Returns true if both units measure the same quantity.
    pub fn same_dimension(&self, other: &Self) -> bool {
        self.meaning.sixths == other.meaning.sixths
    }

    /// Returns true if the unit has no dimension, such as `%`, `rad` or `microstrain`.
    pub fn is_dimensionless(&self) -> bool {
        self.meaning.sixths == [0; BASES]
    }

    /// Unit of a difference of two quantities in this unit: `K` for `degC`, otherwise the unit itself.
    pub fn difference(&self) -> Self {
        if self.meaning.offset == 0.0 {
            return self.clone();
        }
        Self { text: "K".to_owned(), meaning: Meaning { offset: 0.0, ..self.meaning } }
    }

    /// Product of two units; `None` if one of them has an offset (`degC`), or if its powers are too large.
    pub fn times(&self, other: &Self) -> Option<Self> {
        if [self, other].iter().any(|unit| unit.meaning.offset != 0.0) {
            return None;
        }
        let text = match [self, other].map(|unit| unit.text.as_str()) {
            ["" | "1", text] | [text, "" | "1"] => text.to_owned(),
            both => both.map(in_parentheses).join(" "),
        };
        Some(Self { text, meaning: self.meaning.times(other.meaning)? })
    }

    /// Power of the unit; `None` if an exponent of the result is not a multiple of 1/6, or if the unit has an offset
    /// (`degC`).
    pub fn power(&self, exponent: f64) -> Option<Self> {
        let sixths = 6.0 * exponent;
        let fits = sixths.fract() == 0.0 && sixths.abs() <= 120.0 && self.meaning.offset == 0.0;
        let meaning = self.meaning.power(fits.then_some(sixths as i16)?)?;
        let text = if exponent == 1.0 || matches!(self.text.as_str(), "" | "1") {
            self.text.clone()
        } else {
            format!("{}^{}", in_parentheses(&self.text), exponent_text(sixths as i16))
        };
        Some(Self { text, meaning })
    }

    /// The shortest form of a coherent unit, such as `m/s2` for `(m/s) (s^-1)` or `1/(V2 s2)`; other units are returned
    /// unchanged. Units with a current in them may have volts or ohms.
    #[must_use]
    pub fn plain(self) -> Self {
        let size = |factors: &[(&str, i16)]| factors.iter().map(|(_, n)| n.abs()).sum::<i16>();
        let best = self.decompositions().into_iter().min_by_key(|factors| size(factors));
        let text = best.map(|factors| product_text(&factors)).unwrap_or_default();
        Self::parse(&text).ok().filter(|plain| *plain == self).unwrap_or(self)
    }

    /// The unit as products of powers, in sixths: of base units, then of a volt or an ohm beside them.
    fn decompositions(&self) -> Vec<Vec<(&'static str, i16)>> {
        const SYMBOLS: [&str; BASES] = ["m", "kg", "s", "A", "K", "mol", "cd"];
        const CURRENT: usize = 3;
        let bases = |sixths: [i16; BASES]| -> Vec<(&'static str, i16)> {
            // Mass comes first, as in kg/m3.
            let order = [1, 0, 2, 3, 4, 5, 6].map(|k: usize| (SYMBOLS[k], sixths[k]));
            order.into_iter().filter(|(_, n)| *n != 0).collect()
        };
        let mut all = vec![bases(self.meaning.sixths)];
        if self.meaning.sixths[CURRENT] == 0 {
            return all;
        }
        for symbol in ["V", "ohm"] {
            let Ok(unit) = Self::parse(symbol) else { continue };
            for sixths in (-24..=24).filter(|sixths| *sixths != 0) {
                let rest =
                    unit.meaning.power(-sixths).and_then(|inverse| inverse.times(self.meaning));
                if let Some(rest) = rest {
                    let factors = [(symbol, sixths)].into_iter().chain(bases(rest.sixths));
                    all.push(factors.collect());
                }
            }
        }
        all
    }

    /// Factor that converts a number in this unit to the other unit.
    ///
    /// `None` if the dimensions differ, or if the zero points do (`degC` and `K`).
    pub fn factor_to(&self, other: &Self) -> Option<f64> {
        let (from, to) = (&self.meaning, &other.meaning);
        if !self.same_dimension(other) || from.offset != to.offset {
            return None;
        }
        // Powers of ten up to 10^22 are exact in f64, so a negative power is applied as a division: 10^-3 itself is
        // rounded.
        let factor = from.factor / to.factor;
        Some(match from.decimals - to.decimals {
            up @ 0.. => factor * 10f64.powi(up),
            down => factor / 10f64.powi(-down),
        })
    }

    /// Converts a number from this unit to the other, including the offset of `degC`; `None` if the dimensions differ.
    pub fn convert(&self, x: f64, other: &Self) -> Option<f64> {
        if let Some(factor) = self.factor_to(other) {
            return Some(x * factor);
        }
        let si = |unit: &Self| unit.meaning.factor * 10f64.powi(unit.meaning.decimals);
        self.same_dimension(other)
            .then(|| (x * si(self) + self.meaning.offset - other.meaning.offset) / si(other))
    }
}

/// Text of a product of powers, given in sixths: `kg/m3`, `1/(V2 s2)`.
fn product_text(factors: &[(&str, i16)]) -> String {
    let power = |(symbol, sixths): (&str, i16)| match (sixths / 6, sixths % 6) {
        (1, 0) => symbol.to_owned(),
        (whole, 0) => format!("{symbol}{whole}"),
        _ => format!("{symbol}^{}", exponent_text(sixths)),
    };
    let side = |sign: i16| -> Vec<String> {
        let all = factors.iter().map(|(symbol, n)| (*symbol, sign * n));
        all.filter(|(_, n)| *n > 0).map(power).collect()
    };
    let (above, below) = (side(1), side(-1));
    let above = if above.is_empty() { "1".to_owned() } else { above.join(" ") };
    match &below[..] {
        [] => above,
        [one] => format!("{above}/{one}"),
        several => format!("{above}/({})", several.join(" ")),
    }
}

/// Text of an exponent given in sixths, in lowest terms: `2`, `(1/2)`, `(-2/3)`.
fn exponent_text(sixths: i16) -> String {
    let common = [6, 3, 2, 1].into_iter().find(|divisor| sixths % divisor == 0).unwrap_or(1);
    match (sixths / common, 6 / common) {
        (whole, 1) => whole.to_string(),
        (above, below) => format!("({above}/{below})"),
    }
}

/// Text of a unit as a factor of a product or the base of a power: in parentheses unless it is a single symbol.
fn in_parentheses(text: &str) -> String {
    if text.chars().all(|c| c.is_alphabetic() || c == '%') {
        text.to_owned()
    } else {
        format!("({text})")
    }
}

impl PartialEq for Unit {
    /// Units are equal if they mean the same, however they are written.
    fn eq(&self, other: &Self) -> bool {
        self.factor_to(other) == Some(1.0)
    }
}

impl Default for Unit {
    fn default() -> Self {
        Self::dimensionless()
    }
}

impl Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.text)
    }
}

impl FromStr for Unit {
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        Self::parse(text)
    }
}

impl Serialize for Unit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for Unit {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::parse(&String::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

impl JsonSchema for Unit {
    fn schema_name() -> Cow<'static, str> {
        "Unit".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "examples": ["kg/m3", "m/s2", "microstrain", "1"] })
    }
}

#[cfg(test)]
mod tests;
