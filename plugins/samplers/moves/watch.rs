//! Correlation of a population with its start.

use super::Evaluated;

/// A correlation that decreases by less than this within [`PATIENCE`] sweeps is taken as final: separate modes do not
/// mix.
const STALL: f64 = 0.02;
const PATIENCE: usize = 8;

/// Correlations of the points with their start, sweep by sweep.
pub(super) struct Watch {
    before: Vec<Vec<f64>>,
    history: Vec<Vec<f64>>,
}

impl Watch {
    pub fn new(population: &Evaluated) -> Self {
        Self { before: quantities(population), history: Vec::new() }
    }

    /// Returns true if the correlation of each quantity has fallen to `threshold`, or no longer decreases.
    pub fn forgotten(&mut self, population: &Evaluated, threshold: f64) -> bool {
        let now = quantities(population);
        // A correlation below its own standard error cannot be detected.
        let threshold = threshold.max(1.0 / (population.points.rows() as f64).sqrt());
        let present: Vec<f64> =
            self.before.iter().zip(&now).map(|(x, y)| correlation(x, y)).collect();
        self.history.push(present);
        let Some((last, rest)) = self.history.split_last() else { return false };
        (0..last.len()).all(|q| {
            let stalled =
                rest.len() >= PATIENCE && rest[rest.len() - PATIENCE][q] - last[q] < STALL;
            last[q] <= threshold || stalled
        })
    }

    /// Returns the remaining correlations: the largest of the coordinates, and that of the likelihood.
    pub fn left(&self) -> (f64, f64) {
        let last = self.history.last().and_then(|last| last.split_last());
        last.map_or((1.0, 1.0), |(likelihood, coordinates)| {
            (coordinates.iter().copied().fold(0.0, f64::max), *likelihood)
        })
    }
}

/// Returns the coordinates, and the ranks of the likelihoods, one list each. Ranks weigh all orders of magnitude of
/// the likelihood alike.
fn quantities(population: &Evaluated) -> Vec<Vec<f64>> {
    let d = population.points.columns();
    let mut all: Vec<Vec<f64>> = (0..d).map(|j| population.points.column(j)).collect();
    all.push(ranks(&population.log_likelihoods()));
    all
}

/// Returns the rank of each number.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for (rank, &i) in order.iter().enumerate() {
        ranks[i] = rank as f64;
    }
    ranks
}

/// Returns the correlation of two lists; zero if one of them is constant.
fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (a, b) in x.iter().zip(y) {
        let (a, b) = (a - mx, b - my);
        xx += a * a;
        yy += b * b;
        xy += a * b;
    }
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}
