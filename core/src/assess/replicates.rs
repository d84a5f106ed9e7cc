//! Replicates that are no independent measurements.

use super::words::{count, names, percent, short};
use super::{Finding, Rule, Severity};

const DUPLICATE: &str = "duplicate_replicates";
const SYMMETRIC: &str = "symmetric_replicates";
const LEFT_OUT: &str = "left_out_curves";
const ADDED: &str = "added_curves";

/// Curves with fewer common values are not compared: short ones coincide by rounding.
const FEWEST: usize = 5;
/// How far a curve may be from the mean of others, as a share of what separates those, to count as made from them.
const ROUNDING: f64 = 0.01;
/// So many curves of a group are compared with each other.
const MOST: usize = 60;
/// The share of curves left out that is a reservation, and a failure.
const SHARE: (f64, f64) = (0.1, 0.5);

const ONCE: &str = "hand over each measured curve once; a `sigma` is no replicate";
const CURVES: &str =
    "hand over the measured curves themselves, without their mean and without ends of intervals";
const LOOK: &str = "look at the curves in the report and at the sensor; raise `screen.threshold` if they are sound";
const ALONE: &str = "take `added_curves` out of `[measurements]`";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: DUPLICATE,
            looks_at: format!(
                "curves of a group with the same values ({FEWEST} or more, not all equal)"
            ),
            threshold: "any: reservation; half of the curves: failure".to_owned(),
            why: "copies count as independent measurements: the intervals shrink with the root of their number",
            action: ONCE,
        },
        Rule {
            code: SYMMETRIC,
            looks_at: format!(
                "a curve that is the mean of two others or of all others, to {} of what separates them",
                percent(ROUNDING)
            ),
            threshold: "any: failure".to_owned(),
            why: "a mean and its interval are not three measurements: the noise is wrong and the mean counts thrice",
            action: CURVES,
        },
        Rule {
            code: LEFT_OUT,
            looks_at: "the share of measured curves that the screen leaves out".to_owned(),
            threshold: format!(
                "any: note; {}: reservation; {}: failure",
                percent(SHARE.0),
                percent(SHARE.1)
            ),
            why: "a sound set has few faulty curves; with many, those left out may be the sound ones",
            action: LOOK,
        },
        Rule {
            code: ADDED,
            looks_at: "curves over the replicates that `added_curves` counts as data".to_owned(),
            threshold: "any: reservation".to_owned(),
            why: "the same information is counted twice",
            action: ALONE,
        },
    ]
}

/// The curves of one group: name of the replicate and its values there.
pub type Curves<'a> = Vec<(&'a str, Vec<Option<f64>>)>;

fn common(a: &[Option<f64>], b: &[Option<f64>]) -> Vec<(f64, f64)> {
    a.iter().zip(b).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect()
}

fn vary(pairs: &[(f64, f64)]) -> bool {
    pairs.iter().any(|pair| pair.0 != pairs[0].0)
}

/// Replicates of a group whose values are those of an earlier one.
pub fn duplicates(group: &str, curves: &Curves<'_>) -> Option<Finding> {
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
    let half = 2 * copies.len() >= curves.len();
    let severity = if half { Severity::Failure } else { Severity::Reservation };
    let message = format!(
        "{} of {} repeat the values of another: {}; they count as independent measurements",
        copies.len(),
        count(curves.len(), "replicate"),
        names(&copies)
    );
    Some(Finding::new((DUPLICATE, group), (copies.len() as f64, 0.0), severity, message, ONCE))
}

/// A replicate of a group that is the mean of two others, or of all others.
pub fn symmetric(group: &str, curves: &Curves<'_>) -> Option<Finding> {
    let curves = &curves[..curves.len().min(MOST)];
    let made = |i: usize| {
        of_two(curves, i)
            .map(|(j, k)| format!("`{}` and `{}`", curves[j].0, curves[k].0))
            .or_else(|| of_all(curves, i).then(|| "all others".to_owned()))
    };
    let (i, others) = (0..curves.len()).find_map(|i| Some((i, made(i)?)))?;
    let message = format!(
        "replicate `{}` is the mean of {others}: these are no independent measurements",
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

/// Whether a curve is the mean of at least three others.
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

/// Curves that the screen left out, of all curves.
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
        "{curves} of {} ({}) {} left out of the calibration as faulty",
        count(of, "measured curve"),
        percent(share),
        if curves == 1 { "is" } else { "are" }
    );
    Some(Finding::new((LEFT_OUT, ""), (share, SHARE.0), severity, message, LOOK))
}

/// Curves that the study adds to so many replicates.
pub fn added(added: usize, replicates: usize) -> Option<Finding> {
    if added == 0 {
        return None;
    }
    let figure = added as f64 / replicates.max(1) as f64;
    let message = format!(
        "{} over {} count as further data: a factor of {} in the number of data",
        count(added, "curve"),
        count(replicates, "replicate"),
        short(1.0 + figure)
    );
    Some(Finding::new((ADDED, ""), (added as f64, 0.0), Severity::Reservation, message, ALONE))
}
