//! A distribution from draws.

use super::Distribution;
use crate::math::moments::{quantile, sorted};
use crate::math::special::{normal_cdf, normal_quantile};

/// Independent draws beyond the outermost quantiles: fewer would not fix the slope of the tails.
const BEYOND: f64 = 10.0;
/// Largest score of the outermost quantiles.
const REACH: f64 = 3.0;
/// Distance of the scores of neighbouring quantiles with many draws and with few, and what is many.
const STEPS: [f64; 2] = [0.25, 0.5];
const MANY: f64 = 2000.0;

impl Distribution {
    /// The distribution by quantiles of draws with this support that are worth `effective` independent ones; `None` for draws
    /// that are too few or too often equal.
    ///
    /// The relative error of the density between two quantiles is about one over the root of the number of independent draws
    /// between them.
    pub fn of_draws(values: &[f64], support: (f64, f64), effective: f64) -> Option<Self> {
        let step = STEPS[usize::from(effective < MANY)];
        let reach = -normal_quantile((BEYOND / effective).clamp(1e-300, 0.5));
        let each_side = (reach.min(REACH) / step).floor();
        if each_side < 2.0 {
            return None;
        }
        let sorted = sorted(values);
        let count = each_side as i32;
        let score = |k: i32| f64::from(k) * step;
        let mut numbers = vec![support.0, support.1, each_side * step];
        numbers.extend((-count..=count).map(|k| quantile(&sorted, normal_cdf(score(k)))));
        let law = Self::Quantiles(numbers);
        law.check().is_ok().then_some(law)
    }
}
