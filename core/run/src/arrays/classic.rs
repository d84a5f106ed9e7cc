//! Large arrays as a classic netCDF file with 64-bit offsets, written number by number.
//!
//! The library of [`super`] holds several copies of all numbers while it writes, which gigabytes do not allow. The
//! bytes are the same (see the tests). Format: NetCDF Classic and 64-bit Offset File Formats, Unidata (2011).

use std::io::{self, Write};

use super::Array;

const DIMENSIONS: u32 = 0x0A;
const VARIABLES: u32 = 0x0B;
const ATTRIBUTES: u32 = 0x0C;
const CHAR: u32 = 2;
const DOUBLE: u32 = 6;

/// Returns true if the file can be written here: no dimension may be empty, which would be the unlimited one, and sizes
/// have to fit the format's fields.
pub(super) fn is_possible(arrays: &[Array<'_>]) -> bool {
    let fits = |size: usize| size > 0 && u32::try_from(size).is_ok();
    let whole = |array: &Array<'_>| {
        array.dimensions.iter().all(|(_, size)| fits(*size))
            && array.values.len()
                == array.dimensions.iter().map(|(_, size)| size).product::<usize>()
            && fits(8 * array.values.len())
    };
    let lengths = distinct(arrays);
    let same = |(name, size): &(String, usize)| {
        lengths.iter().any(|(known, length)| known == name && length == size)
    };
    arrays.iter().all(|array| whole(array) && array.dimensions.iter().all(same))
}

/// Writes arrays and text attributes.
pub(super) fn write(
    file: &mut impl Write,
    attributes: &[(&str, String)],
    arrays: &[Array<'_>],
) -> io::Result<()> {
    let length = header(attributes, arrays, 0).len() as u64;
    file.write_all(&header(attributes, arrays, length))?;
    for value in arrays.iter().flat_map(|array| array.values.iter()) {
        file.write_all(&value.to_be_bytes())?;
    }
    Ok(())
}

/// Names and lengths of the dimensions, each once, in the order in which they occur.
fn distinct<'a>(arrays: &'a [Array<'_>]) -> Vec<(&'a str, usize)> {
    let mut known: Vec<(&str, usize)> = Vec::new();
    for (name, length) in arrays.iter().flat_map(|array| &array.dimensions) {
        if !known.iter().any(|(other, _)| other == name) {
            known.push((name, *length));
        }
    }
    known
}

/// The header of a file whose first array begins at `begin`.
fn header(attributes: &[(&str, String)], arrays: &[Array<'_>], mut begin: u64) -> Vec<u8> {
    let dimensions = distinct(arrays);
    let mut bytes = b"CDF\x02\0\0\0\0".to_vec();
    list(&mut bytes, DIMENSIONS, dimensions.len());
    for (name, length) in &dimensions {
        text(&mut bytes, name);
        number(&mut bytes, *length);
    }
    list(&mut bytes, ATTRIBUTES, attributes.len());
    for (name, value) in attributes {
        attribute(&mut bytes, name, value);
    }
    list(&mut bytes, VARIABLES, arrays.len());
    for array in arrays {
        text(&mut bytes, &array.name);
        number(&mut bytes, array.dimensions.len());
        for (name, _) in &array.dimensions {
            number(&mut bytes, dimensions.iter().position(|(known, _)| known == name).unwrap_or(0));
        }
        list(&mut bytes, ATTRIBUTES, usize::from(array.unit.is_some()));
        if let Some(unit) = &array.unit {
            attribute(&mut bytes, "units", unit);
        }
        bytes.extend(DOUBLE.to_be_bytes());
        let size = 8 * array.values.len();
        number(&mut bytes, size);
        bytes.extend(begin.to_be_bytes());
        begin += size as u64;
    }
    bytes
}

/// Begins a list; an empty one is absent.
fn list(bytes: &mut Vec<u8>, tag: u32, count: usize) {
    bytes.extend(if count > 0 { tag } else { 0 }.to_be_bytes());
    number(bytes, count);
}

fn attribute(bytes: &mut Vec<u8>, name: &str, value: &str) {
    text(bytes, name);
    bytes.extend(CHAR.to_be_bytes());
    text(bytes, value);
}

/// Appends the length of a text and the text, filled up to a multiple of four bytes.
fn text(bytes: &mut Vec<u8>, text: &str) {
    number(bytes, text.len());
    bytes.extend(text.as_bytes());
    bytes.resize(bytes.len().next_multiple_of(4), 0);
}

/// Appends a number, which [`is_possible`] has found to fit.
fn number(bytes: &mut Vec<u8>, number: usize) {
    bytes.extend((number as u32).to_be_bytes());
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn array(name: &str, dimensions: &[(&str, usize)], unit: Option<&str>) -> Array<'static> {
        let dimensions: Vec<(String, usize)> =
            dimensions.iter().map(|(name, size)| ((*name).to_owned(), *size)).collect();
        let count = dimensions.iter().map(|d| d.1).product::<usize>();
        let values = (0..count).map(|i| (i as f64 * 0.7).sin()).collect::<Vec<f64>>().into();
        Array { name: name.to_owned(), dimensions, values, unit: unit.map(str::to_owned) }
    }

    /// Every reader of netCDF reads what the library writes.
    #[test]
    fn the_bytes_are_those_of_the_library() {
        let arrays = [
            array("points", &[("run", 5), ("parameter", 3)], None),
            array("responses", &[("run", 5), ("sensor", 2), ("time", 7)], Some("microstrain")),
            array("one", &[("parameter", 3)], Some("m")),
        ];
        for attributes in [vec![], vec![("title", "a run".to_owned()), ("x", "four".to_owned())]] {
            let mut own = Vec::new();
            write(&mut own, &attributes, &arrays).unwrap();
            assert!(is_possible(&arrays));
            assert_eq!(own, super::super::by_library(&attributes, &arrays).unwrap());
        }
    }

    #[test]
    fn what_the_format_cannot_hold_is_left_to_the_library() {
        assert!(!is_possible(&[array("none", &[("run", 0)], None)]));
        let other = [array("a", &[("run", 2)], None), array("b", &[("run", 3)], None)];
        assert!(!is_possible(&other));
    }
}
