//! Draws from the mixture of the approximations of all paths, weighted by importance.

use lacuna::diagnose::pareto::{self, Smoothed};
use lacuna::math::random::{Stream, normal, permutation, uniform};
use lacuna::math::special::ln_sum_exp;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::sampler::{Evidence, Harvest};
use lacuna::plugin::{Fact, Target};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use rand::Rng;

use super::law::{self, Law};
use super::{Fit, Path, Stage, Variational};

/// Fraction of the mixture that is distributed equally over all paths, however low their bounds.
const EVEN: f64 = 0.1;
/// Tails that are tried in turn: normal, then Student's t with fewer and fewer degrees of freedom. The density of a
/// log variance decreases only exponentially on one side, where a normal proposal would give weights without a finite
/// mean.
const TAILS: [Option<u32>; 4] = [None, Some(8), Some(4), Some(2)];
/// Difference of evidence lower bounds above which paths are taken to have found different maxima.
const DIFFERENT: f64 = 1.0;

pub(super) fn harvest(
    options: &Variational,
    target: &dyn Target,
    paths: &[Path],
    stream: &Stream,
) -> Result<Harvest, Stop> {
    let fits: Vec<&Fit> = paths.iter().filter_map(|path| path.best.as_ref()).collect();
    if fits.is_empty() {
        return Err(Stop::new("no path has a normal approximation yet").help("raise `iterations`"));
    }
    let free = Unconstrained::new(target);
    let tails = if options.importance { &TAILS[..] } else { &TAILS[..1] };
    // Twice as many proposals as draws, so that few of them are drawn twice.
    let count = 2 * options.draws;
    let limit = pareto::limit(count);
    let mut weighed = Weighed::of(&free, Mixture::of(&fits, None), count, &stream.named("normal"));
    for &tail in &tails[1..] {
        if weighed.smoothed.k_hat <= limit {
            break;
        }
        let stream = stream.named("heavy").at(u64::from(tail.unwrap_or(0)));
        let other = Weighed::of(&free, Mixture::of(&fits, tail), count, &stream);
        if other.smoothed.k_hat < weighed.smoothed.k_hat {
            weighed = other;
        }
    }
    let Weighed { tail, proposals, ratios, smoothed } = weighed;
    let mut rng = stream.named("draw").generator();
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
        evidence: (smoothed.k_hat <= limit).then(|| evidence(&ratios)),
        doubts: doubts(options, paths, &fits, &smoothed),
        facts: facts(&fits, &smoothed, tail),
    })
}

/// Independent draws of a mixture, with the log ratios of the posterior to it.
struct Weighed {
    tail: Option<u32>,
    proposals: Matrix,
    ratios: Vec<f64>,
    smoothed: Smoothed,
}

impl Weighed {
    fn of(target: &Unconstrained<'_>, mixture: Mixture<'_>, count: usize, stream: &Stream) -> Self {
        let proposals = mixture.draws(count, &mut stream.generator());
        let density = target.log_density(&proposals);
        let pairs = density.iter().zip(proposals.iter_rows());
        let ratios: Vec<f64> = pairs.map(|(p, u)| p - mixture.log_density(u)).collect();
        let smoothed = pareto::smooth(&ratios);
        Self { tail: mixture.tail, proposals, ratios, smoothed }
    }
}

/// A mixture of normal or Student's t distributions.
struct Mixture<'a> {
    laws: Vec<(f64, &'a Law)>,
    /// Degrees of freedom of Student's t distribution; `None` for the normal distribution.
    tail: Option<u32>,
}

impl<'a> Mixture<'a> {
    /// Weights each component by the exponential of its evidence lower bound, but no component below a small minimum.
    fn of(fits: &[&'a Fit], tail: Option<u32>) -> Self {
        let largest = fits.iter().map(|fit| fit.bound).fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = fits.iter().map(|fit| (fit.bound - largest).exp()).collect();
        let (total, even) = (shares.iter().sum::<f64>(), EVEN / fits.len() as f64);
        let weight = |share: f64| (1.0 - EVEN) * share / total + even;
        let laws = shares.iter().zip(fits).map(|(&s, fit)| (weight(s), &fit.law)).collect();
        Self { laws, tail }
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
            let stretch = self.tail.map_or(1.0, |freedom| law::stretch(freedom, rng));
            let z: Vec<f64> = (0..dimension).map(|_| stretch * normal(rng)).collect();
            law.point(&z)
        };
        Matrix::from_rows(dimension, (0..count).map(draw))
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        let terms = self.laws.iter().map(|(weight, law)| {
            let z = law.whitened(point);
            let density = match self.tail {
                None => law.log_density_of(&z),
                Some(freedom) => law.log_student_density_of(freedom, &z),
            };
            weight.ln() + density
        });
        terms.fold(f64::NEG_INFINITY, ln_sum_exp)
    }
}

/// Draws indices in proportion to weights that sum to 1, by systematic resampling.
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

/// Returns the effective number of independent draws, from the error of the weights and that of resampling.
fn worth(smoothed: &Smoothed, draws: usize) -> f64 {
    let (drawn, weighed) = (draws as f64, smoothed.log_weights.len() as f64);
    let error = 1.0 / smoothed.effective_size.max(1.0) + 1.0 / drawn - 1.0 / weighed;
    (1.0 / error).min(drawn)
}

/// Estimates the evidence by the mean of the raw ratios, and its standard error from their spread.
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
    let limit = pareto::limit(smoothed.log_weights.len());
    if smoothed.k_hat > limit {
        doubts.push(format!(
            "the Pareto k-hat is {:.2}, above {}: no normal distribution is close enough to the posterior for \
             importance weights to correct the difference; use `no_u_turn` or `sequential_monte_carlo`",
            smoothed.k_hat,
            (100.0 * limit).round() / 100.0
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
            "{others} of {} paths ended at another normal distribution: the posterior may have several maxima; \
             compare with `sequential_monte_carlo`",
            paths.len()
        ));
    }
    doubts
}

fn facts(fits: &[&Fit], smoothed: &Smoothed, tail: Option<u32>) -> Vec<Fact> {
    let largest = fits.iter().map(|fit| fit.bound).fold(f64::NEG_INFINITY, f64::max);
    let tails = match tail {
        None => "normal".to_owned(),
        Some(freedom) => format!("Student's with {freedom} degrees of freedom"),
    };
    vec![
        Fact::new("Pareto k-hat", format!("{:.2}", smoothed.k_hat)),
        Fact::new("tails of the law", tails),
        Fact::new("evidence lower bound", format!("{largest:.3}")),
        Fact::new("effective draws by importance", format!("{:.0}", smoothed.effective_size)),
    ]
}
