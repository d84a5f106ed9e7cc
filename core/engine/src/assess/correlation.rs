//! Parameters that the data determine only in combination.

use lacuna_linalg::{Matrix, symmetric_eigen};

use super::words::{percent, short};
use super::{Finding, Rule, Severity};

const CODE: &str = "correlated_parameters";

/// Posterior correlation of two parameters from which on it is reported.
const CORRELATION: f64 = 0.95;
/// Posterior variance of the widest combination, in units of that of the prior, from which on the combination counts as
/// undetermined.
const UNDETERMINED: f64 = 0.25;
/// Weights below this fraction of the largest one are omitted from a combination.
const SMALL: f64 = 0.1;

const REPARAMETRISE: &str = "report the combination that is determined; measure a quantity that depends on the \
                             parameters separately, or give one of them an informative prior";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "the largest posterior correlation of two parameters, and the combinations of parameters, in prior \
                   sd, that the data determine best and worst (eigenvectors of the posterior covariance)"
            .to_owned(),
        threshold: format!(
            "{CORRELATION}: note; reservation if the worst combination keeps {} of its prior variance",
            percent(UNDETERMINED)
        ),
        why: "each parameter alone is poorly determined; a combination of them is well determined",
        action: REPARAMETRISE,
    }]
}

/// Finding about correlated parameters; `covariance` is the posterior covariance, each parameter in units of its prior
/// standard deviation.
pub fn correlated(names: &[String], covariance: &Matrix) -> Option<Finding> {
    let sd = |i: usize| covariance[(i, i)].sqrt();
    let pairs = (0..names.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let correlation = |(i, j): (usize, usize)| covariance[(i, j)] / (sd(i) * sd(j));
    let (pair, largest) = pairs
        .map(|pair| (pair, correlation(pair)))
        .filter(|(_, r)| r.is_finite())
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    if largest.abs() < CORRELATION {
        return None;
    }
    // Only correlated parameters enter the combination: the others may be known better or worse by themselves.
    let (i, j) = pair;
    let with = |k: &usize| {
        [i, j].contains(k) || [i, j].iter().any(|&l| correlation((*k, l)).abs() >= CORRELATION)
    };
    let chosen: Vec<usize> = (0..names.len()).filter(with).collect();
    let block = covariance.select_rows(&chosen).select_columns(&chosen);
    let eigen = symmetric_eigen(&block).ok()?;
    let order = |a: &usize, b: &usize| eigen.values[*a].total_cmp(&eigen.values[*b]);
    let best = (0..chosen.len()).min_by(order)?;
    let worst = (0..chosen.len()).max_by(order)?;
    let told: Vec<&str> = chosen.iter().map(|&k| names[k].as_str()).collect();
    let words = |k: usize| combination(&told, &eigen.vectors.column(k));
    let share = |k: usize| eigen.values[k].max(0.0);
    let severity =
        if share(worst) >= UNDETERMINED { Severity::Reservation } else { Severity::Note };
    let message = format!(
        "the posterior correlation is {largest:.3}: the posterior standard deviation of {} is {} (in prior standard \
         deviations), that of {} is {}",
        words(best),
        short(share(best).sqrt()),
        words(worst),
        short(share(worst).sqrt())
    );
    let place = format!("{}, {}", names[j], names[i]);
    let figures = (largest.abs(), CORRELATION);
    Some(Finding::new((CODE, &place), figures, severity, message, REPARAMETRISE))
}

/// Text of a combination of parameters, with weights scaled so that the largest has magnitude one and the first is
/// positive.
fn combination(names: &[&str], weights: &[f64]) -> String {
    let largest = weights.iter().map(|w| w.abs()).fold(0.0, f64::max);
    let first = weights.iter().find(|w| w.abs() >= SMALL * largest).map_or(1.0, |w| w.signum());
    let scaled = names.iter().zip(weights).map(|(name, w)| (name, first * w / largest));
    let mut text = String::new();
    for (name, weight) in scaled.filter(|(_, w)| w.abs() >= SMALL) {
        let sign = match (text.is_empty(), weight < 0.0) {
            (true, _) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        };
        let size = weight.abs();
        let factor = if (size - 1.0).abs() < 0.005 { String::new() } else { format!("{size:.2} ") };
        text.push_str(&format!("{sign}{factor}`{name}`"));
    }
    text
}
