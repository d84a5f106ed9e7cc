//! Search over the intervals' box, and the bounds at what it finds.

use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::ErrorPath;
use lacuna_linalg::Matrix;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::super::Work;
use super::super::inputs::PropagatedInputs;
use super::figures::{COUNT, ERRORS, PROBABILITIES, QUANTILES, SEARCHED, UNDEFINED, figures};
use super::{Bounds, BoundsFindings, End, Interval, Range};
use crate::extremes::{Extremes, Plan, extremes};
use crate::stage::predict;
use crate::study::Study;
use crate::study::quantity::Asked;

/// Largest number of points of the box for each quantity at which bounds are computed with all draws.
const FINAL: usize = 16;

/// Share of a figure up to which differences may be those of rounding.
const ROUNDING: f64 = 1e-12;

/// Distance in the unit cube below which bounds of quantiles share a point.
const NEAR: f64 = 0.02;

/// Number of evaluations of each scenario that bounds need at most, with these draws of the distributions.
pub(in super::super) fn evaluations(study: &Study, draws: usize) -> usize {
    let size = study.interval_search();
    if study.intervals().is_empty() {
        return 0;
    }
    if !study.has_distributions() {
        return size.points;
    }
    let last = if size.draws < draws { FINAL * study.quantities.len() * draws } else { 0 };
    size.points * size.draws.min(draws) + last
}

/// Everything of the study that its bounds depend on besides the distributions and the quantities; null without intervals.
pub(in super::super) fn identity(study: &Study) -> Value {
    let intervals = study.intervals();
    let size = study.interval_search();
    if intervals.is_empty() { Value::Null } else { json!([intervals, size.points, size.draws]) }
}

/// Bounds of all quantities; `None` without intervals. `stream` is that of the draws of the distributions.
pub(in super::super) fn bounds(
    work: &Work<'_>,
    inputs: &PropagatedInputs,
    draws: usize,
    stream: &Stream,
) -> Option<BoundsFindings> {
    let study = work.study;
    let intervals = intervals(study);
    if intervals.is_empty() || work.asked.is_empty() {
        return None;
    }
    let size = study.interval_search();
    let random = !inputs.laws.is_empty() || !work.errors.is_none();
    let draws = if random { affordable(work, draws) } else { 1 };
    let searched_draws = size.draws.min(draws);
    let inner = Inner::new(work, inputs, searched_draws, stream);
    let plan = Plan {
        dimension: intervals.len(),
        followed: (0..work.asked.len()).flat_map(|q| SEARCHED.map(|f| q * COUNT + f)).collect(),
        points: size.points,
    };
    let natural = |u: &[f64]| -> Vec<f64> {
        let each = u.iter().zip(&intervals);
        each.map(|(u, Interval { ends: [a, b], .. })| a * (1.0 - u) + b * u).collect()
    };
    let values = |inner: &Inner<'_, '_>, points: &[Vec<f64>]| {
        let all: Vec<Vec<f64>> = points.iter().map(|u| inner.figures(&natural(u))).collect();
        work.progress.add(all.len() as u64);
        all
    };
    let evaluate = |points: &Matrix| {
        let points: Vec<Vec<f64>> = points.iter_rows().map(<[f64]>::to_vec).collect();
        Matrix::from_rows(COUNT * work.asked.len(), values(&inner, &points))
    };
    let found = extremes(&plan, &work.random.named("intervals"), &evaluate);
    let (points, rows) = if searched_draws < draws {
        let points = chosen(&found, work.asked.len());
        let inner = Inner::new(work, inputs, draws, stream);
        let rows = values(&inner, &points);
        (points, rows)
    } else {
        (found.points.clone(), found.values.clone())
    };
    let places: Vec<Vec<f64>> = points.iter().map(|u| natural(u)).collect();
    let of =
        |quantity: usize| Ends { found: &found, places: &places, rows: &rows }.bounds(quantity);
    Some(BoundsFindings {
        draws,
        searched_draws,
        points: found.points.len(),
        exhausted: found.exhausted,
        quantities: (0..work.asked.len()).map(of).collect(),
        intervals,
    })
}

fn intervals(study: &Study) -> Vec<Interval> {
    let interval = |j: usize| {
        let parameter = &study.parameters[j];
        let (low, high) = parameter.prior.support();
        Interval {
            name: parameter.name.clone(),
            unit: parameter.unit.to_string(),
            ends: [low, high],
        }
    };
    study.intervals().into_iter().map(interval).collect()
}

/// Number of draws whose responses and errors can be held.
fn affordable(work: &Work<'_>, draws: usize) -> usize {
    let outputs = work.forward.map_or(1, lacuna::plugin::Forward::outputs);
    predict::affordable(draws, outputs * (1 + work.errors.count()))
}

/// The draws of everything but the intervals.
struct Inner<'a, 'w> {
    work: &'a Work<'w>,
    /// Points of the inputs, the intervals at their middle; a single one if no input has a distribution.
    points: Vec<Vec<f64>>,
    /// Errors of each draw.
    paths: Vec<Vec<ErrorPath>>,
    /// Places of the intervals among the inputs.
    places: Vec<usize>,
}

impl<'a, 'w> Inner<'a, 'w> {
    /// The first draws of the propagation, with its errors.
    fn new(work: &'a Work<'w>, inputs: &PropagatedInputs, draws: usize, stream: &Stream) -> Self {
        let count = if inputs.laws.is_empty() { 1 } else { draws };
        let points = (0..count).map(|i| inputs.draw(&stream.at(i as u64))).collect();
        let middle = &inputs.middle;
        let errors = |i: usize| work.errors.draw(&[], middle, &work.random.at(i as u64));
        let paths = (0..draws).into_par_iter().map(errors).collect();
        Self { work, points, paths, places: work.study.intervals() }
    }

    /// Figures of all quantities where the interval parameters have these values, quantity by quantity.
    fn figures(&self, values: &[f64]) -> Vec<f64> {
        let at = |point: &Vec<f64>| {
            let mut point = point.clone();
            self.places.iter().zip(values).for_each(|(&j, &value)| point[j] = value);
            point
        };
        let d = self.points[0].len();
        let points = Matrix::from_rows(d, self.points.iter().map(at));
        let responses = self.work.responses(&points);
        let one = |(i, paths): (usize, &Vec<ErrorPath>)| {
            let row = i.min(points.rows() - 1);
            let place = self.work.place(points.row(row), &responses[row]);
            self.work.evaluated(&place, paths, Asked::includes)
        };
        let drawn: Vec<Vec<f64>> = self.paths.par_iter().enumerate().map(one).collect();
        let of = |quantity: usize| {
            figures(&drawn.iter().map(|values| values[quantity]).collect::<Vec<f64>>())
        };
        (0..self.work.asked.len()).flat_map(of).collect()
    }
}

/// Points at which bounds are computed with all draws: those of the searched figures, then those of quantiles that are far
/// from all others.
fn chosen(found: &Extremes, quantities: usize) -> Vec<Vec<f64>> {
    let rows = |figure: usize| {
        [&found.lowest, &found.highest].into_iter().filter_map(move |all| Some(all[figure]?.row))
    };
    let mut points: Vec<Vec<f64>> = Vec::new();
    for row in (0..quantities).flat_map(|q| SEARCHED.map(|f| q * COUNT + f)).flat_map(rows) {
        if !points.contains(&found.points[row]) {
            points.push(found.points[row].clone());
        }
    }
    let of_quantiles = (0..PROBABILITIES.len())
        .flat_map(|k| (0..quantities).flat_map(move |q| rows(q * COUNT + QUANTILES + k)));
    for row in of_quantiles {
        let far = |other: &Vec<f64>| {
            other.iter().zip(&found.points[row]).any(|(a, b)| (a - b).abs() > NEAR)
        };
        if points.len() < FINAL * quantities && points.iter().all(far) {
            points.push(found.points[row].clone());
        }
    }
    points
}

/// Points with the figures there, from which bounds are taken.
struct Ends<'a> {
    found: &'a Extremes,
    places: &'a [Vec<f64>],
    rows: &'a [Vec<f64>],
}

impl Ends<'_> {
    /// Row with the smallest (`sign` 1) or largest (-1) value of a figure, the first of those that are equal up to rounding.
    fn row(&self, figure: usize, sign: f64) -> Option<usize> {
        let value = |row: usize| sign * self.rows[row][figure];
        let defined = || (0..self.rows.len()).filter(|&row| value(row).is_finite());
        let least = defined().map(value).min_by(f64::total_cmp)?;
        defined().find(|&row| value(row) <= least + ROUNDING * least.abs())
    }

    fn bounds(&self, quantity: usize) -> Option<Bounds> {
        let first = quantity * COUNT;
        let end = |k: usize, sign: f64| {
            let figure = first + SEARCHED[k];
            let row = self.row(figure, sign)?;
            let extremes = if sign > 0.0 { &self.found.lowest } else { &self.found.highest };
            Some(End {
                value: self.rows[row][figure],
                error: self.rows[row][first + ERRORS + k],
                at: self.places[row].clone(),
                difference: extremes[figure]?.difference,
            })
        };
        let range = |k: usize| Some(Range { lower: end(k, 1.0)?, upper: end(k, -1.0)? });
        let quantile = |k: usize| {
            let figure = first + QUANTILES + k;
            let at = |sign: f64| Some(self.rows[self.row(figure, sign)?][figure]);
            Some([at(1.0)?, at(-1.0)?])
        };
        let undefined = self.rows.iter().map(|row| row[first + UNDEFINED]).fold(0.0, f64::max);
        Some(Bounds {
            mean: range(0)?,
            sd: range(1)?,
            q025: range(2)?,
            median: range(3)?,
            q975: range(4)?,
            quantiles: (0..PROBABILITIES.len()).map(quantile).collect::<Option<_>>()?,
            undefined: undefined as usize,
        })
    }
}
