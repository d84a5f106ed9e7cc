//! Values of unknowns from which fits of an effect start, and the options that a search tries.

use lacuna_base::math::distribution::Distribution;
use toml::{Table, Value};

/// Sizes from which fits start: the quartiles of the prior if they lie on both sides of `absent`, else its median, or
/// its upper quartile if the median is `absent`.
pub fn signs(prior: Option<&Distribution>, absent: f64) -> Vec<f64> {
    let Some(prior) = prior else { return vec![absent + 1.0] };
    let (below, above) = (prior.quantile(0.25), prior.quantile(0.75));
    if below < absent && absent < above {
        vec![below, above]
    } else {
        vec![if prior.quantile(0.5) == absent { above } else { prior.quantile(0.5) }]
    }
}

/// At most `count` evenly spaced numbers between two bounds, restricted to the central 99 % of the prior.
pub fn spaced(prior: Option<&Distribution>, (low, high): (f64, f64), count: usize) -> Vec<f64> {
    let (low, high) = clipped(prior, low, high);
    let step = (high - low) / count as f64;
    inside(prior, (0..count).map(|i| low + step * (i as f64 + 0.5)))
}

/// Numbers between two bounds about `step` apart, at least 2 and at most `most`, restricted to the central 99 % of the
/// prior.
pub fn apart(
    prior: Option<&Distribution>,
    (low, high): (f64, f64),
    step: f64,
    most: usize,
) -> Vec<f64> {
    let (from, to) = clipped(prior, low, high);
    let count = ((to - from) / step).ceil();
    let count = if count.is_finite() { (count as usize).clamp(2, most) } else { most };
    spaced(prior, (low, high), count)
}

/// At most `count` positive numbers in geometric progression between two bounds, restricted to the central 99 % of the
/// prior.
pub fn spaced_by_ratio(
    prior: Option<&Distribution>,
    (low, high): (f64, f64),
    count: usize,
) -> Vec<f64> {
    let (from, to) = clipped(prior, low, high);
    let from = from.max(1e-6 * to);
    if from <= 0.0 {
        return inside(prior, std::iter::empty());
    }
    let ratio = (to / from).ln() / count as f64;
    inside(prior, (0..count).map(|i| from * (ratio * (i as f64 + 0.5)).exp()))
}

/// Intersection of the bounds with the central 99 % of the prior; the latter alone if they are disjoint.
fn clipped(prior: Option<&Distribution>, low: f64, high: f64) -> (f64, f64) {
    let Some(prior) = prior else { return (low, high) };
    let (least, most) = (prior.quantile(0.005), prior.quantile(0.995));
    let (from, to) = (low.max(least), high.min(most));
    if from < to { (from, to) } else { (least, most) }
}

/// Values inside the support of the prior; its median if there are none.
fn inside(prior: Option<&Distribution>, values: impl Iterator<Item = f64>) -> Vec<f64> {
    let allowed = |x: &f64| prior.is_none_or(|prior| prior.log_density(*x).is_finite());
    let kept: Vec<f64> = values.filter(allowed).collect();
    if kept.is_empty() { vec![prior.map_or(1.0, |prior| prior.quantile(0.5))] } else { kept }
}

/// All combinations of the values of each unknown.
pub fn all(values: &[Vec<f64>]) -> Vec<Vec<f64>> {
    values.iter().fold(vec![Vec::new()], |rows, column| {
        let longer = |row: &Vec<f64>, x: &f64| [&row[..], &[*x]].concat();
        rows.iter().flat_map(|row| column.iter().map(move |x| longer(row, x))).collect()
    })
}

/// Options of one variant of an effect: the priors of its unknowns.
pub fn propose(priors: &[(&str, Distribution)]) -> Table {
    let entry = |(key, prior): &(&str, Distribution)| {
        let numbers = prior.numbers().iter().map(|x| Value::Float(*x));
        let value = match prior {
            Distribution::HalfNormal(x) | Distribution::Exponential(x) => Value::Float(*x),
            _ => Value::Array(numbers.collect()),
        };
        ((*key).to_owned(), Value::Table(Table::from_iter([(prior.name().to_owned(), value)])))
    };
    priors.iter().map(entry).collect()
}
