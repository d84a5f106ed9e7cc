//! Smallest and largest values of several functions on the unit cube, when each evaluation gives all functions at once and
//! none has derivatives.
//!
//! Two searches that share nothing are made, each from a Sobol' sequence shifted at random. For one function after the
//! other, downwards and upwards, the best point known to that search is followed by L-BFGS-B with derivatives by
//! differences, and from its end one coordinate after the other jumps to the middle and the ends; every point that is
//! evaluated counts for all functions. The corners and the middle of the cube are evaluated besides. Where the searches
//! differ, both go on with further points of their sequences, and follow the best of these, until they agree or no points
//! are left. The extreme is the best of all; the distance from it of what the worse of the two searches found tells whether
//! the search can be trusted.

mod half;
mod objective;
mod pool;
#[cfg(test)]
mod tests;

use lacuna::math::random::Stream;
use lacuna_linalg::Matrix;

use self::half::Half;
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

/// Share of the width of a function's values by which the results of both searches may differ at the end.
const AGREES: f64 = 0.01;

/// Largest dimension in which all corners are evaluated, and the share of the points that they may take.
const CORNERS: (usize, usize) = (8, 4);

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
    let mut halves = [0, 1].map(|k| Half::new(plan.dimension, each, &stream.at(k), evaluate));
    let all: Vec<Sought> =
        plan.followed.iter().flat_map(|&f| Towards::BOTH.map(|towards| (f, towards))).collect();
    let mut open = all.clone();
    while !open.is_empty() && halves.iter().any(|half| !half.pool.exhausted) {
        for half in &mut halves {
            half.go_on(&open);
        }
        open = all.iter().copied().filter(|&sought| differ(&common, &halves, sought)).collect();
    }
    collect(common, halves.map(|half| half.pool))
}

/// A function and a direction.
type Sought = (usize, Towards);

/// Returns true if the searches disagree about an extreme.
fn differ(common: &Pool<'_>, halves: &[Half<'_>; 2], (function, towards): Sought) -> bool {
    let pools = || [common, &halves[0].pool, &halves[1].pool].into_iter();
    let best = |to: Towards| {
        let each = pools().filter_map(|pool| pool.best(function, to)).map(|(_, v)| to.signed(v));
        each.fold(f64::NEG_INFINITY, f64::max)
    };
    let varies = pools().any(|pool| pool.range(function).is_some());
    let width = Towards::BOTH.iter().map(|&to| best(to)).sum::<f64>();
    let of_half = |half: &Half<'_>| {
        half.pool.best(function, towards).map_or(f64::NEG_INFINITY, |(_, v)| towards.signed(v))
    };
    varies && halves.iter().any(|half| best(towards) - of_half(half) > AGREES * width)
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

/// The best of all points.
fn collect(common: Pool<'_>, halves: [Pool<'_>; 2]) -> Extremes {
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
