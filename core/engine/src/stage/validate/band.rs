//! Band of a new replicate.

use lacuna::data::Draws;
use lacuna::math::moments;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Likelihood;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::Work;
use crate::stage::predict;

/// Number of posterior draws for the predictive band.
const PREDICTED: usize = 1000;

/// Number of simulated values up to which all are held at once.
const WHOLE: usize = 1 << 22;

/// Number of responses and standard deviations of emulated draws that are held at once (256 MiB for both).
const HELD: usize = 1 << 24;

impl Work<'_> {
    /// 95 % band of data simulated at posterior draws. For long records fewer draws are held, with several simulated
    /// data sets at each.
    pub(super) fn band(
        &self,
        draws: &Draws,
        likelihood: &dyn Likelihood,
        random: &Stream,
    ) -> (Vec<f64>, Vec<f64>) {
        let outputs = self.study.layouts.len();
        let wanted = PREDICTED.min(draws.len());
        let count = predict::affordable(wanted, outputs);
        let chosen = draws.points().select_rows(&predict::spaced(count, draws.len()));
        let d = chosen.columns() - likelihood.hyperparameters().len();
        let several = wanted.div_ceil(count);
        let mut noises: Vec<_> =
            (0..count * several).map(|i| random.at(i as u64).generator()).collect();
        let mut band = (Vec::with_capacity(outputs), Vec::with_capacity(outputs));
        // A model that is run itself is not run again for each part of the outputs.
        let held = if self.emulator.is_some() { HELD } else { usize::MAX };
        let outputs: Vec<usize> = (0..outputs).collect();
        for part in outputs.chunks((held / count).max(1)) {
            let noiseless = self.noiseless((&chosen, d), likelihood, part);
            let numbers: Vec<usize> = (0..part.len()).collect();
            for few in numbers.chunks((WHOLE / (count * several)).max(1)) {
                let simulated: Vec<Vec<f64>> = noises
                    .par_iter_mut()
                    .enumerate()
                    .map(|(i, noise)| {
                        let (response, sd) = &noiseless[i % count];
                        few.iter().map(|&k| response[k] + sd[k] * normal(noise)).collect()
                    })
                    .collect();
                let ends = |k: usize| {
                    let mut values: Vec<f64> = simulated.iter().map(|r| r[k]).collect();
                    [0.025, 0.975].map(|p| moments::quantile_of(&mut values, p))
                };
                let ends: Vec<[f64; 2]> = (0..few.len()).into_par_iter().map(ends).collect();
                band.0.extend(ends.iter().map(|end| end[0]));
                band.1.extend(ends.iter().map(|end| end[1]));
            }
        }
        band
    }

    /// Response at each draw, and the standard deviation of a new replicate about it, at some outputs. The entries of a draw
    /// from the given one on are those of the likelihood.
    fn noiseless(
        &self,
        (draws, own): (&Matrix, usize),
        likelihood: &dyn Likelihood,
        outputs: &[usize],
    ) -> Vec<(Vec<f64>, Vec<f64>)> {
        let of_draw = |(response, point): (&Vec<f64>, &[f64])| {
            let variance = total(&likelihood.predictive(response, &point[own..]));
            let sd = |&j: &usize| variance.get(j).map_or(0.0, |v| v.sqrt());
            (outputs.iter().map(|&j| response[j]).collect(), outputs.iter().map(sd).collect())
        };
        let rows: Vec<usize> = (0..draws.rows()).collect();
        let mut all = Vec::with_capacity(rows.len());
        for some in rows.chunks(predict::together(self.forward)) {
            let points = draws.select_rows(some);
            let responses = predict::responses(self.study, self.forward, &points);
            let each = responses.par_iter().enumerate().map(|(i, r)| (r, points.row(i)));
            all.par_extend(each.map(of_draw));
        }
        all
    }
}

/// Variance of a new replicate, all parts together.
fn total(parts: &[lacuna::plugin::discrepancy::VariancePart]) -> Vec<f64> {
    let outputs = parts.first().map_or(0, |p| p.variance.len());
    (0..outputs).map(|i| parts.iter().map(|p| p.variance[i]).sum()).collect()
}
