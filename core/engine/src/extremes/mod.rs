//! Smallest and largest values of several functions on the unit cube, when each evaluation gives all functions at once and
//! none has derivatives.
//!
//! Two searches that share nothing are made, each from a Sobol' sequence shifted at random. For one function after the
//! other, downwards and upwards, the best point known to that search is followed by L-BFGS-B with derivatives by
//! differences; every point that is evaluated counts for all functions. The corners and the middle of the cube are
//! evaluated besides. The extreme is the best of all; the distance from it of what the worse of the two searches found
//! tells whether the search can be trusted.

mod objective;
mod pool;
#[cfg(test)]
mod tests;

use std::sync::Mutex;

use lacuna::math::random::{Stream, uniform};
use lacuna::math::sobol;
use lacuna_linalg::Matrix;
use lacuna_optimise::{Precision, ascend};

use self::objective::Objective;
use self::pool::Pool;

/// Extent of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Dimension of the cube.
    pub dimension: usize,
    /// Functions whose extremes are searched for; those of the others are the best of the points that this visits.
    pub followed: Vec<usize>,
    /// Largest number of points.
    pub points: usize,
}

/// Extremes of functions.
#[derive(Debug, Clone, PartialEq)]
pub struct Extremes {
    /// Points of the unit cube that were evaluated.
    pub points: Vec<Vec<f64>>,
    /// Values of all functions there, `points x functions`.
    pub values: Vec<Vec<f64>>,
    /// Smallest value of each function; `None` if it is defined nowhere.
    pub lowest: Vec<Option<Extreme>>,
    /// Largest value of each function.
    pub highest: Vec<Option<Extreme>>,
    /// True if a search ended because it had no points left.
    pub exhausted: bool,
}

/// An extreme of one function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// Value of the function.
    pub value: f64,
    /// Row of the point at which it is reached.
    pub row: usize,
    /// Distance from `value` of the best value that the worse of two independent searches found.
    pub difference: f64,
}

/// Direction of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Towards {
    Lowest,
    Highest,
}

impl Towards {
    const BOTH: [Self; 2] = [Self::Lowest, Self::Highest];

    /// A value with the sign that makes the best one the largest.
    fn signed(self, value: f64) -> f64 {
        match self {
            Self::Lowest => -value,
            Self::Highest => value,
        }
    }
}

/// Share of the points that covers the cube before functions are followed.
const COVER: usize = 3;

/// Largest number of points that cover the cube in one search.
const MOST_COVER: usize = 1024;

/// Largest dimension in which all corners are evaluated, and the share of the points that they may take.
const CORNERS: (usize, usize) = (8, 4);

/// Unit length of the search in the cube.
const SCALE: f64 = 0.3;

/// Slopes are those of functions divided by their range.
const PRECISION: Precision = Precision { gradient: 1e-4, gain: Some(1e-8), steps: 20 };

/// Searches for the extremes of functions; `evaluate` gives all of them (columns) at points of the unit cube (rows), NaN
/// where one is undefined.
pub fn extremes(
    plan: &Plan,
    stream: &Stream,
    evaluate: &(dyn Fn(&Matrix) -> Matrix + Sync),
) -> Extremes {
    let shared = shared(plan);
    let each = plan.points.saturating_sub(shared.len()) / 2;
    let mut common = Pool::new(evaluate, shared.len());
    common.at(&shared);
    let halves: Vec<Pool<'_>> = (0..2).map(|k| half(plan, each, &stream.at(k), evaluate)).collect();
    collect(common, halves)
}

/// The middle of the cube, and its corners unless these are too many.
fn shared(plan: &Plan) -> Vec<Vec<f64>> {
    let d = plan.dimension;
    let mut all = vec![vec![0.5; d]];
    if d <= CORNERS.0 && (1 << d) <= plan.points / CORNERS.1 {
        let corner = |k: usize| (0..d).map(|j| f64::from(u8::from(k >> j & 1 == 1))).collect();
        all.extend((0..1 << d).map(corner));
    }
    all
}

/// One of the two searches, with at most `points` points.
fn half<'a>(
    plan: &Plan,
    points: usize,
    stream: &Stream,
    evaluate: &'a (dyn Fn(&Matrix) -> Matrix + Sync),
) -> Pool<'a> {
    let mut generator = stream.generator();
    let shift: Vec<f64> = (0..plan.dimension).map(|_| uniform(&mut generator)).collect();
    let cover = (points / COVER).clamp(1, MOST_COVER) as u32;
    let place = |i: u32| {
        let even = sobol::point(i, plan.dimension);
        even.iter().zip(&shift).map(|(x, s)| (x + s).fract()).collect()
    };
    let start: Vec<Vec<f64>> = (0..cover).map(place).collect();
    let mut pool = Pool::new(evaluate, points);
    pool.at(&start);
    for &function in &plan.followed {
        for towards in Towards::BOTH {
            pool = follow(pool, function, towards);
        }
    }
    pool
}

/// Follows one function from the best point that is known.
fn follow(pool: Pool<'_>, function: usize, towards: Towards) -> Pool<'_> {
    let ends = Towards::BOTH.map(|to| pool.best(function, to).map(|(_, value)| value));
    let Some(start) = pool.best(function, towards).map(|(row, _)| pool.points[row].clone()) else {
        return pool;
    };
    let [Some(low), Some(high)] = ends else { return pool };
    // Nothing varies beyond rounding.
    if high - low <= 1e-12 * high.abs().max(low.abs()) {
        return pool;
    }
    let scales = vec![SCALE; start.len()];
    let shared = Mutex::new(pool);
    let objective = Objective { pool: &shared, function, towards, origin: low, range: high - low };
    // The pool remembers every point of the search, its end among them.
    let _ = ascend(&objective, &start, &scales, PRECISION);
    shared.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// The best of all points.
fn collect(common: Pool<'_>, halves: Vec<Pool<'_>>) -> Extremes {
    let exhausted = halves.iter().any(|half| half.exhausted);
    let functions = common.values.first().map_or(0, Vec::len);
    let of_halves = |function: usize, to: Towards| {
        let values = halves.iter().map(|half| half.best(function, to).map(|(_, value)| value));
        let worst = values.map(|value| value.map_or(f64::NEG_INFINITY, |v| to.signed(v)));
        worst.fold(f64::INFINITY, f64::min)
    };
    let worse: Vec<[f64; 2]> =
        (0..functions).map(|function| Towards::BOTH.map(|to| of_halves(function, to))).collect();
    let mut all = common;
    for half in halves {
        all.points.extend(half.points);
        all.values.extend(half.values);
    }
    let extreme = |function: usize, to: Towards| {
        let (row, value) = all.best(function, to)?;
        let other = worse[function][usize::from(to == Towards::Highest)];
        Some(Extreme { value, row, difference: to.signed(value) - other })
    };
    let [lowest, highest] =
        Towards::BOTH.map(|to| (0..functions).map(|function| extreme(function, to)).collect());
    Extremes { points: all.points, values: all.values, lowest, highest, exhausted }
}
