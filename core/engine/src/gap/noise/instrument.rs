//! The noise of one instrument in several single records: the same in all of them.
//!
//! A record with missing physics has a larger residual than one without, and its own noise cannot show that this is no
//! noise. The other records of the same sensor can, if their fastest variation is of the same size: the noise of the
//! quiet records is then that of all.

use super::{CurveNoise, Origin, ResponseTangents};
use crate::gap::experiment::{Experiment, MeasuredCurve};

/// The largest ratio of the fastest variations of two records of the same noise.
const ALIKE: f64 = 1.6;

/// The largest ratio of the sizes of two estimates of the same noise.
const SAME: f64 = 1.6;

/// The smallest number of values of a record whose noise is compared.
const FEWEST: usize = 24;

/// The median absolute value of a standard normal variable.
const MEDIAN: f64 = 0.674_489_750_196_082;

/// Gives records of the same sensor the noise of the quiet ones, where all vary alike from value to value.
pub(super) fn pool(
    experiment: &Experiment<'_>,
    means: &[f64],
    around: &ResponseTangents,
    origins: &[Origin],
    curves: &mut [CurveNoise],
) {
    let has_enough = |s: &usize| experiment.curves[*s].measured.len() >= FEWEST;
    let records = (0..curves.len()).filter(|&s| origins[s] == Origin::Record);
    let mut left: Vec<usize> = records.filter(has_enough).collect();
    while let Some(&first) = left.first() {
        let labels = &experiment.curves[first].labels;
        let (own, others): (Vec<usize>, Vec<usize>) =
            left.iter().partition(|&&s| experiment.curves[s].labels == *labels);
        left = others;
        let fast = own.iter().map(|&s| fastest(&experiment.curves[s], means, around));
        let fast: Vec<f64> = fast.collect();
        let (least, most) = fast
            .iter()
            .fold((f64::INFINITY, 0.0_f64), |(least, most), x| (least.min(*x), most.max(*x)));
        if own.len() < 2 || most > ALIKE * least {
            continue;
        }
        let quiet = own.iter().map(|&s| curves[s].size()).fold(f64::INFINITY, f64::min);
        // Of the estimates that agree with the smallest the largest is taken: it raises the fewest alarms.
        let agree = own.iter().filter(|&&s| curves[s].size() <= SAME * quiet);
        let Some(&law) = agree.max_by(|&&i, &&j| curves[i].size().total_cmp(&curves[j].size()))
        else {
            continue;
        };
        let law = curves[law].clone();
        for s in own {
            if curves[s].size() <= law.size() {
                continue;
            }
            let profile = vec![1.0; curves[s].profile.len()];
            curves[s] = CurveNoise { profile, ..law.clone() };
        }
    }
}

/// The standard deviation of white noise with the same third differences of the residual as this record, by their median
/// magnitude: smooth misfits and single jumps have little part in it.
fn fastest(curve: &MeasuredCurve, means: &[f64], around: &ResponseTangents) -> f64 {
    let misfit: Vec<f64> = curve.measured.iter().map(|&i| means[i] - around.response[i]).collect();
    let third = |w: &[f64]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs();
    let mut sizes: Vec<f64> = misfit.windows(4).map(third).collect();
    sizes.sort_by(f64::total_cmp);
    // The squares of the weights 1, 3, 3, 1 have the sum 20.
    sizes.get(sizes.len() / 2).map_or(0.0, |middle| middle / (MEDIAN * 20.0_f64.sqrt()))
}
