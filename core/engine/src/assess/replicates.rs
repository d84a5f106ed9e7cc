//! Replicates that are not independent measurements.

use super::words::{count, names, percent, short};
use super::{Finding, Rule, Severity};

const DUPLICATE: &str = "duplicate_replicates";
const SYMMETRIC: &str = "symmetric_replicates";
const LEFT_OUT: &str = "left_out_curves";
const ADDED: &str = "added_curves";

/// Smallest number of common values for which curves are compared: short curves coincide by rounding.
const FEWEST: usize = 5;
/// Distance of a curve from the mean of others, as a fraction of the distance between those, below which it counts as
/// computed from them.
const ROUNDING: f64 = 0.01;
/// Largest number of curves of a group that are compared with each other.
pub const MOST: usize = 60;
/// Fractions of omitted curves that give a reservation and a failure.
const SHARE: (f64, f64) = (0.1, 0.5);

const ONCE: &str = "supply each measured curve once; a `sigma` is not a replicate";
const CURVES: &str =
    "supply the measured curves themselves, without their mean and without ends of intervals";
const LOOK: &str = "check the curves in the report and the sensor; raise `screen.threshold` if the curves are valid";
const ALONE: &str = "remove `added_curves` from `[measurements]`";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: DUPLICATE,
            looks_at: format!(
                "curves of a group with the same values ({FEWEST} or more, not all equal)"
            ),
            threshold: "any: reservation; half of the curves: failure".to_owned(),
            why: "copies count as independent measurements: the intervals shrink with the square root of their number",
            action: ONCE,
        },
        Rule {
            code: SYMMETRIC,
            looks_at: format!(
                "a curve that equals the mean of two others or of all others, to {} of the distance between them",
                percent(ROUNDING)
            ),
            threshold: "any: failure".to_owned(),
            why: "a mean and its interval are not three measurements: the noise estimate is wrong and the mean \
                  counts three times",
            action: CURVES,
        },
        Rule {
            code: LEFT_OUT,
            looks_at: "the fraction of measured curves that the screen removes".to_owned(),
            threshold: format!(
                "any: note; {}: reservation; {}: failure",
                percent(SHARE.0),
                percent(SHARE.1)
            ),
            why: "few curves of a data set should be faulty; if many are flagged, the removed ones may be the valid \
                  ones",
            action: LOOK,
        },
        Rule {
            code: ADDED,
            looks_at: "summary curves of the replicates that `added_curves` counts as data"
                .to_owned(),
            threshold: "any: reservation".to_owned(),
            why: "the same information is counted twice",
            action: ALONE,
        },
    ]
}

/// Curves of one group: name of the replicate and its values. Those behind the first [`MOST`] are not read.
pub type Curves<'a> = Vec<(&'a str, Vec<Option<f64>>)>;

fn common(a: &[Option<f64>], b: &[Option<f64>]) -> Vec<(f64, f64)> {
    a.iter().zip(b).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect()
}

fn vary(pairs: &[(f64, f64)]) -> bool {
    pairs.iter().any(|pair| pair.0 != pairs[0].0)
}

/// Finding about replicates of a group, `all` of them, whose values equal those of an earlier one.
pub fn duplicates(group: &str, curves: &Curves<'_>, all: usize) -> Option<Finding> {
    let same = |a: &[Option<f64>], b: &[Option<f64>]| {
        let pairs = common(a, b);
        pairs.len() >= FEWEST && vary(&pairs) && pairs.iter().all(|(x, y)| x == y)
    };
    let copies: Vec<&str> = (1..curves.len().min(MOST))
        .filter(|&i| (0..i).any(|j| same(&curves[i].1, &curves[j].1)))
        .map(|i| curves[i].0)
        .collect();
    if copies.is_empty() {
        return None;
    }
    let half = 2 * copies.len() >= all;
    let severity = if half { Severity::Failure } else { Severity::Reservation };
    let message = format!(
        "{} of {} repeat the values of another: {}; they count as independent measurements",
        copies.len(),
        count(all, "replicate"),
        names(&copies)
    );
    Some(Finding::new((DUPLICATE, group), (copies.len() as f64, 0.0), severity, message, ONCE))
}

/// Finding about a replicate of a group that is the mean of two others, or of all others.
pub fn symmetric(group: &str, curves: &Curves<'_>) -> Option<Finding> {
    let curves = &curves[..curves.len().min(MOST)];
    let made = |i: usize| {
        of_two(curves, i)
            .map(|(j, k)| format!("`{}` and `{}`", curves[j].0, curves[k].0))
            .or_else(|| of_all(curves, i).then(|| "all others".to_owned()))
    };
    let (i, others) = (0..curves.len()).find_map(|i| Some((i, made(i)?)))?;
    let message = format!(
        "replicate `{}` is the mean of {others}: these are not independent measurements",
        curves[i].0
    );
    Some(Finding::new((SYMMETRIC, group), (1.0, 0.0), Severity::Failure, message, CURVES))
}

fn of_two(curves: &[(&str, Vec<Option<f64>>)], i: usize) -> Option<(usize, usize)> {
    let others = (0..curves.len()).filter(|&j| j != i);
    let mut pairs = others.flat_map(|j| (j + 1..curves.len()).map(move |k| (j, k)));
    pairs.find(|&(j, k)| k != i && is_middle(&curves[i].1, &curves[j].1, &curves[k].1))
}

fn is_middle(middle: &[Option<f64>], a: &[Option<f64>], b: &[Option<f64>]) -> bool {
    let (mut off, mut apart, mut values) = (0.0_f64, 0.0, 0);
    for ((m, a), b) in middle.iter().zip(a).zip(b) {
        let (Some(m), Some(a), Some(b)) = (m, a, b) else { continue };
        off = off.max((m - 0.5 * (a + b)).abs());
        apart += (a - b).powi(2);
        values += 1;
    }
    let apart = (apart / f64::from(values.max(1))).sqrt();
    values >= FEWEST as i32 && apart > 0.0 && off <= ROUNDING * apart
}

/// Returns true if a curve is the mean of at least three others.
fn of_all(curves: &[(&str, Vec<Option<f64>>)], i: usize) -> bool {
    if curves.len() < 4 {
        return false;
    }
    let (mut off, mut apart, mut values) = (0.0_f64, 0.0, 0);
    for t in 0..curves[i].1.len() {
        let others = curves.iter().enumerate().filter(|(j, _)| *j != i);
        let others: Option<Vec<f64>> = others.map(|(_, c)| c.1[t]).collect();
        let (Some(own), Some(others)) = (curves[i].1[t], others) else { continue };
        let mean = others.iter().sum::<f64>() / others.len() as f64;
        off = off.max((own - mean).abs());
        apart += others.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / others.len() as f64;
        values += 1;
    }
    let apart = (apart / values.max(1) as f64).sqrt();
    values >= FEWEST && apart > 0.0 && off <= ROUNDING * apart
}

/// Finding about curves that the screen removed, out of all curves.
pub fn left_out(curves: usize, of: usize) -> Option<Finding> {
    if curves == 0 {
        return None;
    }
    let share = curves as f64 / of.max(1) as f64;
    let severity = match share {
        _ if share < SHARE.0 => Severity::Note,
        _ if share < SHARE.1 => Severity::Reservation,
        _ => Severity::Failure,
    };
    let message = format!(
        "{curves} of {} ({}) {} excluded from the calibration as faulty",
        count(of, "measured curve"),
        percent(share),
        if curves == 1 { "is" } else { "are" }
    );
    Some(Finding::new((LEFT_OUT, ""), (share, SHARE.0), severity, message, LOOK))
}

/// Finding about curves that the study adds to this number of replicates.
pub fn added(added: usize, replicates: usize) -> Option<Finding> {
    if added == 0 {
        return None;
    }
    let figure = added as f64 / replicates.max(1) as f64;
    let message = format!(
        "{} computed from {} count as further data, which increases the number of data by a factor of {}",
        count(added, "curve"),
        count(replicates, "replicate"),
        short(1.0 + figure)
    );
    Some(Finding::new((ADDED, ""), (added as f64, 0.0), Severity::Reservation, message, ALONE))
}
