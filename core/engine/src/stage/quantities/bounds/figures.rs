//! Figures of the distribution of a quantity at one point of the intervals' box.

use lacuna::math::moments::{mean, quantile, sorted, variance};

/// Probabilities at which quantiles are bounded: multiples of 2.5 %, and 0.5 % from both ends.
pub const PROBABILITIES: [f64; 41] = probabilities();

const fn probabilities() -> [f64; 41] {
    let mut all = [0.005; 41];
    all[40] = 0.995;
    let mut k = 1;
    while k < 40 {
        all[k] = k as f64 / 40.0;
        k += 1;
    }
    all
}

/// Places of the figures that are searched for: mean, sd, 2.5 % quantile, median, 97.5 % quantile.
pub(super) const SEARCHED: [usize; 5] = [0, 1, QUANTILES + 1, QUANTILES + 20, QUANTILES + 39];
/// Place of the first quantile.
pub(super) const QUANTILES: usize = 2;
/// Place of the standard error of the first searched figure.
pub(super) const ERRORS: usize = QUANTILES + PROBABILITIES.len();
/// Place of the number of undefined draws.
pub(super) const UNDEFINED: usize = ERRORS + SEARCHED.len();
/// Number of figures.
pub(super) const COUNT: usize = UNDEFINED + 1;

/// All figures of some draws; NaN if none is defined.
pub(super) fn figures(draws: &[f64]) -> [f64; COUNT] {
    let mut all = [f64::NAN; COUNT];
    let kept: Vec<f64> = draws.iter().copied().filter(|value| value.is_finite()).collect();
    all[UNDEFINED] = (draws.len() - kept.len()) as f64;
    let ordered = sorted(&kept);
    let (Some(&low), Some(&high)) = (ordered.first(), ordered.last()) else { return all };
    // The mean of equal numbers is not always that number, and one number has no variance.
    if low.to_bits() == high.to_bits() {
        all[..ERRORS].fill(low);
        all[1] = 0.0;
        all[ERRORS..UNDEFINED].fill(0.0);
        return all;
    }
    let n = kept.len() as f64;
    let (centre, square) = (mean(&kept), variance(&kept));
    all[0] = centre;
    all[1] = square.sqrt();
    let quantiles = PROBABILITIES.map(|p| quantile(&ordered, p));
    all[QUANTILES..ERRORS].copy_from_slice(&quantiles);
    let fourth = kept.iter().map(|y| (y - centre).powi(4)).sum::<f64>() / n;
    let errors = [
        (square / n).sqrt(),
        ((fourth - square * square).max(0.0) / (4.0 * n * square)).sqrt(),
        of_quantile(&ordered, 0.025),
        of_quantile(&ordered, 0.5),
        of_quantile(&ordered, 0.975),
    ];
    all[ERRORS..UNDEFINED].copy_from_slice(&errors);
    all
}

/// Standard error of a quantile: half the distance of the quantiles one binomial standard deviation apart (Woodruff,
/// Journal of the American Statistical Association 47 (1952) 635).
fn of_quantile(ordered: &[f64], p: f64) -> f64 {
    let step = (p * (1.0 - p) / ordered.len() as f64).sqrt();
    let at = |p: f64| quantile(ordered, p.clamp(0.0, 1.0));
    0.5 * (at(p + step) - at(p - step))
}

#[cfg(test)]
mod tests {
    use lacuna::math::random::{Stream, normal};

    use super::*;

    /// The standard errors are the scatter of the figures over repeated samples of a skewed distribution, the logarithm of
    /// which is normal with sd 1/2. The standard deviation of the scatter of 2000 samples has an error of 1.6 %.
    #[test]
    fn standard_errors_are_the_scatter() {
        let samples: Vec<[f64; COUNT]> = (0..2000)
            .map(|i| {
                let mut rng = Stream::root(11).at(i).generator();
                let draws: Vec<f64> = (0..400).map(|_| (0.5 * normal(&mut rng)).exp()).collect();
                figures(&draws)
            })
            .collect();
        for (k, place) in SEARCHED.into_iter().enumerate() {
            let column = |at: usize| samples.iter().map(|s| s[at]).collect::<Vec<f64>>();
            let scatter = variance(&column(place)).sqrt();
            let stated = mean(&column(ERRORS + k).iter().map(|e| e * e).collect::<Vec<_>>()).sqrt();
            // The spacing of 20 draws beyond a quantile, and a fourth moment of 400, are crude.
            assert!((stated / scatter - 1.0).abs() < 0.12, "{k}: {stated} {scatter}");
        }
    }

    #[test]
    fn probabilities_hold_the_printed_ones() {
        let at = |place: usize| PROBABILITIES[place - QUANTILES];
        assert_eq!([at(SEARCHED[2]), at(SEARCHED[3]), at(SEARCHED[4])], [0.025, 0.5, 0.975]);
        assert!(PROBABILITIES.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn equal_and_undefined_draws() {
        let equal = figures(&[0.1; 7]);
        assert_eq!((equal[0], equal[1], equal[QUANTILES + 3], equal[ERRORS]), (0.1, 0.0, 0.1, 0.0));
        let none = figures(&[f64::NAN, f64::INFINITY]);
        assert!(none[0].is_nan() && none[UNDEFINED] == 2.0);
        assert_eq!(figures(&[1.0, f64::NAN, 3.0])[UNDEFINED], 1.0);
    }
}
