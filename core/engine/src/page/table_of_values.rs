//! The values of a figure as a table in CSV, and as the page carries it.

use std::io::Write as _;

use super::drawing::{Datum, Drawing, Place};
use super::scale::extent;

/// The values of a figure as CSV: one row per drawn value, in the displayed units, rounded to less than a thousandth of the
/// range that is drawn.
///
/// Texts that a spreadsheet would take for a formula begin with an apostrophe.
pub fn csv(drawings: &[Drawing]) -> String {
    let head = ["panel", "series", "x", "y", "lower", "upper", "x axis", "y axis"];
    let mut table = line(head.map(str::to_owned));
    for drawing in drawings {
        let [x_axis, y_axis] = drawing.labels.each_ref().map(|label| text(label));
        let (across, along) = (Digits::of(places(drawing)), Digits::of(heights(drawing)));
        for Datum { panel, series, x, y, interval } in &drawing.values {
            let x = match x {
                Place::At(x) => across.write(*x),
                Place::Name(name) => text(name),
            };
            let [lower, upper] = interval.map_or([f64::NAN; 2], |(low, high)| [low, high]);
            let [y, lower, upper] = [*y, lower, upper].map(|value| along.write(value));
            if [&y, &lower, &upper].iter().any(|cell| !cell.is_empty()) {
                let axes = [x_axis.clone(), y_axis.clone()];
                let [panel, series] = [panel, series].map(|name| text(name));
                table.push_str(&line([panel, series, x, y, lower, upper].into_iter().chain(axes)));
            }
        }
    }
    table
}

/// Numbers on the horizontal axis.
fn places(drawing: &Drawing) -> impl Iterator<Item = f64> + '_ {
    drawing.values.iter().filter_map(|datum| match datum.x {
        Place::At(x) => Some(x),
        Place::Name(_) => None,
    })
}

/// Numbers on the vertical axis.
fn heights(drawing: &Drawing) -> impl Iterator<Item = f64> + '_ {
    drawing.values.iter().flat_map(|datum| {
        let ends = datum.interval.into_iter().flat_map(|(low, high)| [low, high]);
        ends.chain([datum.y])
    })
}

/// Rounding of the numbers of one axis.
#[derive(Debug, Clone, Copy)]
struct Digits {
    /// Power of ten to which numbers are rounded.
    power: i32,
    /// True if all numbers are neither very large nor very small, and are written without a power of ten.
    plain: bool,
}

impl Digits {
    /// The coarsest power of ten below a thousandth of the range of these numbers.
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extent(values).unwrap_or((0.0, 0.0));
        let magnitude = low.abs().max(high.abs());
        let range = if high > low { high - low } else { magnitude };
        let power = if range > 0.0 { (1e-3 * range).log10().floor() as i32 } else { 0 };
        Self { power, plain: magnitude < 1e9 && (-9..=0).contains(&power) }
    }

    /// A number; empty if it is not finite.
    fn write(self, value: f64) -> String {
        if !value.is_finite() {
            return String::new();
        }
        if self.plain {
            let text = format!("{value:.*}", self.power.unsigned_abs() as usize);
            let short = if text.contains('.') {
                text.trim_end_matches('0').trim_end_matches('.')
            } else {
                &text
            };
            return if short == "-0" { "0".to_owned() } else { short.to_owned() };
        }
        let digits =
            if value == 0.0 { 0.0 } else { value.abs().log10().floor() - f64::from(self.power) };
        let rounded = format!("{value:.*e}", digits.clamp(0.0, 16.0) as usize);
        rounded.parse::<f64>().map_or(rounded, |value| format!("{value:e}"))
    }
}

fn line(cells: impl IntoIterator<Item = String>) -> String {
    let quoted = cells.into_iter().map(|cell| {
        if cell.contains(['"', ',', '\n', '\r']) {
            format!("\"{}\"", cell.replace('"', "\"\""))
        } else {
            cell
        }
    });
    let mut line = quoted.collect::<Vec<_>>().join(",");
    line.push('\n');
    line
}

/// A text that no spreadsheet takes for a formula.
fn text(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.trim_start().starts_with(['=', '+', '-', '@']) { format!("'{text}") } else { text }
}

/// A text as the page carries it: compressed (RFC 1951) and in base 64 (RFC 4648).
pub fn packed(text: &str) -> String {
    let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
    // Writing to memory cannot fail.
    let written = encoder.write_all(text.as_bytes()).and_then(|()| encoder.finish());
    base64(&written.unwrap_or_default())
}

/// Bytes in base 64 (RFC 4648, section 4).
pub fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= chunk.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vectors of RFC 4648, section 10.
    #[test]
    fn base_64_is_that_of_the_standard() {
        let vectors = ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"];
        for (n, expected) in vectors.into_iter().enumerate() {
            assert_eq!(base64(&b"foobar"[..n]), expected);
        }
    }

    #[test]
    fn what_is_packed_can_be_unpacked() {
        let text = "time,strain\n".repeat(1000);
        let packed = packed(&text);
        assert!(packed.len() < 400, "{}", packed.len());
        let output = std::process::Command::new("python3")
            .args(["-c", "import sys,zlib,base64; sys.stdout.write(zlib.decompress(base64.b64decode(sys.argv[1]), -15).decode())", &packed])
            .output();
        match output {
            Ok(output) => assert_eq!(String::from_utf8_lossy(&output.stdout), text),
            Err(error) => println!("not compared with zlib: no python3 ({error})"),
        }
    }

    #[test]
    fn numbers_have_the_digits_that_a_drawing_shows() {
        let written = |values: &[f64]| {
            let digits = Digits::of(values.iter().copied());
            values.iter().map(|value| digits.write(*value)).collect::<Vec<_>>()
        };
        assert_eq!(written(&[12_111.828, 12_151.0, f64::NAN]), ["12111.83", "12151", ""]);
        assert_eq!(written(&[0.1 + 0.2, 0.0, -1e-7]), ["0.3", "0", "0"]);
        assert_eq!(written(&[1.23456e-12, 0.0]), ["1.235e-12", "0e0"]);
        assert_eq!(written(&[1.23456e12, 1e12]), ["1.2346e12", "1e12"]);
        assert_eq!(written(&[7.0, 7.0]), ["7", "7"]);
    }

    #[test]
    fn a_name_is_no_formula_and_breaks_no_row() {
        let values = vec![
            Datum::named("=1+1", "a,b", "@x", -0.1 - 0.2),
            Datum::point("-\"q\"\n", "+", (f64::NAN, 0.25)),
            Datum::point("left out", "", (0.0, f64::NAN)),
        ];
        let drawing = Drawing::panel(String::new(), ["time [ms]", "=y"], values);
        let expected = "panel,series,x,y,lower,upper,x axis,y axis\n\
                        '=1+1,\"a,b\",'@x,-0.3,,,time [ms],'=y\n\
                        \"'-\"\"q\"\" \",'+,,0.25,,,time [ms],'=y\n";
        assert_eq!(csv(&[drawing]), expected);
    }
}
