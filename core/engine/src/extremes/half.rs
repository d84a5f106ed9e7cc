//! One of the two searches.

use std::sync::Mutex;

use lacuna::math::random::{Stream, uniform};
use lacuna::math::sobol;
use lacuna_linalg::Matrix;
use lacuna_optimise::{Precision, ascend};

use super::objective::Objective;
use super::pool::Pool;
use super::{Sought, Towards};

/// Share of the points that covers the cube before functions are followed, and that of each later round.
const COVER: [usize; 2] = [4, 12];

/// Largest number of points that cover the cube in one round.
const MOST_COVER: usize = 1024;

/// Unit length of the search in the cube.
const SCALE: f64 = 0.3;

/// Slopes are those of functions divided by their range.
const PRECISION: Precision = Precision { gradient: 3e-3, gain: Some(1e-6), steps: 20 };

/// Smallest number of slopes that a search may take.
const FEWEST_SLOPES: usize = 3;

/// A search with points of its own.
pub(super) struct Half<'a> {
    /// The points.
    pub pool: Pool<'a>,
    points: usize,
    shift: Vec<f64>,
    /// Number of points of the sequence that were used.
    used: u32,
    /// Functions whose last search was cut.
    unfinished: Vec<Sought>,
}

impl<'a> Half<'a> {
    /// A search with at most `points` points.
    pub fn new(
        dimension: usize,
        points: usize,
        stream: &Stream,
        evaluate: &'a (dyn Fn(&Matrix) -> Matrix + Sync),
    ) -> Self {
        let mut generator = stream.generator();
        let shift = (0..dimension).map(|_| uniform(&mut generator)).collect();
        Self { pool: Pool::new(evaluate, points), points, shift, used: 0, unfinished: Vec::new() }
    }

    /// Covers the cube with further points of the sequence, and follows functions from the best of these.
    pub fn go_on(&mut self, all: &[Sought]) {
        let share = COVER[usize::from(self.used > 0)];
        let count = (self.points / share).clamp(1, MOST_COVER) as u32;
        let is_first = self.used == 0;
        let place = |i: u32| -> Vec<f64> {
            let even = sobol::point(i, self.shift.len());
            even.iter().zip(&self.shift).map(|(x, s)| (x + s).fract()).collect()
        };
        let cover: Vec<Vec<f64>> = (self.used..self.used + count).map(place).collect();
        self.used += count;
        self.pool.begin(self.pool.room());
        let Some(new) = self.pool.at(&cover) else { return };
        for (k, &sought) in all.iter().enumerate() {
            // In the first round what was found for other functions counts, later only what is new, unless a search was cut.
            let known = 0..self.pool.points.len();
            let is_open = is_first || self.unfinished.contains(&sought);
            let rows = if is_open { known.collect() } else { new.clone() };
            let few = FEWEST_SLOPES * (2 * self.shift.len() + 1);
            self.pool.begin((self.pool.room() / (all.len() - k)).max(few));
            self.follow(sought, &rows);
            self.unfinished.retain(|other| *other != sought);
            if self.pool.ended {
                self.unfinished.push(sought);
            }
        }
    }

    /// Follows one function from the best of some points.
    fn follow(&mut self, (function, towards): Sought, rows: &[usize]) {
        let ends = Towards::BOTH.map(|to| self.pool.best(function, to).map(|(_, value)| value));
        let [Some(low), Some(high)] = ends else { return };
        let Some((row, _)) = self.pool.best_of(rows.iter().copied(), function, towards) else {
            return;
        };
        // Nothing varies beyond rounding.
        if high - low <= 1e-12 * high.abs().max(low.abs()) {
            return;
        }
        let start = self.pool.points[row].clone();
        let scales = vec![SCALE; start.len()];
        let shared = Mutex::new(&mut self.pool);
        let objective =
            Objective { pool: &shared, function, towards, origin: low, range: high - low };
        // The pool remembers every point of the search, its end among them.
        let _ = ascend(&objective, &start, &scales, PRECISION);
    }
}
