//! Rainflow counting as in ASTM E1049-85, section 5.4.4.

/// A cycle, or a half cycle, of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Distance of its two reversals.
    pub range: f64,
    /// Middle of its two reversals.
    pub mean: f64,
    /// 1 for a closed cycle, 0.5 for a half cycle.
    pub count: f64,
}

impl Cycle {
    fn between(a: f64, b: f64, count: f64) -> Self {
        Self { range: (a - b).abs(), mean: 0.5 * (a + b), count }
    }
}

/// Cycles of a record in the order in which they close, then the half cycles that remain; `None` if a value is no finite
/// number. First and last value count as reversals.
pub fn cycles(values: &[f64]) -> Option<Vec<Cycle>> {
    if !values.iter().all(|y| y.is_finite()) {
        return None;
    }
    let mut found = Vec::new();
    let mut open: Vec<f64> = Vec::new();
    for reversal in reversals(values) {
        open.push(reversal);
        while let [.., a, b, c] = open[..] {
            let (last, previous) = ((c - b).abs(), (b - a).abs());
            if last < previous {
                break;
            }
            if open.len() == 3 {
                // The range holds the start of the record.
                found.push(Cycle::between(a, b, 0.5));
                open.remove(0);
            } else {
                found.push(Cycle::between(a, b, 1.0));
                open.truncate(open.len() - 3);
                open.push(c);
            }
        }
    }
    found.extend(open.windows(2).map(|pair| Cycle::between(pair[0], pair[1], 0.5)));
    Some(found)
}

/// Values at which a record changes direction, with its ends; equal neighbours count once.
fn reversals(values: &[f64]) -> Vec<f64> {
    let mut found: Vec<f64> = Vec::new();
    for &y in values {
        match found[..] {
            [.., last] if last == y => continue,
            [.., before, last] if (last - before) * (y - last) > 0.0 => {
                found.pop();
            }
            _ => {}
        }
        found.push(y);
    }
    found
}
