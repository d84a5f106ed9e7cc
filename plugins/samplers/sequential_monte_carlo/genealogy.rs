//! Errors from the genealogy of the particles.
//!
//! Particles of one family descend from one draw of the prior. After `p` resamplings of `N` particles, the variance
//! of the estimated evidence relative to its square is estimated by `1 - (N / (N - 1))^(p + 1) (1 - sum_e (n_e /
//! N)^2)`, where `n_e` is the size of family `e`, and that of the mean of a function `f` by `(N / (N - 1))^(p + 1)
//! sum_e (sum_{i in e} (f_i - mean f))^2 / N^2` (Lee and Whiteley 2018, equations 8 and 9; Chan and Lai 2013).

/// Returns the factor `(N / (N - 1))^(p + 1)`.
fn factor(count: usize, generations: usize) -> f64 {
    let n = count as f64;
    ((generations as f64 + 1.0) * -(-1.0 / n).ln_1p()).exp()
}

/// Returns the sum of a quantity over each family.
fn sums(families: &[usize], values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sums = vec![0.0; families.iter().max().map_or(0, |most| most + 1)];
    for (&family, value) in families.iter().zip(values) {
        sums[family] += value;
    }
    sums
}

/// Returns the variance of the estimated evidence relative to its square; it can be negative by chance if it is
/// small.
pub(super) fn evidence_variance(families: &[usize], generations: usize) -> f64 {
    let sizes = sums(families, families.iter().map(|_| 1.0));
    let share: f64 = sizes.iter().map(|n| (n / families.len() as f64).powi(2)).sum();
    1.0 - factor(families.len(), generations) * (1.0 - share)
}

/// Returns the effective number of families, `N^2 / sum_e n_e^2`.
pub(super) fn effective_families(families: &[usize]) -> f64 {
    let sizes = sums(families, families.iter().map(|_| 1.0));
    let squares: f64 = sizes.iter().map(|n| n * n).sum();
    (families.len() as f64).powi(2) / squares
}

/// Returns the number of independent draws that would give the mean of a quantity with the same error; the number of
/// particles if the quantity is constant.
pub(super) fn effective_size(families: &[usize], generations: usize, values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let spread = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    let by_family = sums(families, values.iter().map(|x| x - mean));
    let squares: f64 = by_family.iter().map(|s| s * s).sum();
    let variance = factor(values.len(), generations) * squares / (n * n);
    if variance > 0.0 { (spread / variance).min(n) } else { n }
}
