//! Convergence of chains: rank-normalised split R-hat, effective sample sizes and Monte Carlo standard errors of
//! Vehtari, Gelman, Simpson, Carpenter and Bürkner (2021), "Rank-normalization, folding, and localization: an improved
//! R-hat for assessing convergence of MCMC", Bayesian Analysis 16(2).
//!
//! Every function takes one coordinate as one vector per chain, all of the same length, and returns NaN for fewer than
//! four draws per chain or values that are not finite.

use crate::math::distribution::Distribution;
use crate::math::moments::{mean, quantile, sorted, variance};
use crate::math::special::normal_quantile;

/// Values of one coordinate, one vector per chain.
pub type Chains = [Vec<f64>];

/// Potential scale reduction R-hat: the larger of the rank-normalised split R-hat and its folded form.
///
/// One means that the chains agree in location and in scale. NaN for a single chain.
pub fn r_hat(chains: &Chains) -> f64 {
    if !usable(chains) || chains.len() < 2 {
        return f64::NAN;
    }
    let halves = split(chains);
    let median = quantile(&sorted(&halves.concat()), 0.5);
    let folded: Vec<Vec<f64>> =
        halves.iter().map(|c| c.iter().map(|x| (x - median).abs()).collect()).collect();
    plain_r_hat(&rank_normalised(&halves)).max(plain_r_hat(&rank_normalised(&folded)))
}

/// Effective sample size of the bulk: that of the rank-normalised values.
pub fn ess_bulk(chains: &Chains) -> f64 {
    if usable(chains) { ess(&rank_normalised(&split(chains))) } else { f64::NAN }
}

/// Effective sample size of the tails: the smaller of those of the 5 % and 95 % quantiles.
pub fn ess_tail(chains: &Chains) -> f64 {
    ess_quantile(chains, 0.05).min(ess_quantile(chains, 0.95))
}

/// Effective sample size of the mean.
pub fn ess_mean(chains: &Chains) -> f64 {
    if usable(chains) { ess(&split(chains)) } else { f64::NAN }
}

/// Effective sample size of the quantile with probability `p`.
pub fn ess_quantile(chains: &Chains, p: f64) -> f64 {
    if !usable(chains) {
        return f64::NAN;
    }
    let bound = quantile(&sorted(&chains.concat()), p);
    let below: Vec<Vec<f64>> = chains
        .iter()
        .map(|c| c.iter().map(|&x| f64::from(u8::from(x <= bound))).collect())
        .collect();
    ess(&split(&below))
}

/// Monte Carlo standard error of the mean.
pub fn mcse_mean(chains: &Chains) -> f64 {
    if usable(chains) { (variance(&chains.concat()) / ess_mean(chains)).sqrt() } else { f64::NAN }
}

/// Monte Carlo standard error of the standard deviation.
pub fn mcse_sd(chains: &Chains) -> f64 {
    if !usable(chains) {
        return f64::NAN;
    }
    let centre = mean(&chains.concat());
    let squares: Vec<Vec<f64>> =
        chains.iter().map(|c| c.iter().map(|x| (x - centre).powi(2)).collect()).collect();
    let pooled = squares.concat();
    let second = mean(&pooled);
    let fourth = pooled.iter().map(|x| x * x).sum::<f64>() / pooled.len() as f64;
    // Delta method: var(sqrt(v)) = var(v) / (4 v).
    ((fourth - second * second) / ess(&split(&squares)) / second / 4.0).sqrt()
}

/// Monte Carlo standard error of the quantile with probability `p`: half the distance between the order statistics one
/// standard deviation apart in the beta law of the effective sample size.
pub fn mcse_quantile(chains: &Chains, p: f64) -> f64 {
    let size = ess_quantile(chains, p);
    if size.is_nan() {
        return f64::NAN;
    }
    let law = Distribution::Beta([size * p + 1.0, size * (1.0 - p) + 1.0, 0.0, 1.0]);
    let ordered = sorted(&chains.concat());
    let last = ordered.len() as f64 - 1.0;
    let place = |q: f64| law.quantile(q) * ordered.len() as f64 - 1.0;
    let low = place(0.158_655_3).floor().max(0.0) as usize;
    let high = place(0.841_344_7).ceil().min(last) as usize;
    0.5 * (ordered[high] - ordered[low])
}

fn usable(chains: &Chains) -> bool {
    let steps = chains.first().map_or(0, Vec::len);
    steps >= 4 && chains.iter().all(|c| c.len() == steps && c.iter().all(|x| x.is_finite()))
}

/// Splits each chain into halves; the middle draw of an odd number is dropped.
fn split(chains: &Chains) -> Vec<Vec<f64>> {
    let half = chains[0].len() / 2;
    let first = chains.iter().map(|c| c[..half].to_vec());
    first.chain(chains.iter().map(|c| c[c.len() - half..].to_vec())).collect()
}

/// Normal scores of the ranks of all values pooled; ties share their mean rank (Blom's offset 3/8).
fn rank_normalised(chains: &Chains) -> Vec<Vec<f64>> {
    let steps = chains[0].len();
    let values = chains.concat();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut scores = vec![0.0; values.len()];
    let mut from = 0;
    while from < order.len() {
        let value = values[order[from]];
        let to = from + order[from..].iter().take_while(|&&i| values[i] == value).count();
        let rank = 0.5 * (from + 1 + to) as f64;
        let score = normal_quantile((rank - 0.375) / (values.len() as f64 + 0.25));
        order[from..to].iter().for_each(|&i| scores[i] = score);
        from = to;
    }
    scores.chunks(steps).map(<[f64]>::to_vec).collect()
}

/// Square root of the ratio of pooled to within-chain variance.
fn plain_r_hat(chains: &Chains) -> f64 {
    let steps = chains[0].len() as f64;
    let means: Vec<f64> = chains.iter().map(|c| mean(c)).collect();
    let within = mean(&chains.iter().map(|c| variance(c)).collect::<Vec<_>>());
    let between = steps * variance(&means);
    if within == 0.0 {
        // Chains that never move: equal ones agree trivially, different ones cannot be reconciled by more steps.
        return if between == 0.0 { 1.0 } else { f64::INFINITY };
    }
    ((between / within + steps - 1.0) / steps).sqrt()
}

/// Effective sample size from autocorrelations pooled over chains, truncated by Geyer's initial monotone sequence
/// (section 3.2 of the paper).
fn ess(chains: &Chains) -> f64 {
    let (count, steps) = (chains.len() as f64, chains[0].len());
    let total = count * steps as f64;
    let first = chains[0][0];
    if chains.iter().flatten().all(|&x| x == first) {
        return total;
    }
    let means: Vec<f64> = chains.iter().map(|c| mean(c)).collect();
    let covariance = |lag: usize| {
        let sum: f64 = chains
            .iter()
            .zip(&means)
            .map(|(c, m)| c.iter().zip(&c[lag..]).map(|(a, b)| (a - m) * (b - m)).sum::<f64>())
            .sum();
        sum / total
    };
    let n = steps as f64;
    let within = covariance(0) * n / (n - 1.0);
    let between = if chains.len() > 1 { variance(&means) } else { 0.0 };
    let pooled = within * (n - 1.0) / n + between;
    let correlation = |lag: usize| 1.0 - (within - covariance(lag)) / pooled;

    // For a reversible chain the sums of neighbouring pairs are positive and decrease.
    let mut pairs = vec![1.0 + correlation(1)];
    let mut last_even = 1.0;
    let mut lag = 2;
    while lag < steps - 2 && pairs[pairs.len() - 1] > 0.0 {
        last_even = correlation(lag);
        pairs.push(last_even + correlation(lag + 1));
        lag += 2;
    }
    // The last pair is not summed; its even lag is added if positive, which stabilises the estimate for antithetic
    // chains.
    pairs.pop();
    let mut falling = f64::INFINITY;
    let sum: f64 = pairs
        .iter()
        .map(|&pair| {
            falling = pair.min(falling);
            falling
        })
        .sum();
    let tau = -1.0 + 2.0 * sum + last_even.max(0.0);
    // The bound limits the effective size of antithetic chains to `total log10(total)`, as in the paper's software.
    total / tau.max(1.0 / total.log10())
}
