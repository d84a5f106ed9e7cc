//! Pareto-smoothed importance weights and their diagnostic `k_hat`.
//!
//! Vehtari, Simpson, Gelman, Yao and Gabry, J. Mach. Learn. Res. 25 (2024) 72; the fit of the generalised Pareto law is
//! that of Zhang and Stephens, Technometrics 51 (2009) 316. With `k_hat` above 0.7 no practical number of draws
//! suffices to estimate a mean; with few draws the threshold is the lower one of [`limit`].

/// Smoothed importance weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothed {
    /// Logarithm of each weight; the weights sum to one.
    pub log_weights: Vec<f64>,
    /// Shape of the generalised Pareto law of the largest weights. Below 0.5 the weights have finite variance, up to
    /// 0.7 they are usable, above that they are not. Infinite if there are too few weights to fit the law.
    pub k_hat: f64,
    /// Effective sample size of the weighted draws, `1 / sum w^2`.
    pub effective_size: f64,
}

/// Largest `k_hat` with which importance sampling is reliable, for any number of draws.
pub const LARGEST_K: f64 = 0.7;

/// Largest `k_hat` with which this number of draws is sufficient: `min(1 - 1 / log10 S, 0.7)` (Vehtari et al. 2024,
/// section 3.2.4), which is 0.7 for 2200 draws and more.
pub fn limit(draws: usize) -> f64 {
    (1.0 - 1.0 / (draws.max(2) as f64).log10()).min(LARGEST_K)
}

/// Smallest number of values to which a law is fitted.
const FEWEST: usize = 5;

/// Spread of log ratios that rounding alone can produce.
const ROUNDING: f64 = 1e-10;

/// Smooths the importance ratios of independent draws, given as logarithms up to a common constant.
///
/// Minus infinity is the ratio of a draw without weight. If all ratios are equal there is no tail, and `k_hat` is zero.
/// If a ratio is NaN or plus infinity, or none has weight, the weights are equal, `k_hat` is infinite.
pub fn smooth(log_ratios: &[f64]) -> Smoothed {
    smooth_dependent(log_ratios, 1.0)
}

/// Like [`smooth`], but for dependent draws: `efficiency` is the ratio of independent to actual draws, and the tail is
/// taken longer to compensate (section 6 of Vehtari, Gelman and Gabry 2017).
pub fn smooth_dependent(log_ratios: &[f64], efficiency: f64) -> Smoothed {
    let count = log_ratios.len();
    let largest = log_ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() || log_ratios.iter().any(|l| l.is_nan()) {
        let log_weights = vec![-(count as f64).ln(); count];
        return Smoothed { log_weights, k_hat: f64::INFINITY, effective_size: 0.0 };
    }
    let mut logs: Vec<f64> = log_ratios.iter().map(|l| l - largest).collect();
    let k_hat =
        if logs.iter().all(|l| *l > -ROUNDING) { 0.0 } else { smooth_tail(&mut logs, efficiency) };
    let total = logs.iter().map(|l| l.exp()).sum::<f64>().ln();
    for log in &mut logs {
        *log -= total;
    }
    let squares: f64 = logs.iter().map(|l| (2.0 * l).exp()).sum();
    Smoothed { log_weights: logs, k_hat, effective_size: 1.0 / squares }
}

/// Replaces the largest of logarithms whose maximum is zero by quantiles of the law fitted to them, and returns its
/// shape.
fn smooth_tail(logs: &mut [f64], efficiency: f64) -> f64 {
    let count = logs.len();
    let mut order: Vec<usize> = (0..count).collect();
    // Ties are ordered by index, so that the result does not depend on the sorting algorithm.
    order.sort_by(|&a, &b| logs[a].total_cmp(&logs[b]).then(a.cmp(&b)));
    let independent = count as f64 / efficiency;
    // Length of the tail of Vehtari et al.: `min(S / 5, 3 sqrt(S / efficiency))`.
    let tail = (count as f64 / 5.0).min(3.0 * independent.sqrt()).ceil() as usize;
    if tail >= count {
        return f64::INFINITY;
    }
    // Clamping at the smallest normal number keeps the logarithm of the threshold finite.
    let threshold = logs[order[count - tail - 1]].max(f64::MIN_POSITIVE.ln());
    let above: Vec<usize> = order.into_iter().filter(|&i| logs[i] > threshold).collect();
    if above.len() < FEWEST {
        return f64::INFINITY;
    }
    let base = threshold.exp();
    let excess: Vec<f64> = above.iter().map(|&i| logs[i].exp() - base).collect();
    let Some(law) = GeneralisedPareto::fit(&excess) else { return f64::INFINITY };
    for (rank, &i) in above.iter().enumerate() {
        let p = (rank as f64 + 0.5) / above.len() as f64;
        // A smoothed weight never exceeds the largest raw one.
        logs[i] = (law.quantile(p) + base).ln().min(0.0);
    }
    law.shape
}

/// Generalised Pareto law with density `(1 + k x / s)^(-1/k - 1) / s` of excesses `x` over a threshold.
struct GeneralisedPareto {
    shape: f64,
    scale: f64,
}

impl GeneralisedPareto {
    /// Fits positive values in ascending order by the method of Zhang and Stephens, with the weak prior on the shape of
    /// Vehtari et al. (appendix G); `None` if the values have no spread.
    fn fit(sorted: &[f64]) -> Option<Self> {
        /// Weight of the prior, in number of values, and its centre.
        const PRIOR: (f64, f64) = (10.0, 0.5);
        let n = sorted.len() as f64;
        let quartile = sorted[(n / 4.0 + 0.5) as usize - 1];
        let largest = sorted[sorted.len() - 1];
        if !(quartile > 0.0 && largest.is_finite()) {
            return None;
        }
        let nodes = 30 + n.sqrt() as usize;
        let shape = |b: f64| sorted.iter().map(|x| (-b * x).ln_1p()).sum::<f64>() / n;
        let candidates: Vec<f64> = (1..=nodes)
            .map(|j| {
                let root = (nodes as f64 / (j as f64 - 0.5)).sqrt();
                1.0 / largest + (1.0 - root) / (3.0 * quartile)
            })
            .collect();
        let profile: Vec<f64> = candidates
            .iter()
            .map(|&b| {
                let k = shape(b);
                n * ((-b / k).ln() - k - 1.0)
            })
            .collect();
        // Normalised likelihood weights in a form that cannot overflow: only differences of log-likelihoods are
        // exponentiated.
        let weights =
            profile.iter().map(|l| 1.0 / profile.iter().map(|m| (m - l).exp()).sum::<f64>());
        let kept: Vec<(f64, f64)> = candidates
            .iter()
            .copied()
            .zip(weights)
            .filter(|(_, w)| *w >= 10.0 * f64::EPSILON)
            .collect();
        let total: f64 = kept.iter().map(|(_, w)| w).sum();
        let b = kept.iter().map(|(b, w)| b * w).sum::<f64>() / total;
        let k = shape(b);
        let (weight, centre) = PRIOR;
        let law = Self { shape: (n * k + weight * centre) / (n + weight), scale: -k / b };
        (law.shape.is_finite() && law.scale > 0.0).then_some(law)
    }

    fn quantile(&self, p: f64) -> f64 {
        let exponential = -(-p).ln_1p();
        if self.shape.abs() < f64::EPSILON {
            // Limit of shape zero, the exponential law.
            self.scale * exponential
        } else {
            self.scale * (self.shape * exponential).exp_m1() / self.shape
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Log ratios whose tail is a Pareto law of shape `k`: its exact quantiles in mixed order.
    fn pareto(count: usize, k: f64) -> Vec<f64> {
        let p = |i: usize| ((i * 73 % count) as f64 + 0.5) / count as f64;
        (0..count).map(|i| -k * p(i).ln()).collect()
    }

    /// Log ratios that are bounded above, with nonzero density at the bound.
    fn wave(count: usize, height: f64) -> Vec<f64> {
        (0..count).map(|i| height * ((i * i) as f64).sin()).collect()
    }

    #[test]
    #[allow(clippy::unreadable_literal)]
    fn shapes_and_weights_are_those_of_arviz() {
        // Source: ArviZ 0.23.4, arviz.stats.stats.psislw: k, the first, the twelfth and the largest log weight, and the
        // effective size computed from all weights.
        for (ratios, k, logs, size) in [
            (
                pareto(200, 0.3),
                0.3490369714739859,
                [-3.856200383918203, -4.4113468746692375, -3.856200383918203],
                169.321065371156,
            ),
            (
                pareto(200, 1.2),
                1.0071479113212243,
                [-1.1701805090842996, -3.146458038263908, -1.1701805090842996],
                8.538596795699258,
            ),
            (
                pareto(1000, 0.8),
                0.7574598327160104,
                [-2.3798543898415856, -8.129684082727028, -2.3798543898415856],
                71.96347046254785,
            ),
            (
                wave(500, 2.0),
                -1.5174206027055708,
                [-7.04165834557797, -5.041669504612832, -5.041669504612832],
                230.02163332824284,
            ),
            (
                wave(60, 9.0),
                -0.44232978829734704,
                [-11.14884657871453, -2.1595095562023148, -2.1595095562023148],
                10.656252532937366,
            ),
        ] {
            let found = smooth(&ratios);
            let largest = found.log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert!((found.k_hat - k).abs() < 1e-9, "{} and {k}", found.k_hat);
            for (a, b) in [found.log_weights[0], found.log_weights[11], largest].iter().zip(logs) {
                assert!((a - b).abs() < 1e-9, "{a} and {b}");
            }
            assert!((found.effective_size / size - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_constant_has_no_tail_and_few_ratios_have_no_judgement() {
        let equal = smooth(&[3.5; 100]);
        assert!(equal.k_hat == 0.0 && (equal.effective_size - 100.0).abs() < 1e-9);
        let few = smooth(&[0.0, 1.0, 2.0]);
        assert!(few.k_hat.is_infinite() && few.effective_size < 3.0);
        // Too few ratios to smooth: the raw weights are kept.
        assert!((few.log_weights[2] - few.log_weights[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn ratios_without_a_value_are_worth_nothing() {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut ratios = pareto(100, 0.3);
            ratios[7] = bad;
            let found = smooth(&ratios);
            assert!(found.k_hat.is_infinite() && found.effective_size == 0.0);
        }
        assert_eq!(smooth(&[f64::NEG_INFINITY; 9]).effective_size, 0.0);
        let mut ratios = pareto(100, 0.3);
        ratios[7] = f64::NEG_INFINITY;
        let found = smooth(&ratios);
        assert_eq!(found.log_weights[7], f64::NEG_INFINITY);
        assert!(found.k_hat < 0.7 && found.effective_size > 50.0);
    }

    #[test]
    fn a_generalised_pareto_law_is_recovered() {
        // Exact quantiles of laws with scale two; the prior pulls the shape slightly towards one half.
        for shape in [-0.5, 0.0, 0.3, 0.9] {
            let law = GeneralisedPareto { shape, scale: 2.0 };
            let sample: Vec<f64> =
                (0..5000).map(|i| law.quantile((f64::from(i) + 0.5) / 5000.0)).collect();
            let fit = GeneralisedPareto::fit(&sample).unwrap();
            assert!((fit.shape - shape).abs() < 0.01, "{shape}: {}", fit.shape);
            assert!((fit.scale - 2.0).abs() < 0.02, "{shape}: {}", fit.scale);
        }
    }
}
