//! Points of a search, each evaluated once.

use lacuna_linalg::Matrix;

use super::Towards;

/// Share of the values up to which their differences may be those of rounding.
const ROUNDING: f64 = 1e-12;

/// Evaluated points.
pub(super) struct Pool<'a> {
    evaluate: &'a (dyn Fn(&Matrix) -> Matrix + Sync),
    most: usize,
    /// Number of points at which the present search ends.
    end: usize,
    /// The points.
    pub points: Vec<Vec<f64>>,
    /// Values of all functions at them.
    pub values: Vec<Vec<f64>>,
    /// True if more points were wanted than there may be.
    pub exhausted: bool,
    /// True if the present search wanted more points than it may have.
    pub ended: bool,
}

impl<'a> Pool<'a> {
    /// An empty pool for at most `most` points.
    pub fn new(evaluate: &'a (dyn Fn(&Matrix) -> Matrix + Sync), most: usize) -> Self {
        let (points, values) = (Vec::new(), Vec::new());
        Self { evaluate, most, end: most, points, values, exhausted: false, ended: false }
    }

    /// Number of points for which there is room.
    pub fn room(&self) -> usize {
        self.most.saturating_sub(self.points.len())
    }

    /// Begins a search of at most `points` further points.
    pub fn begin(&mut self, points: usize) {
        self.end = self.most.min(self.points.len() + points);
        self.ended = false;
    }

    /// Rows of points, which are evaluated together where they are new; `None` if the pool has no room for them.
    pub fn at(&mut self, points: &[Vec<f64>]) -> Option<Vec<usize>> {
        let mut new: Vec<&Vec<f64>> = Vec::new();
        for point in points {
            if !self.points.contains(point) && !new.contains(&point) {
                new.push(point);
            }
        }
        let count = self.points.len() + new.len();
        if count > self.end {
            self.ended = true;
            self.exhausted |= count > self.most;
            return None;
        }
        if let Some(first) = new.first() {
            let values = (self.evaluate)(&Matrix::from_rows(first.len(), new.iter().copied()));
            self.values.extend(values.iter_rows().map(<[f64]>::to_vec));
            self.points.extend(new.into_iter().cloned());
        }
        points.iter().map(|point| self.points.iter().position(|other| other == point)).collect()
    }

    /// Row and value of the best point of a function, the first of equals; `None` if it is defined nowhere.
    pub fn best(&self, function: usize, towards: Towards) -> Option<(usize, f64)> {
        self.best_of(0..self.points.len(), function, towards)
    }

    /// Smallest and largest value of a function; `None` if it does not vary beyond rounding.
    pub fn range(&self, function: usize) -> Option<(f64, f64)> {
        let [low, high] = Towards::BOTH.map(|to| self.best(function, to).map(|(_, value)| value));
        let (low, high) = (low?, high?);
        (high - low > ROUNDING * high.abs().max(low.abs())).then_some((low, high))
    }

    /// Row and value of the best of some points.
    pub fn best_of(
        &self,
        rows: impl Iterator<Item = usize>,
        function: usize,
        towards: Towards,
    ) -> Option<(usize, f64)> {
        let mut best: Option<(usize, f64)> = None;
        for row in rows {
            let value = self.values[row][function];
            let better = |(_, known): (usize, f64)| towards.signed(value) > towards.signed(known);
            if value.is_finite() && best.is_none_or(better) {
                best = Some((row, value));
            }
        }
        best
    }
}
