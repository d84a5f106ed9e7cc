//! Types of numbers and of properties.

use super::bytes::{Bytes, Fault, lowest_first};

/// Code of the type of samples of `DAQmx`.
const DAQMX: u32 = 0xffff_ffff;

/// A type of samples that become numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    F32,
    F64,
    /// True is 1, false is 0.
    Boolean,
    /// A moment: seconds since 1904, and 2^-64 of seconds.
    Time,
}

/// The samples of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content {
    Numbers(Kind),
    /// Text, of which the file states the number of bytes.
    Text,
    /// Samples that are no numbers, and how they are called; the number of bytes of each, if it is known.
    Other(&'static str, Option<u64>),
}

impl Content {
    /// The content of a type by its code, `tdsDataType` in NI's document.
    pub fn of(code: u32) -> Option<Self> {
        use Kind::{Boolean, F32, F64, I8, I16, I32, I64, Time, U8, U16, U32, U64};
        Some(match code {
            0 => Self::Other("nothing", Some(0)),
            1 => Self::Numbers(I8),
            2 => Self::Numbers(I16),
            3 => Self::Numbers(I32),
            4 => Self::Numbers(I64),
            5 => Self::Numbers(U8),
            6 => Self::Numbers(U16),
            7 => Self::Numbers(U32),
            8 => Self::Numbers(U64),
            // The unit of those with a unit is a property, like that of the others.
            9 | 0x19 => Self::Numbers(F32),
            10 | 0x1a => Self::Numbers(F64),
            11 | 0x1b => Self::Other("numbers of extended precision", None),
            0x20 => Self::Text,
            0x21 => Self::Numbers(Boolean),
            0x44 => Self::Numbers(Time),
            0x4f => Self::Other("fixed-point numbers", None),
            0x08_000c => Self::Other("complex numbers", Some(8)),
            0x10_000d => Self::Other("complex numbers", Some(16)),
            DAQMX => Self::Other("raw data of DAQmx", None),
            _ => return None,
        })
    }

    /// Number of bytes of a sample, if all have the same.
    pub fn size(self) -> Option<u64> {
        match self {
            Self::Numbers(kind) => Some(kind.size() as u64),
            Self::Text => None,
            Self::Other(_, size) => size,
        }
    }
}

impl Kind {
    /// Number of bytes of a sample.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 | Self::Boolean => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Time => 16,
        }
    }

    /// The number in the bytes of a sample, exact up to 2^53; of a moment, the seconds since 1904.
    pub fn number(self, bytes: &[u8], big: bool) -> f64 {
        match self {
            Self::I8 => f64::from(i8::from_le_bytes(lowest_first(bytes, big))),
            Self::I16 => f64::from(i16::from_le_bytes(lowest_first(bytes, big))),
            Self::I32 => f64::from(i32::from_le_bytes(lowest_first(bytes, big))),
            Self::I64 => i64::from_le_bytes(lowest_first(bytes, big)) as f64,
            Self::U8 => f64::from(bytes[0]),
            Self::U16 => f64::from(u16::from_le_bytes(lowest_first(bytes, big))),
            Self::U32 => f64::from(u32::from_le_bytes(lowest_first(bytes, big))),
            Self::U64 => u64::from_le_bytes(lowest_first(bytes, big)) as f64,
            Self::F32 => f64::from(f32::from_le_bytes(lowest_first(bytes, big))),
            Self::F64 => f64::from_le_bytes(lowest_first(bytes, big)),
            Self::Boolean => f64::from(u8::from(bytes[0] != 0)),
            Self::Time => seconds(moment(bytes, big)),
        }
    }
}

/// A moment in 2^-64 s since 1904. With the lowest byte first the file has the fraction, then the seconds.
pub(super) fn moment(bytes: &[u8], big: bool) -> i128 {
    i128::from_le_bytes(lowest_first(bytes, big))
}

/// A time in seconds from one in 2^-64 s.
pub(super) fn seconds(time: i128) -> f64 {
    time as f64 / 2.0_f64.powi(64)
}

/// The value of a property.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Property {
    Number(f64),
    Text(String),
    /// A value that is not used here.
    Other,
}

impl Property {
    /// Reads a type and a value.
    pub fn read(bytes: &mut Bytes<'_>, name: &str) -> Result<Self, Fault> {
        let at = bytes.at();
        let code = bytes.u32()?;
        let content = Content::of(code);
        match content {
            Some(Content::Text) => return Ok(Self::Text(bytes.text()?)),
            Some(Content::Other(_, Some(size))) => {
                bytes.take(size as usize)?;
                return Ok(Self::Other);
            }
            Some(Content::Numbers(kind)) => return Self::number(bytes, kind),
            Some(Content::Other(_, None)) | None => (),
        }
        let text = format!("the property `{name}` has the type {code:#x}, whose size is not known");
        Err(Fault::new(at, text))
    }

    fn number(bytes: &mut Bytes<'_>, kind: Kind) -> Result<Self, Fault> {
        Ok(Self::Number(match kind.size() {
            1 => kind.number(&bytes.lowest_first::<1>()?, false),
            2 => kind.number(&bytes.lowest_first::<2>()?, false),
            4 => kind.number(&bytes.lowest_first::<4>()?, false),
            8 => kind.number(&bytes.lowest_first::<8>()?, false),
            _ => kind.number(&bytes.lowest_first::<16>()?, false),
        }))
    }
}
