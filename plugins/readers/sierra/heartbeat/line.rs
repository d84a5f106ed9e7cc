//! One line of heartbeat text.

/// Separator between two fields of a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Separator {
    /// A visible text, such as a comma, or a tab.
    Text(String),
    /// Line of blanks only.
    Blank,
}

/// A parsed line. An empty list means that nothing of the kind was found.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Line {
    /// Labels, each with its numbers: `time=1.0e-05, stress=1.0, 2.0, 3.0`.
    Labelled(Vec<(String, Vec<f64>)>),
    /// Numbers without labels.
    Numbers(Vec<f64>),
    /// Names without numbers: a legend.
    Names(Vec<String>),
    /// A message of one line, or a comment.
    Message,
    /// A line of no known form.
    Broken,
}

/// Infers the separator from the text before the last field of a line, where there can be no time stamp. `None` for a
/// line with a single field.
pub(super) fn sniff(line: &str) -> Option<Separator> {
    // Names have signs such as `p/rho` and `%`.
    let inside = |c: char| c.is_alphanumeric() || "_.+-()[]=%/#*^@$'".contains(c);
    let without_last = line.trim_end().trim_end_matches(inside);
    let gap_start = without_last.trim_end_matches(|c| !inside(c)).len();
    let gap = &without_last[gap_start..];
    if gap_start == 0 {
        return None;
    }
    if gap.contains('\t') {
        return Some(Separator::Text("\t".to_owned()));
    }
    let seen = gap.trim();
    Some(if seen.is_empty() { Separator::Blank } else { Separator::Text(seen.to_owned()) })
}

/// Parses a line. `columns` is the number of fields, if it is known already.
pub(super) fn parse(line: &str, separator: Option<&Separator>, columns: Option<usize>) -> Line {
    let line = line.trim();
    if line.starts_with('%') {
        return Line::Message;
    }
    let fields: Vec<&str> = match separator {
        None => vec![line],
        Some(Separator::Blank) => line.split_whitespace().collect(),
        Some(Separator::Text(text)) => line.split(text.as_str()).map(str::trim).collect(),
    };
    let fields = match fields.split_last() {
        Some((&"", rest)) if !rest.is_empty() => rest,
        _ => &fields[..],
    };
    let stamped = line.starts_with('+');
    let parsed = if fields.iter().any(|field| label(field).is_some()) {
        labelled(fields, stamped)
    } else if separator == Some(&Separator::Blank) {
        plain(if stamped { blank_stamp_removed(fields, columns) } else { fields.to_vec() })
    } else if stamped {
        plain(stamp_removed(fields))
    } else {
        plain(fields.to_vec())
    };
    if parsed == Line::Broken && line.starts_with('-') { Line::Message } else { parsed }
}

/// Returns true for a legend above a row in the library's print: names right-aligned in fields as wide as those of the
/// numbers, which have exponents.
pub(super) fn legend_above(line: &str, row: &str) -> bool {
    let Some(Separator::Text(separator)) = sniff(line) else { return false };
    let names: Vec<&str> = line.split(separator.as_str()).collect();
    let numbers: Vec<&str> = row.split(separator.as_str()).collect();
    let printed = |text: &str| number(text).is_some() && text.contains('e');
    let aligned = |(name, number): (&&str, &&str)| {
        is_name(name.trim()) && name.trim_end() == *name && name.len() >= number.len()
    };
    line.starts_with(char::is_whitespace)
        && names.len() == numbers.len()
        && names[0].len() == numbers[0].len()
        && printed(numbers[0])
        && names.iter().zip(&numbers).all(aligned)
}

/// Parses a number as printed by C, C++ or Fortran, including infinities and not-a-number.
pub(super) fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let bare = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
    if bare == "nan" || (bare.starts_with("nan(") && bare.ends_with(')')) {
        return Some(f64::NAN);
    }
    if !bare.starts_with(|c: char| c.is_ascii_digit() || c == '.') && !bare.starts_with("inf") {
        return None;
    }
    text.parse().ok().or_else(|| text.replace(['d', 'D'], "e").parse().ok())
}

/// Splits `name=number`. The name is the text after the last blank, because a time stamp may precede it.
fn label(field: &str) -> Option<(&str, f64)> {
    let (name, value) = field.rsplit_once('=')?;
    let name = name.split_whitespace().next_back()?;
    Some((name, number(value)?))
}

fn labelled(fields: &[&str], stamped: bool) -> Line {
    let mut labels: Vec<(String, Vec<f64>)> = Vec::new();
    for field in fields {
        if let Some((name, value)) = label(field) {
            labels.push((name.to_owned(), vec![value]));
        } else if let (Some((_, values)), Some(value)) = (labels.last_mut(), number(field)) {
            values.push(value);
        } else if !(stamped && labels.is_empty()) {
            return Line::Broken;
        }
    }
    Line::Labelled(labels)
}

/// Removes a time stamp, which may itself contain blanks and the separator: it extends to the last blank of the last
/// field that has one.
fn stamp_removed<'a>(fields: &[&'a str]) -> Vec<&'a str> {
    let first = fields.iter().rposition(|field| field.contains(char::is_whitespace));
    let Some(first) = first else { return fields.to_vec() };
    let mut kept = fields[first..].to_vec();
    kept[0] = kept[0].split_whitespace().next_back().unwrap_or_default();
    kept
}

/// Removes a time stamp if blanks also separate the fields: the known number of columns is kept or, as long as it is
/// unknown, all similar fields at the end.
fn blank_stamp_removed<'a>(fields: &[&'a str], columns: Option<usize>) -> Vec<&'a str> {
    let numeric = fields.last().is_some_and(|field| number(field).is_some());
    let like_last = |field: &&&str| if numeric { number(field).is_some() } else { is_name(field) };
    let alike = fields.iter().rev().take_while(like_last).count();
    let kept = columns.map_or(alike, |n| n.min(alike));
    fields[fields.len() - kept..].to_vec()
}

fn plain(fields: Vec<&str>) -> Line {
    let numbers: Vec<f64> = fields.iter().filter_map(|field| number(field)).collect();
    if fields.is_empty() || fields.iter().any(|field| field.is_empty()) {
        Line::Broken
    } else if numbers.len() == fields.len() {
        Line::Numbers(numbers)
    } else if fields[0].eq_ignore_ascii_case("time")
        || (numbers.is_empty() && fields.iter().all(|field| is_name(field)))
    {
        // Below the time, names may be anything, such as the numbers of gauges.
        Line::Names(fields.into_iter().map(ToOwned::to_owned).collect())
    } else {
        Line::Broken
    }
}

fn is_name(field: &str) -> bool {
    field.starts_with(|c: char| c.is_alphabetic() || matches!(c, '_' | '(' | '['))
}
