//! How much a population remembers of where it was.

use super::Evaluated;

/// A correlation that falls by less than this in [`PATIENCE`] sweeps stays: separate modes do not mix.
const STALL: f64 = 0.02;
const PATIENCE: usize = 8;

/// How much the particles remember of where they were.
pub(super) struct Watch {
    before: Vec<Vec<f64>>,
    history: Vec<Vec<f64>>,
}

impl Watch {
    pub fn new(population: &Evaluated) -> Self {
        Self { before: quantities(population), history: Vec::new() }
    }

    /// Whether each quantity has forgotten its past, or will not within reach.
    pub fn forgotten(&mut self, population: &Evaluated, threshold: f64) -> bool {
        let now = quantities(population);
        // Less than the error of a correlation cannot be seen.
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

    /// The correlations that are left: the largest of a coordinate, and that of the likelihood.
    pub fn left(&self) -> (f64, f64) {
        let last = self.history.last().and_then(|last| last.split_last());
        last.map_or((1.0, 1.0), |(likelihood, coordinates)| {
            (coordinates.iter().copied().fold(0.0, f64::max), *likelihood)
        })
    }
}

/// The coordinates, and the ranks of the likelihoods, which tell of all their orders of magnitude alike; one list
/// each.
fn quantities(population: &Evaluated) -> Vec<Vec<f64>> {
    let d = population.points.columns();
    let mut all: Vec<Vec<f64>> = (0..d).map(|j| population.points.column(j)).collect();
    all.push(ranks(&population.log_likelihoods()));
    all
}

/// The rank of each number.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for (rank, &i) in order.iter().enumerate() {
        ranks[i] = rank as f64;
    }
    ranks
}

/// The correlation of two lists; zero where one of them does not vary.
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
