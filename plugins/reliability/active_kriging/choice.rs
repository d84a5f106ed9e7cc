//! Choice of the next calls of the model.

use lacuna::math::random::{Stream, uniform};
use lacuna::math::special::normal_cdf;
use lacuna_linalg::Matrix;

use super::process::Process;

/// Samples of the variables with what the process predicts there.
pub struct Predicted {
    /// Points (`samples x dimension`).
    pub points: Matrix,
    /// Shares of the probability, which sum to one.
    pub weights: Vec<f64>,
    /// Means of the process.
    pub mean: Vec<f64>,
    /// Standard deviations of the process.
    pub deviation: Vec<f64>,
}

impl Predicted {
    /// Predictions at weighted samples.
    pub fn new(process: &Process, points: Matrix, weights: Vec<f64>) -> Self {
        let (mean, deviation) = (process.mean(&points), process.deviation(&points));
        Self { points, weights, mean, deviation }
    }

    /// Probability of failure if the process were this many standard deviations above its mean.
    pub fn probability(&self, deviations: f64) -> f64 {
        let each = self.weights.iter().zip(&self.mean).zip(&self.deviation);
        each.filter(|((_, m), s)| **m + deviations * **s <= 0.0).map(|((w, _), _)| w).sum()
    }

    /// Probability that the sign of the mean is wrong, at each sample times its weight.
    pub fn doubts(&self) -> Vec<f64> {
        let each = self.weights.iter().zip(&self.mean).zip(&self.deviation);
        each.map(|((w, m), s)| if *s > 0.0 { w * normal_cdf(-m.abs() / s) } else { 0.0 }).collect()
    }

    /// Chooses up to `count` samples at which a call of the model removes most of the doubt.
    ///
    /// Samples are drawn in proportion to the probability that their sign is wrong. A call at one of them reduces the
    /// variance at the others by the square of their correlation; the sample with the largest sum of these reductions is
    /// taken, and the covariance is reduced by its call before the next is chosen. This is a stepwise reduction of the
    /// uncertainty of the probability (Bect, Ginsbourger, Li, Picheny and Vazquez, Stat. Comput. 22 (2012) 773) in an
    /// approximation that needs no integral.
    pub fn choose(&self, process: &Process, count: usize, stream: &Stream) -> Matrix {
        let chosen = resampled(&self.doubts(), CANDIDATES, stream);
        let candidates = self.points.select_rows(&chosen);
        let mut covariance = process.covariance(&candidates);
        let n = chosen.len();
        let first: Vec<f64> = (0..n).map(|i| covariance[(i, i)]).collect();
        let mut taken = Matrix::zeros(0, self.points.columns());
        for _ in 0..count.min(n) {
            let gain = |c: usize| {
                let own = covariance[(c, c)];
                if own <= 1e-9 * first[c] {
                    return 0.0;
                }
                (0..n)
                    .filter(|&i| first[i] > 0.0)
                    .map(|i| covariance[(i, c)].powi(2) / (own * first[i]))
                    .sum()
            };
            let gains: Vec<f64> = (0..n).map(gain).collect();
            let Some(best) = (0..n).max_by(|&a, &b| gains[a].total_cmp(&gains[b])) else { break };
            if gains[best] <= 0.0 {
                break;
            }
            taken.push_row(candidates.row(best));
            let (own, column) = (covariance[(best, best)], covariance.column(best));
            for i in 0..n {
                let row = covariance.row_mut(i);
                row.iter_mut().zip(&column).for_each(|(c, other)| *c -= column[i] * other / own);
            }
        }
        taken
    }
}

/// Number of samples among which the next call is chosen.
const CANDIDATES: usize = 300;

/// Indices drawn systematically in proportion to these masses, without repetition.
fn resampled(masses: &[f64], count: usize, stream: &Stream) -> Vec<usize> {
    let total: f64 = masses.iter().sum();
    let offset = uniform(&mut stream.generator());
    let (mut chosen, mut sum): (Vec<usize>, f64) = (Vec::new(), 0.0);
    let mut next = 0_usize;
    for (i, mass) in masses.iter().enumerate() {
        sum += mass;
        let before = next;
        while next < count && (next as f64 + offset) * total < sum * count as f64 {
            next += 1;
        }
        if next > before {
            chosen.push(i);
        }
    }
    chosen
}
