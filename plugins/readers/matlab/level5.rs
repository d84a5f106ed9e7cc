//! MAT-files of level 5.
//!
//! Source: *MAT-File Format*, The `MathWorks` (R2023b), chapter 1: a header of 128 bytes, then data elements, each a tag
//! of type and size, and data padded to eight bytes.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use flate2::read::ZlibDecoder;
use lacuna::plugin::reader::ReadError;

use crate::readers::records::store::{Array, Store};
use crate::readers::sierra::container::read_limit;

const HEADER: usize = 128;
/// Deepest nesting of structures and cells.
const DEEPEST: usize = 16;

const INT8: u32 = 1;
const UINT8: u32 = 2;
const INT16: u32 = 3;
const UINT16: u32 = 4;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const SINGLE: u32 = 7;
const DOUBLE: u32 = 9;
const INT64: u32 = 12;
const UINT64: u32 = 13;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

const CELL: u32 = 1;
const STRUCTURE: u32 = 2;
/// Classes of numbers, from double to unsigned integers of 64 bits.
const NUMERIC: std::ops::RangeInclusive<u32> = 6..=15;
const COMPLEX: u32 = 0x0800;

/// Returns true if these bytes are a header of level 5: a text, the version 1.0 and the mark of the byte order.
pub(super) fn recognised(head: &[u8]) -> bool {
    head.len() >= HEADER && matches!(&head[124..128], b"\x00\x01IM" | b"\x01\x00MI")
}

/// A file whose variables are in memory.
pub(super) struct File {
    path: PathBuf,
    names: Vec<String>,
    /// A matrix, or the reason why it is none, for each name.
    found: Vec<Result<Array, String>>,
}

impl File {
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let complain = |text: String| ReadError::new(path, text);
        let bytes = std::fs::read(path).map_err(|e| complain(format!("cannot be read: {e}")))?;
        if !recognised(&bytes) {
            return Err(complain("is not a MAT-file of level 5 or version 7.3".to_owned())
                .help("MATLAB writes one with `save FILE -v7`"));
        }
        let order = Order { big: bytes[126] == b'M' };
        let mut file = Self { path: path.to_owned(), names: Vec::new(), found: Vec::new() };
        let mut rest = &bytes[HEADER..];
        let limit = read_limit(bytes.len() as u64);
        let mut left = limit;
        while !rest.is_empty() {
            let at = bytes.len() - rest.len();
            let broken = |text: String| {
                complain(format!("is truncated or damaged: {text}")).at(format!("byte {at}"))
            };
            let (kind, data) = order.element(&mut rest).map_err(broken)?;
            let mut inflated = Vec::new();
            let (kind, data) = if kind == COMPRESSED {
                let read = ZlibDecoder::new(data).take(left).read_to_end(&mut inflated);
                read.map_err(|e| broken(e.to_string()))?;
                left -= inflated.len() as u64;
                order.element(&mut &inflated[..]).map_err(broken)?
            } else {
                (kind, data)
            };
            if kind == MATRIX {
                file.matrix(order, data, None, 0).map_err(broken)?;
            }
        }
        Ok(file)
    }

    /// Adds a matrix, and those in its fields or cells; `name` in place of its own.
    fn matrix(
        &mut self,
        order: Order,
        mut data: &[u8],
        name: Option<String>,
        depth: usize,
    ) -> Result<(), String> {
        let rest = &mut data;
        let (_, flags) = order.element(rest)?;
        let flags = order.word(flags.get(..4).ok_or("a matrix has no flags")?);
        let class = flags & 0xff;
        // An empty element of a cell or a field may consist of nothing else.
        if rest.is_empty() {
            return Ok(());
        }
        let (kind, dimensions) = order.element(rest)?;
        let shape = order.numbers(kind, dimensions)?;
        if shape.len() < 2 || shape.iter().any(|n| !(0.0..=1e15).contains(n)) {
            return Err(format!("a matrix has the dimensions {shape:?}"));
        }
        let shape: Vec<usize> = shape.iter().map(|&n| n as usize).collect();
        let (_, own) = order.element(rest)?;
        let name = name.unwrap_or_else(|| String::from_utf8_lossy(own).into_owned());
        let count = shape.iter().try_fold(1_usize, |all, n| all.checked_mul(*n));
        let count = count.filter(|n| *n <= 1 << 40).ok_or("a matrix is too large")?;
        match class {
            CELL if depth < DEEPEST => {
                // An element takes eight bytes at least.
                for i in 0..count.min(rest.len() / 8 + 1) {
                    self.inner(order, rest, format!("{name}({})", i + 1), depth)?;
                }
            }
            STRUCTURE if depth < DEEPEST => {
                let (kind, length) = order.element(rest)?;
                let length = order.numbers(kind, length)?.first().map_or(0, |n| *n as usize);
                let (_, names) = order.element(rest)?;
                if length == 0 || names.is_empty() {
                    return Ok(());
                }
                let fields: Vec<String> = names.chunks(length).map(unpadded).collect();
                for i in 0..count.min(rest.len() / 8 + 1) {
                    let of = if count == 1 { name.clone() } else { format!("{name}({})", i + 1) };
                    for field in &fields {
                        self.inner(order, rest, format!("{of}.{field}"), depth)?;
                    }
                }
            }
            class if NUMERIC.contains(&class) => {
                let (kind, real) = order.element(rest)?;
                let numbers = order.numbers(kind, real)?;
                if numbers.len() != count {
                    return Err(format!(
                        "`{name}` has {} numbers for the shape {shape:?}",
                        numbers.len()
                    ));
                }
                let array = if flags & COMPLEX == 0 {
                    Ok(Array::from_columns(shape, &numbers, None))
                } else {
                    Err("holds complex numbers".to_owned())
                };
                self.add(name, array);
            }
            _ => self.add(name, Err("does not hold numbers".to_owned())),
        }
        Ok(())
    }

    fn inner(
        &mut self,
        order: Order,
        rest: &mut &[u8],
        name: String,
        depth: usize,
    ) -> Result<(), String> {
        match order.element(rest)? {
            (MATRIX, data) if !data.is_empty() => self.matrix(order, data, Some(name), depth + 1),
            _ => Ok(()),
        }
    }

    fn add(&mut self, name: String, array: Result<Array, String>) {
        self.names.push(name);
        self.found.push(array);
    }
}

/// Text up to its first NUL.
fn unpadded(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// Order of the bytes of a number.
#[derive(Debug, Clone, Copy)]
struct Order {
    big: bool,
}

impl Order {
    /// Takes an element: its type and data.
    fn element<'b>(self, rest: &mut &'b [u8]) -> Result<(u32, &'b [u8]), String> {
        let bytes = *rest;
        let tag = bytes.get(..8).ok_or("an element has no complete tag")?;
        let first = self.word(&tag[..4]);
        // A small element has its size in the upper half of the first word, and its data in the second word.
        if first >> 16 != 0 {
            let size = (first >> 16) as usize;
            *rest = &bytes[8..];
            let data =
                tag[4..].get(..size).ok_or_else(|| format!("a small element has {size} bytes"))?;
            return Ok((first & 0xffff, data));
        }
        let size = self.word(&tag[4..]) as usize;
        let data = bytes[8..].get(..size).ok_or_else(|| {
            format!("an element of {size} bytes ends after {} of them", bytes.len() - 8)
        })?;
        // Only compressed elements are not padded.
        let padded = if first == COMPRESSED { size } else { size.next_multiple_of(8) };
        *rest = bytes.get(8 + padded..).unwrap_or_default();
        Ok((first, data))
    }

    fn word(self, bytes: &[u8]) -> u32 {
        self.read(bytes, u32::from_le_bytes)
    }

    fn read<const N: usize, T>(self, bytes: &[u8], number: impl Fn([u8; N]) -> T) -> T {
        let mut own = [0; N];
        own.copy_from_slice(bytes);
        if self.big {
            own.reverse();
        }
        number(own)
    }

    /// The numbers in the data of an element, exact up to 2^53.
    fn numbers(self, kind: u32, data: &[u8]) -> Result<Vec<f64>, String> {
        fn each<const N: usize>(
            order: Order,
            data: &[u8],
            number: impl Fn([u8; N]) -> f64,
        ) -> Vec<f64> {
            data.chunks_exact(N).map(|bytes| order.read(bytes, &number)).collect()
        }
        Ok(match kind {
            INT8 => each(self, data, |b| f64::from(i8::from_le_bytes(b))),
            UINT8 => each(self, data, |b| f64::from(u8::from_le_bytes(b))),
            INT16 => each(self, data, |b| f64::from(i16::from_le_bytes(b))),
            UINT16 => each(self, data, |b| f64::from(u16::from_le_bytes(b))),
            INT32 => each(self, data, |b| f64::from(i32::from_le_bytes(b))),
            UINT32 => each(self, data, |b| f64::from(u32::from_le_bytes(b))),
            SINGLE => each(self, data, |b| f64::from(f32::from_le_bytes(b))),
            DOUBLE => each(self, data, f64::from_le_bytes),
            INT64 => each(self, data, |b| i64::from_le_bytes(b) as f64),
            UINT64 => each(self, data, |b| u64::from_le_bytes(b) as f64),
            _ => return Err(format!("numbers of the unknown type {kind}")),
        })
    }
}

impl Store for File {
    fn path(&self) -> &Path {
        &self.path
    }

    fn format(&self) -> String {
        "MAT-file, level 5".to_owned()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn array(&self, name: &str) -> Result<Array, ReadError> {
        let complain =
            |text: &str| ReadError::new(&self.path, text).at(format!("dataset `{name}`"));
        let found = self.names.iter().position(|known| known == name).map(|i| &self.found[i]);
        match found {
            Some(Ok(array)) => Ok(array.clone()),
            Some(Err(text)) => Err(complain(text)),
            None => Err(complain("is not in the file")),
        }
    }
}
