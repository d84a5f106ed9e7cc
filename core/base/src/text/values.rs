//! Checked values: a decoded value is valid, and an error states what would be valid.

use std::borrow::Cow;
use std::fmt::{self, Display};
use std::time::Duration;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer};
use serde::{Deserialize, Serialize};

use super::emit::float;

mod name;

pub use name::Name;

/// Error: a value of the right type that is not allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}, found {found}")]
pub struct Unfit {
    /// Description of allowed values.
    pub expected: Cow<'static, str>,
    /// The value given.
    pub found: String,
}

impl Unfit {
    /// An error from a description of allowed values and the value given.
    pub fn new(expected: impl Into<Cow<'static, str>>, found: impl Display) -> Self {
        Self { expected: expected.into(), found: found.to_string() }
    }
}

/// Declares checked number types: type, description, condition, schema.
macro_rules! number {
    ($(#[$doc:meta])* $name:ident, $expected:literal, |$x:ident| $fits:expr, $schema:tt) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize)]
        #[serde(transparent)]
        pub struct $name(f64);

        impl $name {
            #[doc = concat!("Checks that a number is ", $expected, ".")]
            pub fn new($x: f64) -> Result<Self, Unfit> {
                if $fits { Ok(Self($x)) } else { Err(Unfit::new($expected, float($x))) }
            }

            /// The number.
            pub const fn get(self) -> f64 {
                self.0
            }
        }

        impl TryFrom<f64> for $name {
            type Error = Unfit;

            fn try_from(x: f64) -> Result<Self, Unfit> {
                Self::new(x)
            }
        }

        impl From<$name> for f64 {
            fn from(number: $name) -> f64 {
                number.0
            }
        }

        impl Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&float(self.0))
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Self::new(f64::deserialize(deserializer)?).map_err(de::Error::custom)
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!($schema)
            }
        }
    };
}

number! {
    /// A finite number above 0.
    Positive, "a number above 0", |x| x.is_finite() && x > 0.0,
    { "type": "number", "exclusiveMinimum": 0 }
}

/// A hundred years, in seconds.
const CENTURY: f64 = 3.2e9;

impl Positive {
    /// This number of seconds, at most a hundred years: a clock cannot add all that a number can state.
    pub fn seconds(self) -> Duration {
        Duration::from_secs_f64(self.0.min(CENTURY))
    }
}

number! {
    /// A finite number of 0 or more.
    NonNegative, "a number of 0 or more", |x| x.is_finite() && x >= 0.0,
    { "type": "number", "minimum": 0 }
}

number! {
    /// A finite number.
    Finite, "a finite number", |x| x.is_finite(),
    { "type": "number" }
}

number! {
    /// A number from 0 to 1.
    Fraction, "a fraction between 0 and 1", |x| (0.0..=1.0).contains(&x),
    { "type": "number", "minimum": 0, "maximum": 1 }
}

number! {
    /// A number above 0 and below 1.
    OpenFraction, "a fraction above 0 and below 1", |x| x > 0.0 && x < 1.0,
    { "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 }
}

number! {
    /// Number of runs that may be left out: a fraction if below 1, a count from 1 on.
    AllowFailed, "a fraction from 0 to 1 or a whole number of runs",
    |x| (0.0..1.0).contains(&x) || (x >= 1.0 && x.is_finite() && x.fract() == 0.0),
    { "type": "number", "minimum": 0 }
}

impl AllowFailed {
    /// Number of runs that may be left out of `runs`.
    pub fn of(self, runs: usize) -> usize {
        if self.0 < 1.0 { (self.0 * runs as f64) as usize } else { self.0 as usize }
    }

    /// True if no run may be left out.
    pub fn is_none(&self) -> bool {
        self.0 == 0.0
    }
}

impl Default for AllowFailed {
    /// No run may be left out.
    fn default() -> Self {
        Self(0.0)
    }
}

/// A whole number of 1 or more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct Count(usize);

impl Count {
    /// Checks that a number is 1 or more.
    pub fn new(n: usize) -> Result<Self, Unfit> {
        if n >= 1 { Ok(Self(n)) } else { Err(Unfit::new("a whole number of 1 or more", n)) }
    }

    /// The number.
    pub const fn get(self) -> usize {
        self.0
    }
}

impl From<Count> for usize {
    fn from(count: Count) -> usize {
        count.0
    }
}

impl TryFrom<usize> for Count {
    type Error = Unfit;

    fn try_from(n: usize) -> Result<Self, Unfit> {
        Self::new(n)
    }
}

impl Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let n = i64::deserialize(deserializer)?;
        let unfit = || de::Error::custom(Unfit::new("a whole number of 1 or more", n));
        usize::try_from(n).ok().and_then(|n| Self::new(n).ok()).ok_or_else(unfit)
    }
}

impl JsonSchema for Count {
    fn schema_name() -> Cow<'static, str> {
        "Count".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": 1 })
    }
}

/// Lower and upper bound, written `[low, high]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(into = "[f64; 2]")]
pub struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    /// Checks that both bounds are finite and the lower one is below the upper one.
    pub fn new(low: f64, high: f64) -> Result<Self, Unfit> {
        if low.is_finite() && high.is_finite() && low < high {
            return Ok(Self { low, high });
        }
        let found = format!("[{}, {}]", float(low), float(high));
        Err(Unfit::new("a lower bound and a higher upper bound", found))
    }

    /// Lower bound.
    pub const fn low(self) -> f64 {
        self.low
    }

    /// Upper bound.
    pub const fn high(self) -> f64 {
        self.high
    }

    /// Upper bound minus lower bound.
    pub fn width(self) -> f64 {
        self.high - self.low
    }

    /// Returns true if `x` lies between the bounds or on one of them.
    pub fn contains(self, x: f64) -> bool {
        (self.low..=self.high).contains(&x)
    }
}

impl From<Interval> for [f64; 2] {
    fn from(interval: Interval) -> Self {
        [interval.low, interval.high]
    }
}

impl Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}, {}]", float(self.low), float(self.high))
    }
}

impl<'de> Deserialize<'de> for Interval {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let [low, high] = <[f64; 2]>::deserialize(deserializer)?;
        Self::new(low, high).map_err(de::Error::custom)
    }
}

impl JsonSchema for Interval {
    fn schema_name() -> Cow<'static, str> {
        "Interval".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "array",
            "items": { "type": "number" },
            "minItems": 2,
            "maxItems": 2,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_say_what_would_be_right() {
        let said = |unfit: Unfit| unfit.to_string();
        assert_eq!(
            Fraction::new(1.5).map_err(said),
            Err("expected a fraction between 0 and 1, found 1.5".to_owned())
        );
        assert!(Fraction::new(1.0).is_ok() && Fraction::new(0.0).is_ok());
        assert!(OpenFraction::new(1.0).is_err() && OpenFraction::new(0.0).is_err());
        assert_eq!(Positive(0.25).seconds(), Duration::from_millis(250));
        assert_eq!(Positive(2e19).seconds(), Duration::from_secs_f64(CENTURY));
        assert!(Positive::new(0.0).is_err() && Positive::new(f64::INFINITY).is_err());
        assert!(NonNegative::new(0.0).is_ok() && NonNegative::new(f64::NAN).is_err());
        assert!(Count::new(0).is_err());
        assert!(Interval::new(1.0, 1.0).is_err());
    }
}
