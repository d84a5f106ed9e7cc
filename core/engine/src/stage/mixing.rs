//! How chains mix, as curves: ranks of the draws of each chain among all draws, and autocorrelation.

use lacuna::data::Draws;
use lacuna::math::moments::mean;
use rayon::prelude::*;

/// Largest number of coordinates that are described.
pub const MOST_COORDINATES: usize = 16;

/// Largest number of chains that are described, besides stranded ones.
const MOST_CHAINS: usize = 24;

/// Number of places at which the distribution function of ranks is given, without its ends.
const PLACES: usize = 39;

/// Largest lag, in steps, and largest number of lags at which the autocorrelation is given.
const LARGEST_LAG: usize = 2000;
const LAGS: usize = 100;

/// How the chains of one coordinate mix.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixing {
    /// Described chains, counted from zero.
    pub chains: Vec<usize>,
    /// For each described chain, the distribution function of the fractional ranks of its draws among the draws of all
    /// chains, less that of uniform ranks: zero at 0 and 1, and near zero between if the chain is distributed as all are
    /// (Säilynoja, Bürkner and Vehtari, Statistics and Computing 32 (2022) 32). The places are equidistant from 0 to 1.
    pub ranks: Vec<Vec<f64>>,
    /// Lag in steps and autocorrelation there, averaged over the described chains that move.
    pub autocorrelation: Vec<(usize, f64)>,
}

/// Describes the first coordinates from the draws after the burn-in; `times` holds their integrated autocorrelation times.
pub fn mixing(kept: &Draws, stranded: &[usize], times: &[f64]) -> Vec<Mixing> {
    let stride = kept.chains.div_ceil(MOST_CHAINS).max(1);
    let is_described = |c: &usize| c.is_multiple_of(stride) || stranded.contains(c);
    let chains: Vec<usize> = (0..kept.chains).filter(is_described).collect();
    let count = kept.dimension().min(MOST_COORDINATES);
    let one = |j: usize| {
        let pooled = kept.pooled(j);
        let values: Vec<&[f64]> = pooled.chunks(kept.steps.max(1)).collect();
        let ranks = fractional_ranks(&pooled);
        let of_chain: Vec<&[f64]> = ranks.chunks(kept.steps.max(1)).collect();
        let described: Vec<&[f64]> =
            chains.iter().filter_map(|&c| values.get(c).copied()).collect();
        Mixing {
            ranks: chains.iter().filter_map(|&c| Some(difference(of_chain.get(c)?))).collect(),
            autocorrelation: autocorrelation(&described, times.get(j).copied().unwrap_or(f64::NAN)),
            chains: chains.clone(),
        }
    };
    if kept.is_empty() { Vec::new() } else { (0..count).into_par_iter().map(one).collect() }
}

/// Rank of each value as a share between 0 and 1; equal values have their middle rank.
fn fractional_ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    while first < order.len() {
        let same =
            order[first..].iter().take_while(|&&i| values[i] == values[order[first]]).count();
        let same = same.max(1);
        let middle = first as f64 + 0.5 * same as f64;
        for &i in &order[first..first + same] {
            ranks[i] = middle / values.len() as f64;
        }
        first += same;
    }
    ranks
}

/// Distribution function of the ranks less the uniform one, at equidistant places from 0 to 1.
fn difference(ranks: &[f64]) -> Vec<f64> {
    let mut sorted = ranks.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |k: usize| {
        let place = k as f64 / (PLACES + 1) as f64;
        let below = sorted.partition_point(|&rank| rank <= place);
        below as f64 / sorted.len().max(1) as f64 - place
    };
    (0..=PLACES + 1).map(at).collect()
}

/// Autocorrelation averaged over the chains that move, up to ten autocorrelation times.
fn autocorrelation(chains: &[&[f64]], time: f64) -> Vec<(usize, f64)> {
    let steps = chains.first().map_or(0, |chain| chain.len());
    let wanted = if time.is_finite() { (10.0 * time).ceil() as usize } else { LAGS };
    let largest = wanted.clamp(20, LARGEST_LAG).min(steps / 2);
    let centred: Vec<Vec<f64>> = chains
        .iter()
        .map(|chain| {
            let centre = mean(chain);
            chain.iter().map(|x| x - centre).collect()
        })
        .collect();
    let lagged = |chain: &[f64], lag: usize| -> f64 {
        chain.iter().zip(&chain[lag..]).map(|(a, b)| a * b).sum()
    };
    let moving: Vec<(&Vec<f64>, f64)> =
        centred.iter().map(|c| (c, lagged(c, 0))).filter(|(_, power)| *power > 0.0).collect();
    if moving.is_empty() {
        return Vec::new();
    }
    let stride = largest.div_ceil(LAGS).max(1);
    let at = |lag: usize| {
        let sum: f64 = moving.iter().map(|(c, power)| lagged(c, lag) / power).sum();
        (lag, sum / moving.len() as f64)
    };
    (0..=largest).step_by(stride).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::{Stream, normal};

    /// The autocorrelation of an autoregressive process of order one is `a^lag`; its standard error at lag k is below
    /// `sqrt((1 + a^2) / (1 - a^2) / n)` (Bartlett 1946), here with n steps in each of 20 chains.
    #[test]
    fn the_autocorrelation_of_an_autoregressive_process_is_a_power() {
        let (a, steps) = (0.8_f64, 5000);
        let chains: Vec<Vec<f64>> = (0..20)
            .map(|c| {
                let mut rng = Stream::root(11).at(c).generator();
                let mut x = normal(&mut rng) / (1.0 - a * a).sqrt();
                (0..steps)
                    .map(|_| {
                        x = a * x + normal(&mut rng);
                        x
                    })
                    .collect()
            })
            .collect();
        let chains: Vec<&[f64]> = chains.iter().map(Vec::as_slice).collect();
        let found = autocorrelation(&chains, (1.0 + a) / (1.0 - a));
        let error = ((1.0 + a * a) / (1.0 - a * a) / (20.0 * f64::from(steps))).sqrt();
        assert_eq!(found[0], (0, 1.0));
        for (lag, value) in found {
            assert!((value - a.powi(lag as i32)).abs() < 4.0 * error + 1e-3, "{lag}: {value}");
        }
    }

    /// Of four equal chains each has uniform ranks; a chain that lies above all others has ranks in the last quarter.
    #[test]
    fn a_chain_apart_stands_out_by_its_ranks() {
        let chain = |shift: f64| (0..1000).map(move |i| f64::from(i) + shift);
        let values: Vec<f64> = [0.0, 0.2, 0.4, 0.6].into_iter().flat_map(chain).collect();
        let ranks = fractional_ranks(&values);
        let largest =
            |ranks: &[f64]| difference(ranks).into_iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        assert!(largest(&ranks[..1000]) < 2e-3);
        let values: Vec<f64> = [0.0, 0.2, 0.4, 5000.0].into_iter().flat_map(chain).collect();
        let apart = difference(&fractional_ranks(&values)[3000..]);
        assert!((apart[30] + 0.75).abs() < 1e-9, "{apart:?}");
        assert!(apart[0].abs() < 1e-12 && apart[40].abs() < 1e-12);
    }

    #[test]
    fn equal_values_share_their_rank() {
        assert_eq!(fractional_ranks(&[2.0, 1.0, 2.0, 3.0]), [0.5, 0.125, 0.5, 0.875]);
        assert!(autocorrelation(&[&[1.0, 1.0, 1.0, 1.0]], 1.0).is_empty());
    }
}
