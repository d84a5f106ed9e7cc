//! Formatting of numbers with as many digits as are known.

/// Largest number of decimals: a number of double precision near one has no more.
const DECIMALS: f64 = 15.0;

/// A number with this many significant digits; in scientific notation if it would be very long or very small.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return String::from("–");
    }
    if value == 0.0 {
        return String::from("0");
    }
    let digits = digits.max(1);
    let scientific = format!("{value:.*e}", digits - 1);
    // The exponent is taken after rounding: 9.99 with two digits is 1.0e1.
    let exponent = exponent_of(&scientific);
    if !(-4..6).contains(&exponent) {
        return scientific;
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    fixed(value, decimals)
}

/// A number with this many decimals, and never `-0`.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return String::from("–");
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| matches!(b, b'0' | b'.')) => rest.to_owned(),
        _ => text,
    }
}

/// A number without loss of digits; in scientific notation if that is clearly shorter.
pub fn exact(value: f64) -> String {
    let (plain, scientific) = (format!("{value}"), format!("{value:e}"));
    if plain.len() <= scientific.len() + 3 { plain } else { scientific }
}

/// A text in which every number is rounded to this many significant digits.
pub fn rounded(text: &str, digits: usize) -> String {
    let ends = |c: char| matches!(c, ' ' | ',' | '[' | ']' | '(' | ')');
    let word = |word: &str| match word.parse::<f64>() {
        Ok(value) if word.starts_with(|c: char| c.is_ascii_digit() || c == '-') => {
            let short = significant(value, digits);
            typeset(if short.len() < word.len() { &short } else { word })
        }
        _ => word.to_owned(),
    };
    text.split_inclusive(ends)
        .map(|part| match part.strip_suffix(ends) {
            Some(inner) => word(inner) + &part[inner.len()..],
            None => word(part),
        })
        .collect()
}

/// Number of decimals for a value with standard error `error`: the last printed digit is that of the leading digit of
/// the error. If the error is not known, `spread / 100` is used.
pub fn decimals(error: f64, spread: f64) -> usize {
    let unit = match (error.is_finite() && error > 0.0, spread.is_finite() && spread > 0.0) {
        (true, _) => error,
        (false, true) => spread / 100.0,
        (false, false) => return 3,
    };
    (-unit.log10().floor()).clamp(0.0, DECIMALS) as usize
}

/// A share as a percentage.
pub fn percent(share: f64) -> String {
    if share.is_finite() { format!("{} %", fixed(100.0 * share, 1)) } else { String::from("–") }
}

/// An integer with a thin space between thousands, from five digits on.
pub fn count(value: usize) -> String {
    let digits = value.to_string();
    if digits.len() < 5 {
        return digits;
    }
    let mut text = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{2009}');
        }
        text.push(c);
    }
    text
}

/// A duration in seconds, in a readable unit.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if !s.is_finite() => String::from("–"),
        s if s < 0.001 => String::from("< 1 ms"),
        s if s < 1.0 => format!("{} ms", significant(s * 1e3, 3)),
        s if s < 120.0 => format!("{} s", significant(s, 3)),
        s if s < 7200.0 => format!("{} min", significant(s / 60.0, 3)),
        s => format!("{} h", significant(s / 3600.0, 3)),
    }
}

/// A number in typographic form: with a minus sign instead of a hyphen, and powers of ten as superscripts.
pub fn typeset(text: &str) -> String {
    let (mantissa, exponent) = match text.split_once('e') {
        Some((m, e)) if e.parse::<i32>().is_ok() && m.parse::<f64>().is_ok() => (m, Some(e)),
        _ => (text, None),
    };
    let mantissa = match mantissa.strip_prefix('-') {
        Some(rest) if rest.starts_with(|c: char| c.is_ascii_digit()) => format!("−{rest}"),
        _ => mantissa.to_owned(),
    };
    match exponent {
        Some(exponent) => format!("{mantissa}×10{}", superscript(exponent)),
        None => mantissa,
    }
}

/// Digits and signs as superscripts.
pub fn superscript(text: &str) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    text.chars()
        .filter(|&c| c != '+')
        .map(|c| match c {
            '-' => '⁻',
            c => c.to_digit(10).map_or(c, |d| DIGITS[d as usize]),
        })
        .collect()
}

fn exponent_of(scientific: &str) -> i32 {
    scientific.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits_survive_rounding_to_the_next_power() {
        assert_eq!(significant(9.996, 3), "10.0");
        assert_eq!(significant(12111.84, 6), "12111.8");
        assert_eq!(significant(-0.000_123_4, 2), "-0.00012");
        assert_eq!(significant(1.24e-9, 2), "1.2e-9");
        assert_eq!(significant(6.5e300, 2), "6.5e300");
        assert_eq!(significant(f64::NAN, 2), "–");
    }

    #[test]
    fn the_error_says_how_many_decimals_are_known() {
        // 64.873 with a standard error of 0.05 is 64.87: the last digit is that of the error.
        assert_eq!(fixed(64.873, decimals(0.05, 2.4)), "64.87");
        assert_eq!(fixed(12_111.8, decimals(3.0, 15.0)), "12112");
        assert_eq!(decimals(f64::NAN, 0.0), 3);
        assert_eq!(decimals(0.0, 1.0), 2);
        // A clock of 1 GHz that is known to 0.05 Hz, in units of 1 GHz.
        assert_eq!(fixed(1.000_000_000_31, decimals(5e-11, 5e-11)), "1.00000000031");
    }

    #[test]
    fn numbers_are_set_as_printers_do() {
        assert_eq!(typeset("-1.2e-9"), "−1.2×10⁻⁹");
        assert_eq!(typeset("sensor-e"), "sensor-e");
        assert_eq!(count(1_234_567), "1\u{2009}234\u{2009}567");
        assert_eq!(fixed(-0.0001, 2), "0.00");
        assert_eq!(rounded("uniform on [-20.703463, 1.5e6]", 4), "uniform on [−20.70, 1.5×10⁶]");
        assert_eq!(
            (exact(1456.0), exact(1.5e5), exact(2.5e-9)),
            ("1456".into(), "150000".into(), "2.5e-9".into())
        );
    }
}
