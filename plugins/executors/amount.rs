//! Amounts of memory and time with units, as people write them: `2 GB`, `25 h`.

use std::fmt::{self, Display};

use lacuna::text::values::Unfit;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer};
use serde::{Deserialize, Serialize};

/// Amount of memory, such as `2 GB`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Memory {
    text: String,
    #[serde(skip)]
    bytes: u64,
}

const BYTES: [(&str, f64); 9] = [
    ("B", 1.0),
    ("kB", 1e3),
    ("MB", 1e6),
    ("GB", 1e9),
    ("TB", 1e12),
    ("KiB", 1024.0),
    ("MiB", 1_048_576.0),
    ("GiB", 1_073_741_824.0),
    ("TiB", 1_099_511_627_776.0),
];
const MEMORY: &str = "an amount such as `2 GB` or `512 MiB`";

impl Memory {
    /// Parses an amount, a number with a unit from B to TiB; fails on anything else.
    pub fn parse(text: &str) -> Result<Self, Unfit> {
        let unfit = || Unfit::new(MEMORY, format!("`{text}`"));
        let bytes = scaled(text, &BYTES).filter(|b| *b >= 1.0 && *b < 1e18).ok_or_else(unfit)?;
        Ok(Self { text: text.to_owned(), bytes: bytes.ceil() as u64 })
    }

    /// Returns the amount in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

/// A duration, such as `25 h` or `1-01:00:00`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Span {
    text: String,
    #[serde(skip)]
    seconds: f64,
}

const SECONDS: [(&str, f64); 6] = [
    ("s", 1.0),
    ("min", 60.0),
    ("h", 3600.0),
    ("d", 86_400.0),
    ("day", 86_400.0),
    ("days", 86_400.0),
];
const SPAN: &str = "a time such as `25 h`, `90 min` or `1-01:00:00`";

impl Span {
    /// Parses a duration: a number with `s`, `min`, `h` or `d`, or days, hours, minutes and seconds as `D-HH:MM:SS`.
    pub fn parse(text: &str) -> Result<Self, Unfit> {
        let unfit = || Unfit::new(SPAN, format!("`{text}`"));
        let seconds = scaled(text, &SECONDS).or_else(|| clock(text));
        let seconds = seconds.filter(|s| *s >= 1.0 && *s < 1e10).ok_or_else(unfit)?;
        Ok(Self { text: text.to_owned(), seconds })
    }

    /// Returns the duration in seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}

/// Formats a number of seconds as `D-HH:MM:SS`, rounded up.
pub fn as_clock(seconds: f64) -> String {
    let whole = seconds.ceil() as u64;
    let (days, hours) = (whole / 86_400, whole / 3600 % 24);
    format!("{days}-{hours:02}:{:02}:{:02}", whole / 60 % 60, whole % 60)
}

/// Parses a number with one of the given units.
fn scaled(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_alphabetic())?;
    let (number, unit) = text.split_at(split);
    let factor = units.iter().find(|(name, _)| *name == unit)?.1;
    number.trim().parse::<f64>().ok().map(|number| number * factor).filter(|x| x.is_finite())
}

/// Parses `D-HH:MM:SS` or `HH:MM:SS`; returns seconds.
fn clock(text: &str) -> Option<f64> {
    let (days, rest) = text.split_once('-').unwrap_or(("0", text));
    let parts: Vec<u32> = rest.split(':').map(str::parse).collect::<Result<_, _>>().ok()?;
    let [hours, minutes, seconds] = parts[..] else { return None };
    let days: u32 = days.parse().ok()?;
    (minutes < 60 && seconds < 60).then(|| {
        f64::from(days) * 86_400.0
            + f64::from(hours) * 3600.0
            + f64::from(minutes) * 60.0
            + f64::from(seconds)
    })
}

macro_rules! written {
    ($name:ident, $expected:expr, $schema:literal) => {
        impl Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&self.text)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let text = String::deserialize(deserializer)?;
                Self::parse(&text).map_err(de::Error::custom)
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                $schema.into()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string" })
            }
        }
    };
}

written!(Memory, MEMORY, "Memory");
written!(Span, SPAN, "Span");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_read_as_people_write_them() {
        for (text, bytes) in [("2 GB", 2_000_000_000), ("512 MiB", 536_870_912), ("1.5kB", 1500)] {
            assert_eq!(Memory::parse(text).unwrap().bytes(), bytes);
        }
        for (text, seconds) in [("25 h", 90_000.0), ("90 min", 5400.0), ("1-01:00:05", 90_005.0)] {
            assert_eq!(Span::parse(text).unwrap().seconds(), seconds);
        }
        assert_eq!(as_clock(90_004.2), "1-01:00:05");
        for text in ["2", "GB", "-1 GB", "2 gb", "1 parsec"] {
            assert!(Memory::parse(text).is_err(), "{text}");
        }
        for text in ["0 s", "1:2", "00:61:00", "one hour"] {
            assert!(Span::parse(text).is_err(), "{text}");
        }
    }
}
