//! One case of a coverage study: a truth, and the calibration of its data.

use serde::{Deserialize, Serialize};

use super::{Coordinate, EDGE, LEVELS, RANKS};
use crate::data::Draws;
use crate::diagnose::Diagnosis;
use crate::math::moments::{mean, quantile, sorted, variance};

/// A truth and the outcome of its calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// Number of the case, from 0.
    pub number: usize,
    /// Outcome.
    pub ended: Ended,
}

/// Outcome of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The calibration gave a posterior.
    Calibrated(Calibration),
    /// The calibration stopped, for this reason.
    Failed(String),
    /// No data could be generated at this truth, for this reason; the case says nothing about the intervals.
    NoData(String),
}

/// A calibration of data whose truth is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// True if the sampler converged, by the same rules as in `lacuna run`.
    pub converged: bool,
    /// Advice of the diagnostics, most important first.
    pub advice: Vec<String>,
    /// Comparison of each unknown with its truth.
    pub unknowns: Vec<Judged>,
}

/// Posterior of an unknown whose truth is known. All values are in the unit of the unknown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// True value.
    pub truth: f64,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// Rank of the truth: number of the [`RANKS`] thinned draws that lie below it.
    pub rank: usize,
    /// Effective sample size of the posterior, the smaller of bulk and tails.
    pub size: f64,
    /// Ends of the interval at each of [`LEVELS`].
    pub intervals: [[f64; 2]; 3],
    /// Fraction of draws near an edge of the prior.
    pub edge: f64,
    /// Fraction of draws that are near an edge and inside the interval, at each of [`LEVELS`].
    pub edge_inside: [f64; 3],
    /// Fraction of draws inside the interval, at each of [`LEVELS`].
    pub inside: [f64; 3],
}

impl Judged {
    /// For each of [`LEVELS`], true if the interval contains the truth.
    pub fn holds(&self) -> [bool; 3] {
        self.intervals.map(|[low, high]| low <= self.truth && self.truth <= high)
    }

    /// Returns true if the truth is near an edge of its prior.
    pub fn is_at_edge(&self, coordinate: &Coordinate) -> bool {
        let below = coordinate.prior.cdf(self.truth);
        !(EDGE..=1.0 - EDGE).contains(&below)
    }

    /// Probability, under the posterior, that the interval of level `k` contains a truth that is near an edge (or one
    /// that is not); `None` if no draw is in that region.
    pub fn expected(&self, k: usize, at_edge: bool) -> Option<f64> {
        let (inside, all) = if at_edge {
            (self.edge_inside[k], self.edge)
        } else {
            (self.inside[k] - self.edge_inside[k], 1.0 - self.edge)
        };
        (all > 0.0).then(|| (inside / all).clamp(0.0, 1.0))
    }

    /// Posterior mean less the truth, in posterior standard deviations.
    pub fn z(&self) -> f64 {
        (self.mean - self.truth) / self.sd
    }
}

/// Compares the draws after burn-in with the truth, one value per coordinate. The draws may have further coordinates
/// whose truths are not known.
pub fn judge(
    coordinates: &[Coordinate],
    truth: &[f64],
    draws: &Draws,
    diagnosis: &Diagnosis,
) -> Calibration {
    let thinned = thinned(draws, diagnosis);
    let one = |(j, (coordinate, &truth)): (usize, (&Coordinate, &f64))| {
        let pooled = draws.pooled(j);
        let ordered = sorted(&pooled);
        let ends =
            |level: f64| [0.5 - 0.5 * level, 0.5 + 0.5 * level].map(|p| quantile(&ordered, p));
        let intervals = LEVELS.map(ends);
        let edges = [EDGE, 1.0 - EDGE].map(|p| coordinate.prior.quantile(p));
        let share = |test: &dyn Fn(f64) -> bool| {
            pooled.iter().filter(|&&x| test(x)).count() as f64 / pooled.len() as f64
        };
        let at_edge = |x: f64| x < edges[0] || x > edges[1];
        let within = |[low, high]: [f64; 2], x: f64| low <= x && x <= high;
        let judged = &diagnosis.coordinates[j];
        Judged {
            truth,
            mean: mean(&pooled),
            sd: variance(&pooled).sqrt(),
            rank: thinned.iter().filter(|&&(c, s)| draws.point(c, s)[j] < truth).count(),
            // An effective size that could not be computed counts as zero.
            size: Some(judged.ess_bulk.min(judged.ess_tail))
                .filter(|s| s.is_finite())
                .unwrap_or(0.0),
            intervals,
            edge: share(&at_edge),
            edge_inside: intervals.map(|ends| share(&|x| at_edge(x) && within(ends, x))),
            inside: intervals.map(|ends| share(&|x| within(ends, x))),
        }
    };
    Calibration {
        converged: diagnosis.converged,
        advice: diagnosis.advice.clone(),
        unknowns: coordinates.iter().zip(truth).enumerate().map(one).collect(),
    }
}

/// [`RANKS`] nearly independent draws as `(chain, step)`: every chain is thinned by its autocorrelation time, and
/// evenly spaced draws are taken from those that are left. If too few are left, evenly spaced draws of all are taken.
fn thinned(draws: &Draws, diagnosis: &Diagnosis) -> Vec<(usize, usize)> {
    let times = diagnosis.coordinates.iter().map(|c| c.autocorrelation_time);
    let longest = times.filter(|t| t.is_finite()).fold(1.0, f64::max);
    let every = longest.ceil() as usize;
    let of_chain = |c: usize| (every..=draws.steps).step_by(every).map(move |s| (c, s - 1));
    let mut all: Vec<(usize, usize)> = (0..draws.chains).flat_map(of_chain).collect();
    if all.len() < RANKS {
        all = (0..draws.chains).flat_map(|c| (0..draws.steps).map(move |s| (c, s))).collect();
    }
    (0..RANKS).filter_map(|k| all.get((2 * k + 1) * all.len() / (2 * RANKS)).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Unit;
    use crate::math::distribution::Distribution;
    use crate::math::random::{Stream, uniform};
    use crate::matrix::Matrix;

    /// Independent draws from a uniform prior: a posterior without information. Its 95 % interval contains all of the
    /// middle and 75 % of the two tenths at the edges.
    #[test]
    fn at_an_edge_a_right_interval_holds_less_than_it_says() {
        let coordinate = Coordinate {
            name: "x".into(),
            unit: Unit::dimensionless(),
            prior: Distribution::Uniform([0.0, 2.0]),
            of_prior: true,
        };
        let mut rng = Stream::root(4).generator();
        let steps: Vec<_> = (0..5000)
            .map(|_| (Matrix::from_fn(4, 1, |_, _| 2.0 * uniform(&mut rng)), vec![0.0; 4]))
            .collect();
        let draws = Draws::from_steps(vec!["x".into()], &steps);
        let diagnosis = Diagnosis::of(&draws, false);
        let judged =
            judge(std::slice::from_ref(&coordinate), &[0.1], &draws, &diagnosis).unknowns.remove(0);
        assert!(judged.is_at_edge(&coordinate));
        // Four standard errors of a fraction among 20000 draws, a fifth of which are at the edges.
        let error = 4.0 * (0.75 * 0.25 / 4000.0_f64).sqrt();
        assert!((judged.expected(2, true).unwrap() - 0.75).abs() < error, "{judged:?}");
        assert!((judged.expected(2, false).unwrap() - 1.0).abs() < 1e-12);
        assert!((judged.expected(0, false).unwrap() - 0.625).abs() < error);
        // A truth at 5 % of the prior: its rank is binomial with mean about five.
        assert!(judged.rank <= 14, "{judged:?}");
        assert_eq!(judged.holds(), [false, true, true]);
    }
}
