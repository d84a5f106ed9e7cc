//! Integrated autocorrelation time of ensembles of walkers.

use crate::math::moments::{mean, variance};
use crate::matrix::vector::dot;

/// Integrated autocorrelation time in steps: the variance of a time average is as large as if only every `tau`-th step
/// had been drawn independently.
///
/// The autocorrelation function is averaged over the walkers, then summed over Sokal's window, up to the first lag
/// `m >= 5 tau(m)` (Sokal 1997, section 3.3; Foreman-Mackey et al. 2013). With fewer than about `50 tau` steps the
/// estimate is uncertain and usually too small. Walkers that never move are left out; NaN if none moves.
///
/// `walkers` holds the values of one coordinate, one vector of equal length per walker.
pub fn integrated_time(walkers: &[Vec<f64>]) -> f64 {
    const WINDOW: f64 = 5.0;
    let steps = walkers.first().map_or(0, Vec::len);
    let centred: Vec<Vec<f64>> = walkers
        .iter()
        .map(|w| {
            let centre = mean(w);
            w.iter().map(|x| x - centre).collect()
        })
        .collect();
    let lagged = |w: &[f64], lag: usize| dot(&w[..w.len() - lag], &w[lag..]);
    let moving: Vec<(&Vec<f64>, f64)> =
        centred.iter().map(|w| (w, lagged(w, 0))).filter(|(_, power)| *power > 0.0).collect();
    if moving.is_empty() {
        return f64::NAN;
    }
    let mut tau = 1.0;
    for lag in 1..steps {
        let sum: f64 = moving.iter().map(|(w, power)| lagged(w, lag) / power).sum();
        tau += 2.0 * sum / moving.len() as f64;
        // At larger lags the sum only accumulates noise: the window balances bias against variance.
        if lag as f64 >= WINDOW * tau {
            break;
        }
    }
    tau
}

/// Monte Carlo standard error of the mean over an ensemble of walkers, from the time series of the ensemble mean.
///
/// Walkers of one ensemble depend on each other, but the mean over all walkers at each step is one ordinary time
/// series, whose variance and autocorrelation time give the error (Goodman and Weare 2010, section 4). With fewer than
/// about twenty autocorrelation times the error is too small, by up to a factor of three.
pub fn ensemble_error(walkers: &[Vec<f64>]) -> f64 {
    let steps = walkers.first().map_or(0, Vec::len);
    if steps < 4 {
        return f64::NAN;
    }
    let at = |t: usize| mean(&walkers.iter().map(|walker| walker[t]).collect::<Vec<_>>());
    let series: Vec<f64> = (0..steps).map(at).collect();
    let spread = variance(&series);
    if spread == 0.0 {
        return 0.0;
    }
    (spread * integrated_time(&[series]) / steps as f64).sqrt()
}
