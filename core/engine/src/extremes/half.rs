//! One of the two searches.

use std::sync::Mutex;

use lacuna::math::random::{Stream, uniform};
use lacuna::math::sobol;
use lacuna_linalg::Matrix;
use lacuna_optimise::{Precision, ascend};

use super::Sought;
use super::objective::Objective;
use super::pool::Pool;

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

/// Values to which one coordinate jumps from the end of a search.
const JUMPS: [f64; 3] = [0.0, 0.5, 1.0];

/// Largest number of searches that begin where one jumped to, and the gain from which one begins, as a share of the range.
const MOST_JUMPS: usize = 4;
const GAIN: f64 = 1e-3;

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
            let d = self.shift.len();
            let few = FEWEST_SLOPES * (2 * d + 1) + JUMPS.len() * d + 1;
            self.pool.begin((self.pool.room() / (all.len() - k)).max(few));
            self.follow(sought, &rows);
            self.unfinished.retain(|other| *other != sought);
            if self.pool.ended {
                self.unfinished.push(sought);
            }
        }
    }

    /// Follows one function from the best of some points.
    fn follow(&mut self, sought: Sought, rows: &[usize]) {
        let (function, towards) = sought;
        let Some((low, high)) = self.pool.range(function) else { return };
        let Some((row, _)) = self.pool.best_of(rows.iter().copied(), function, towards) else {
            return;
        };
        let mut start = self.pool.points[row].clone();
        let scales = vec![SCALE; start.len()];
        for _ in 0..MOST_JUMPS {
            let shared = Mutex::new(&mut self.pool);
            let objective =
                Objective { pool: &shared, function, towards, origin: low, range: high - low };
            let Some(end) = ascend(&objective, &start, &scales, PRECISION) else { return };
            match self.jump(&end.point, sought, GAIN * (high - low)) {
                Some(better) => start = better,
                None => return,
            }
        }
    }

    /// The best point that differs from this one in coordinates at an end or in the middle: in one of them, or in all that
    /// gain by themselves; `None` if none gains enough. A search that follows slopes does not see beyond a valley; where
    /// coordinates act separately, this does.
    fn jump(&mut self, from: &[f64], (function, towards): Sought, gain: f64) -> Option<Vec<f64>> {
        let places = |j: usize| {
            JUMPS.map(|x| {
                let mut moved = from.to_vec();
                moved[j] = x;
                moved
            })
        };
        let here = self.pool.at(&[from.to_vec()])?[0];
        let jumps: Vec<Vec<f64>> = (0..from.len()).flat_map(places).collect();
        let mut rows = self.pool.at(&jumps)?;
        let mut together = from.to_vec();
        for (j, own) in rows.chunks(JUMPS.len()).enumerate() {
            let of_coordinate = [here].into_iter().chain(own.iter().copied());
            let (row, _) = self.pool.best_of(of_coordinate, function, towards)?;
            together[j] = self.pool.points[row][j];
        }
        rows.extend(self.pool.at(&[together])?);
        let value = |row: usize| towards.signed(self.pool.values[row][function]);
        let (best, _) = self.pool.best_of(rows.into_iter(), function, towards)?;
        (value(best) - value(here) > gain).then(|| self.pool.points[best].clone())
    }
}
