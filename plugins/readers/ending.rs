//! Detection of tables that were cut off while they were written.
//!
//! A program that is killed may leave a file that ends anywhere. A line with too few fields shows it; a line cut
//! inside its last field does not, and reads as another number. Two signs reveal it: the line has no line end, and
//! the field is shorter than those above it, because most programs write a column with the same number of decimals,
//! or of significant digits, in every line.

/// Minimum number of fields above that show the form of a column.
const FEWEST: usize = 2;

/// Number of missing digits that cannot be a coincidence if the digits vary from line to line (because trailing zeros
/// are not written).
const MARGIN: usize = 2;

/// Describes why the last field of a line without a line end seems to be cut, given the fields above it in the same
/// column; `None` if it does not.
pub fn cut<'a>(last: &str, above: impl Iterator<Item = &'a str>) -> Option<String> {
    let above: Vec<&str> = above.collect();
    if above.len() < FEWEST || above.contains(&last) {
        return None;
    }
    if last.is_empty() {
        let blank = above.iter().any(|cell| cell.is_empty());
        return (!blank)
            .then(|| "its last field is blank, and no other of its column is".to_owned());
    }
    let Some(own) = Shape::of(last) else {
        let longer = above.iter().find(|cell| cell.starts_with(last))?;
        return Some(format!("its last field `{last}` is the beginning of `{longer}` above it"));
    };
    // Zero is often written shorter than other numbers.
    let mut shapes: Vec<Shape> = above.iter().filter_map(|cell| Shape::of(cell)).collect();
    shapes.retain(|shape| shape.size > 0.0);
    if shapes.len() < FEWEST {
        return None;
    }
    own.cut_from(last, &shapes)
}

/// Form in which a number is written.
struct Shape {
    decimals: usize,
    significant: usize,
    /// Number of digits of the exponent; 0 without an exponent.
    exponent: usize,
    size: f64,
}

impl Shape {
    /// Returns the form of a number; `None` for a text that is not a number.
    fn of(text: &str) -> Option<Self> {
        let size = text.parse::<f64>().ok().filter(|x| x.is_finite())?.abs();
        let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, ""));
        let digits = |text: &str| text.bytes().filter(u8::is_ascii_digit).count();
        let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| digits(decimals));
        let leading = |c: char| matches!(c, '+' | '-' | '.' | '0');
        let significant = digits(mantissa.trim_start_matches(leading));
        Some(Self { decimals, significant, exponent: digits(exponent), size })
    }

    fn cut_from(&self, text: &str, others: &[Self]) -> Option<String> {
        let exponents = least(others, |shape| shape.exponent);
        if exponents.low > self.exponent {
            let found = match self.exponent {
                0 => "has no exponent".to_owned(),
                n => format!("has an exponent of {}", counted(n, "digit")),
            };
            return Some(format!(
                "its last field `{text}` {found}, and each above it has one of at least {}",
                counted(exponents.low, "digit")
            ));
        }
        // The exponent may have been lost with all its digits.
        let largest = others.iter().map(|shape| shape.size).fold(0.0, f64::max);
        if exponents.high > self.exponent && self.size > 10.0 * largest {
            return Some(format!(
                "its last field `{text}` has a shorter exponent than others of its column, and is more than ten times \
                 as large as the largest of them, {largest:e}"
            ));
        }
        // Programs keep either the number of decimals or that of significant digits: the one that varies less.
        let decimals = least(others, |shape| shape.decimals);
        let significant = least(others, |shape| shape.significant);
        let spread = |range: &Range| range.high - range.low;
        let (own, range, what) = if decimals.high > 0 && spread(&decimals) <= spread(&significant) {
            (self.decimals, decimals, "decimal")
        } else {
            (self.significant, significant, "significant digit")
        };
        let margin = if range.low == range.high { 1 } else { MARGIN };
        (own + margin <= range.low).then(|| {
            let low = range.low;
            format!(
                "its last field `{text}` has {}, and each above it has at least {low}",
                counted(own, what)
            )
        })
    }
}

/// Range that contains nearly all values: the lowest hundredth is ignored.
struct Range {
    low: usize,
    high: usize,
}

fn least(shapes: &[Shape], number: impl Fn(&Shape) -> usize) -> Range {
    let mut numbers: Vec<usize> = shapes.iter().map(number).collect();
    numbers.sort_unstable();
    Range { low: numbers[numbers.len() / 100], high: numbers[numbers.len() - 1] }
}

fn counted(number: usize, what: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{number} {what}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::{Stream, normal};

    fn is_cut(last: &str, above: &[&str]) -> bool {
        cut(last, above.iter().copied()).is_some()
    }

    #[test]
    fn fields_of_fixed_form_show_every_cut() {
        let above = ["0.51230", "-1.20000", "10.00001"];
        for (last, expected) in [("0.5123", true), ("0.", true), ("0", true), ("2.33330", false)] {
            assert_eq!(is_cut(last, &above), expected, "{last}");
        }
        let above = ["5.1230e-04", "-1.2000e-04", "1.0001e+01"];
        for (last, expected) in
            [("7.1", true), ("7.1230", true), ("7.1230e-0", true), ("7.1230e-03", false)]
        {
            assert_eq!(is_cut(last, &above), expected, "{last}");
        }
        let above = ["done", "failed", "done"];
        for (last, expected) in [("don", true), ("", true), ("done", false), ("lost", false)] {
            assert_eq!(is_cut(last, &above), expected, "{last}");
        }
        // Whole numbers of equal and of varying length.
        assert!(is_cut("10", &["101", "102", "103"]));
        assert!(!is_cut("8", &["9", "10", "11"]));
        // Too few lines to judge.
        assert!(!is_cut("0.5", &["0.25"]));
    }

    /// Files of fifty lines with numbers written with as many digits as needed (Rust writes the shortest text that
    /// reads back as the same number), or rounded to five decimals without trailing zeros: complete files are refused
    /// in less than one case in a hundred; of all cuts, those that are not detected and change the number by more
    /// than a hundredth of the column's standard deviation are less than one in a hundred.
    #[test]
    fn whole_files_of_any_form_pass() {
        for rounded in [false, true] {
            let text = |x: f64| {
                if rounded { format!("{}", (x * 1e5).round() / 1e5) } else { format!("{x}") }
            };
            let (mut refused, mut cuts, mut harmful) = (0, 0, 0);
            for file in 0..1000 {
                let mut rng = Stream::root(11).at(file).generator();
                let cells: Vec<String> = (0..50).map(|_| text(10.0 * normal(&mut rng))).collect();
                let (last, above) = cells.split_last().expect("fifty cells");
                let seen = |text: &str| cut(text, above.iter().map(String::as_str)).is_some();
                refused += usize::from(seen(last));
                let number: f64 = last.parse().expect("a number");
                for end in 1..last.len() {
                    let Ok(read) = last[..end].parse::<f64>() else { continue };
                    cuts += 1;
                    harmful += usize::from((read - number).abs() > 0.1 && !seen(&last[..end]));
                }
            }
            assert!(refused < 10, "{refused}");
            assert!(100 * harmful < cuts, "{harmful} of {cuts}");
        }
    }
}
