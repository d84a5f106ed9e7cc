//! Draws of the mixture of all paths' laws, weighed by importance.

use lacuna::diagnose::pareto::{self, LARGEST_K, Smoothed};
use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, normal, permutation, uniform};
use lacuna::math::special::ln_sum_exp;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::sampler::{Evidence, Harvest};
use lacuna::plugin::{Fact, Target};
use lacuna::run::Stop;
use rand::Rng;

use super::law::Law;
use super::{Fit, Path, Stage, Variational};

/// The share of the mixture that goes to all laws alike, however low their bounds.
const DEFENCE: f64 = 0.1;
/// Bounds that differ by more than this belong to different laws.
const DIFFERENT: f64 = 1.0;

pub(super) fn harvest(
    options: &Variational,
    target: &dyn Target,
    paths: &[Path],
    stream: &Stream,
) -> Result<Harvest, Stop> {
    let fits: Vec<&Fit> = paths.iter().filter_map(|path| path.best.as_ref()).collect();
    if fits.is_empty() {
        return Err(Stop::new("no path has a normal law yet").help("raise `iterations`"));
    }
    let free = Unconstrained::new(target);
    let mixture = Mixture::of(&fits);
    let mut rng = stream.generator();
    // Twice as many as are wanted, so that few of them are drawn twice.
    let proposals = mixture.draws(2 * options.draws, &mut rng);
    let density = free.log_density(&proposals);
    let ratios: Vec<f64> = density
        .iter()
        .zip(proposals.iter_rows())
        .map(|(p, u)| p - mixture.log_density(u))
        .collect();
    let smoothed = pareto::smooth(&ratios);
    let chosen = if options.importance && smoothed.effective_size > 0.0 {
        resample(&smoothed.log_weights, options.draws, &mut rng)
    } else {
        (0..options.draws).collect()
    };
    let order = permutation(&mut rng, chosen.len());
    let points = Matrix::from_rows(
        target.dimension(),
        order.iter().map(|&i| free.bounded(proposals.row(chosen[i]))),
    );
    Ok(Harvest {
        log_density: target.log_density(&points),
        points,
        effective_size: worth(&smoothed, options.draws),
        evidence: (smoothed.k_hat <= LARGEST_K).then(|| evidence(&ratios)),
        doubts: doubts(options, paths, &fits, &smoothed),
        facts: facts(&fits, &smoothed),
    })
}

/// Normal laws with weights.
struct Mixture<'a> {
    laws: Vec<(f64, &'a Law)>,
}

impl<'a> Mixture<'a> {
    /// Each law by the evidence that its bound promises, and none below a small share.
    fn of(fits: &[&'a Fit]) -> Self {
        let largest = fits.iter().map(|fit| fit.bound).fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = fits.iter().map(|fit| (fit.bound - largest).exp()).collect();
        let (total, even) = (shares.iter().sum::<f64>(), DEFENCE / fits.len() as f64);
        let weight = |share: f64| (1.0 - DEFENCE) * share / total + even;
        Self { laws: shares.iter().zip(fits).map(|(&s, fit)| (weight(s), &fit.law)).collect() }
    }

    fn draws(&self, count: usize, rng: &mut impl Rng) -> Matrix {
        let dimension = self.laws[0].1.mean.len();
        let draw = |_| {
            let mut left = uniform(rng);
            let law = self.laws.iter().find(|(weight, _)| {
                left -= weight;
                left <= 0.0
            });
            let (_, law) = law.unwrap_or(&self.laws[0]);
            let z: Vec<f64> = (0..dimension).map(|_| normal(rng)).collect();
            law.point(&z)
        };
        Matrix::from_rows(dimension, (0..count).map(draw))
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        let terms = self.laws.iter().map(|(weight, law)| weight.ln() + law.log_density(point));
        terms.fold(f64::NEG_INFINITY, ln_sum_exp)
    }
}

/// Indices drawn by weights that sum to one, evenly spaced along them (systematic resampling).
fn resample(log_weights: &[f64], count: usize, rng: &mut impl Rng) -> Vec<usize> {
    let offset = uniform(rng);
    let (mut sum, mut index) = (log_weights[0].exp(), 0);
    (0..count)
        .map(|i| {
            let place = (i as f64 + offset) / count as f64;
            while sum < place && index + 1 < log_weights.len() {
                index += 1;
                sum += log_weights[index].exp();
            }
            index
        })
        .collect()
}

/// The number of independent draws: the error of the weights and that of drawing among them.
fn worth(smoothed: &Smoothed, draws: usize) -> f64 {
    let (drawn, weighed) = (draws as f64, smoothed.log_weights.len() as f64);
    let error = 1.0 / smoothed.effective_size.max(1.0) + 1.0 / drawn - 1.0 / weighed;
    (1.0 / error).min(drawn)
}

/// The mean of the raw ratios, whose error follows from their spread.
fn evidence(log_ratios: &[f64]) -> Evidence {
    let count = log_ratios.len() as f64;
    let largest = log_ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let ratios: Vec<f64> = log_ratios.iter().map(|l| (l - largest).exp()).collect();
    let mean = ratios.iter().sum::<f64>() / count;
    let spread = ratios.iter().map(|r| (r / mean - 1.0).powi(2)).sum::<f64>() / count;
    Evidence {
        log: largest + mean.ln(),
        error: (spread / count).sqrt(),
        method: format!("importance sampling from the variational law, {count} draws"),
    }
}

fn doubts(
    options: &Variational,
    paths: &[Path],
    fits: &[&Fit],
    smoothed: &Smoothed,
) -> Vec<String> {
    let mut doubts = Vec::new();
    if smoothed.k_hat > LARGEST_K {
        doubts.push(format!(
            "the Pareto k-hat is {:.2}, above {LARGEST_K}: no normal law is near the posterior, and weights \
             do not make up for it; use `no_u_turn` or `sequential_monte_carlo`",
            smoothed.k_hat
        ));
    }
    let late = paths.iter().filter(|path| path.stage != Stage::Done).count();
    if late > 0 {
        doubts.push(format!(
            "{late} of {} paths have not ended: raise `iterations` above {}",
            paths.len(),
            options.iterations
        ));
    }
    let largest = fits.iter().map(|fit| fit.bound).fold(f64::NEG_INFINITY, f64::max);
    let others = fits.iter().filter(|fit| fit.bound < largest - DIFFERENT).count();
    if others > 0 {
        doubts.push(format!(
            "{others} of {} paths ended at another normal law: the posterior may have several maxima; \
             compare with `sequential_monte_carlo`",
            paths.len()
        ));
    }
    doubts
}

fn facts(fits: &[&Fit], smoothed: &Smoothed) -> Vec<Fact> {
    let largest = fits.iter().map(|fit| fit.bound).fold(f64::NEG_INFINITY, f64::max);
    vec![
        Fact::new("Pareto k-hat", format!("{:.2}", smoothed.k_hat)),
        Fact::new("evidence lower bound", format!("{largest:.3}")),
        Fact::new("effective draws by importance", format!("{:.0}", smoothed.effective_size)),
    ]
}
