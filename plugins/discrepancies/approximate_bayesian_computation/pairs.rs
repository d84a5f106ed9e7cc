//! Distances that are means over pairs of points.
//!
//! ```text
//! D² = mean k(x, x') + mean k(y, y') - 2 mean k(x, y)
//! ```
//!
//! over all pairs (V-statistics), with `k` minus the distance of the points for the energy distance, and a Gaussian for
//! the maximum mean discrepancy.

/// Similarity of two points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kernel {
    /// Minus their distance.
    Distance,
    /// `exp(-r² / (2 width²))`.
    Gaussian { width: f64 },
}

impl Kernel {
    /// Similarity of points that are `dx` and `dy` apart, and its derivative by `dy`.
    fn at(self, dx: f64, dy: f64) -> (f64, f64) {
        match self {
            Self::Distance => {
                let r = dx.hypot(dy);
                (-r, if r == 0.0 { 0.0 } else { -dy / r })
            }
            Self::Gaussian { width } => {
                let square = width * width;
                let k = (-0.5 * (dx * dx + dy * dy) / square).exp();
                (k, -dy / square * k)
            }
        }
    }
}

/// The data with the mean similarity of their pairs.
#[derive(Debug, Clone)]
pub(super) struct Pairs {
    kernel: Kernel,
    coordinate: Vec<f64>,
    data: Vec<f64>,
    own: f64,
}

impl Pairs {
    pub fn new(kernel: Kernel, coordinate: Option<Vec<f64>>, data: Vec<f64>) -> Self {
        let coordinate = coordinate.unwrap_or_else(|| vec![0.0; data.len()]);
        let mut all = Self { kernel, coordinate, data, own: 0.0 };
        all.own = all.mean(&all.data, &all.data, &mut []);
        all
    }

    /// The median distance of different points of the data, a customary width of the kernel; `None` if it is zero.
    pub fn median(coordinate: Option<&[f64]>, data: &[f64]) -> Option<f64> {
        let at = |i: usize| coordinate.map_or(0.0, |c| c[i]);
        let mut all: Vec<f64> = (0..data.len())
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| (at(i) - at(j)).hypot(data[i] - data[j]))
            .collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().filter(|median| *median > 0.0)
    }

    /// The mean similarity of pairs; adds its derivative by each of the first values, if there is room for them.
    fn mean(&self, first: &[f64], second: &[f64], slopes: &mut [f64]) -> f64 {
        let share = 1.0 / (first.len() * second.len()) as f64;
        let mut sum = 0.0;
        for (i, (x, y)) in self.coordinate.iter().zip(first).enumerate() {
            let mut slope = 0.0;
            for (other, value) in self.coordinate.iter().zip(second) {
                let (k, by) = self.kernel.at(x - other, y - value);
                sum += k;
                slope += by;
            }
            if let Some(own) = slopes.get_mut(i) {
                *own += share * slope;
            }
        }
        share * sum
    }

    pub fn square(&self, values: &[f64], slopes: Option<&mut [f64]>) -> f64 {
        let room = if slopes.is_some() { values.len() } else { 0 };
        let (mut own, mut cross) = (vec![0.0; room], vec![0.0; room]);
        let within = self.mean(values, values, &mut own);
        let between = self.mean(values, &self.data, &mut cross);
        if let Some(slopes) = slopes {
            // A value stands on both sides of the pairs of its own sample.
            let both = own.iter().zip(&cross).map(|(own, cross)| 2.0 * own - 2.0 * cross);
            slopes.iter_mut().zip(both).for_each(|(slope, by)| *slope = by);
        }
        // Rounding may leave a negative number near zero; what is not a number stays so.
        let square = self.own + within - 2.0 * between;
        if square < 0.0 { 0.0 } else { square }
    }
}
