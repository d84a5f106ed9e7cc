//! Cut distributions: parameters that the data of the study do not update.
//!
//! The distribution is the prior of the cut parameters times the posterior of all others given them (Plummer, Statistics
//! and Computing 25 (2015) 37). It is sampled by multiple imputation, which needs nothing of the sampler: chains for each of
//! several values of the cut parameters, from which equally many draws are taken.

use std::fs;
use std::path::Path;

use lacuna::data::{Draws, Statistics};
use lacuna::diagnose::Diagnosis;
use lacuna::math::moments;
use lacuna::math::random::{permutation, uniform};
use lacuna::plugin::{Fact, Target};
use lacuna::run::{Progress, Stop, files};
use lacuna::text::values::Count;
use lacuna_linalg::{Matrix, least_squares};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::sample::{Asked, coordinates, sample};
use super::{Calibrated, LikelihoodEstimate, Outcome};
use crate::posterior::CutValues;
use crate::stage::predict::spaced;

/// Number of imputations if the study states none.
const IMPUTATIONS: usize = 40;
/// Number of chains over which the pooled draws are distributed.
const HANDS: usize = 4;
/// Number of pooled draws, if the chains have so many.
const POOLED: usize = 8000;

/// Largest R-hat of the chains of one imputation. It may be larger than for a posterior by itself, because the chains are one
/// of many sets.
const LARGEST_R_HAT: f64 = 1.1;

/// Parameters that the data did not update.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CutOutcome {
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Number of values of these parameters for which the others were sampled.
    pub imputations: usize,
}

/// Samples the cut distribution.
pub(super) fn sample_cut(
    asked: &Asked<'_>,
    places: &[usize],
    folder: &Path,
    progress: &Progress<'_>,
) -> Result<Calibrated, Stop> {
    let (posterior, study) = (asked.posterior, asked.study);
    let section = study.sampler.as_ref().ok_or_else(|| Stop::new("the study has no sampler"))?;
    if posterior.dimension() == places.len() {
        let text = "all unknowns are cut, and nothing is left that the data could determine";
        return Err(Stop::new(text).help("take `cut` out of at least one parameter"));
    }
    let count = section.common.imputations.map_or(IMPUTATIONS, Count::get);
    let values = cut_values(asked, places, count);
    let nothing = CutValues { places: places.to_vec(), values: Vec::new() };
    let remaining = nothing.rest(posterior.parameters());
    let place = |number: usize| folder.join(format!("imputation-{number:04}"));
    let one = |(number, values): (usize, &[f64])| {
        let cut = CutValues { places: places.to_vec(), values: values.to_vec() };
        let conditional = posterior.given(cut, &remaining);
        let own = Asked {
            study,
            posterior: &conditional,
            stated: nothing.rest(&asked.stated),
            random: asked.random.named("imputation").at(number as u64),
            quick: asked.quick,
        };
        let folder = place(number);
        fs::create_dir_all(&folder).map_err(|error| files::cannot_write(&folder, &error))?;
        sample(&own, &folder, progress)
    };
    let rows: Vec<(usize, &[f64])> = values.iter_rows().enumerate().collect();
    let all = rows.into_par_iter().map(one).collect::<Result<Vec<Calibrated>, Stop>>()?;
    let pooled = Pool { asked, places, values: &values, all: &all }.pooled();
    // The chains serve only to continue an interrupted run.
    for folder in (0..count).map(place) {
        fs::remove_dir_all(&folder).map_err(|error| files::cannot_write(&folder, &error))?;
    }
    Ok(pooled)
}

/// Values of the cut parameters, `count x places`: a Latin hypercube if the prior is that of independent parameters, draws
/// otherwise.
fn cut_values(asked: &Asked<'_>, places: &[usize], count: usize) -> Matrix {
    let (prior, random) = (asked.posterior.prior(), asked.random.named("cut"));
    if !prior.is_independent() {
        return asked.posterior.prior_draws(count, &random).select_columns(places);
    }
    let column = |&place: &usize| {
        let mut rng = random.at(place as u64).generator();
        let strata = permutation(&mut rng, count);
        let quantile = |stratum: usize| {
            let unit = (stratum as f64 + uniform(&mut rng)) / count as f64;
            prior.parameters()[place].prior.quantile(unit)
        };
        strata.into_iter().map(quantile).collect::<Vec<f64>>()
    };
    let columns: Vec<Vec<f64>> = places.iter().map(column).collect();
    Matrix::from_fn(count, places.len(), |i, j| columns[j][i])
}

/// The chains of all imputations.
struct Pool<'a> {
    asked: &'a Asked<'a>,
    places: &'a [usize],
    /// Values of the cut parameters, `imputations x places`.
    values: &'a Matrix,
    all: &'a [Calibrated],
}

impl Pool<'_> {
    fn cut(&self, number: usize) -> CutValues {
        CutValues { places: self.places.to_vec(), values: self.values.row(number).to_vec() }
    }

    fn kept(&self, number: usize) -> Draws {
        let own = &self.all[number];
        own.draws.from_step(own.outcome.burn_in)
    }

    /// All imputations together.
    fn pooled(&self) -> Calibrated {
        let first = &self.all[0].outcome;
        let names = self.asked.posterior.parameters().iter().map(|p| p.name.clone());
        let middle = self.middle();
        let centre = &self.all[middle];
        let whole = self.cut(middle);
        let coordinates = coordinates(self.asked.posterior);
        let draws = self.draws(coordinates.iter().map(|c| c.name.clone()).collect());
        let cut: Vec<String> = self.places.iter().filter_map(|&p| names.clone().nth(p)).collect();
        let diagnosis = Diagnosis::of_harvest(&draws, self.effective_size(), &self.doubts());
        let cut_fact = Fact::new("parameters that the data do not update", cut.join(", "));
        let number = Fact::new("values of these parameters", self.all.len());
        let map = whole.whole(&centre.outcome.map);
        Calibrated {
            draws,
            statistics: Statistics::default(),
            outcome: Outcome {
                coordinates,
                best_draw: (map.clone(), centre.outcome.map_log_density),
                map,
                map_log_density: centre.outcome.map_log_density,
                other_maxima: Vec::new(),
                burn_in: 0,
                acceptance: Vec::new(),
                diagnosis,
                evaluations: self.all.iter().map(|own| own.outcome.evaluations).sum(),
                facts: [vec![cut_fact, number], first.facts.clone()].concat(),
                evidence: None,
                estimate: self.worst_estimate(),
                cut: Some(CutOutcome { parameters: cut, imputations: self.all.len() }),
                populations: Vec::new(),
            },
        }
    }

    /// The imputation whose cut values are nearest to the middle of their distribution.
    fn middle(&self) -> usize {
        let middle: Vec<f64> = (0..self.places.len())
            .map(|j| moments::quantile(&moments::sorted(&self.values.column(j)), 0.5))
            .collect();
        let scale: Vec<f64> = (0..self.places.len())
            .map(|j| moments::variance(&self.values.column(j)).sqrt().max(f64::MIN_POSITIVE))
            .collect();
        let distance = |row: &[f64]| -> f64 {
            let each = row.iter().zip(&middle).zip(&scale);
            each.map(|((x, m), s)| ((x - m) / s).powi(2)).sum()
        };
        let distances: Vec<f64> = self.values.iter_rows().map(distance).collect();
        (0..distances.len()).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0)
    }

    /// Equally many draws of each imputation, in random order.
    fn draws(&self, names: Vec<String>) -> Draws {
        let fewest = (0..self.all.len()).map(|number| self.kept(number).len()).min().unwrap_or(0);
        let each = (POOLED / self.all.len()).clamp(1, fewest.max(1));
        let (mut points, mut densities) = (Vec::new(), Vec::new());
        for number in 0..self.all.len() {
            let (kept, cut) = (self.kept(number), self.cut(number));
            let all = kept.points();
            for i in spaced(each.min(kept.len()), kept.len()) {
                points.push(cut.whole(all.row(i)));
                densities.push(kept.log_density[i]);
            }
        }
        let mut rng = self.asked.random.named("pool").generator();
        let steps = points.len() / HANDS;
        let order = permutation(&mut rng, points.len());
        let chosen = &order[..HANDS * steps];
        Draws {
            names,
            chains: HANDS,
            steps,
            values: chosen.iter().flat_map(|&i| points[i].iter().copied()).collect(),
            log_density: chosen.iter().map(|&i| densities[i]).collect(),
        }
    }

    /// Effective sample size, the smallest of all means and variances: the variance of a draw divided by that of the mean of
    /// the pooled draws, which has a part between the imputations and one within them.
    fn effective_size(&self) -> f64 {
        let unknowns = self.asked.posterior.dimension();
        (0..unknowns).map(|j| self.size_of(j)).fold(f64::INFINITY, f64::min)
    }

    /// Effective sample size of the mean and of the variance of a coordinate, the smaller.
    fn size_of(&self, coordinate: usize) -> f64 {
        let count = self.all.len();
        let before = self.places.iter().filter(|&&place| place < coordinate).count();
        let cut = self.places.iter().position(|&place| place == coordinate);
        // Values of each imputation, and the effective number of them.
        let values = |number: usize| {
            if let Some(k) = cut {
                return (vec![self.values[(number, k)]], f64::INFINITY);
            }
            let j = coordinate - before;
            let size = self.all[number].outcome.diagnosis.coordinates[j].ess_bulk;
            (self.kept(number).pooled(j), size)
        };
        let all: Vec<(Vec<f64>, f64)> = (0..count).map(values).collect();
        let centre =
            moments::mean(&all.iter().map(|(own, _)| moments::mean(own)).collect::<Vec<_>>());
        let size = |of: fn(f64) -> f64| {
            let each = all.iter().map(|(own, size)| {
                let own: Vec<f64> = own.iter().map(|x| of(x - centre)).collect();
                let within = if own.len() > 1 { moments::variance(&own) } else { 0.0 };
                (moments::mean(&own), within, within / size)
            });
            let each: Vec<(f64, f64, f64)> = each.collect();
            let means: Vec<f64> = each.iter().map(|(mean, ..)| *mean).collect();
            let within: f64 = each.iter().map(|(_, within, _)| within).sum::<f64>() / count as f64;
            let errors: f64 = each.iter().map(|(.., error)| error).sum::<f64>();
            let of_mean = (errors / count as f64 + self.between(&means)) / count as f64;
            (within + moments::variance(&means)) / of_mean
        };
        size(|x| x).min(size(|x| x * x))
    }

    /// Variance between the means of imputations that counts for the error of the mean of all.
    ///
    /// Values of one cut parameter are one from each stratum: half the mean square of successive differences. A Latin
    /// hypercube of several integrates functions of each of them nearly without error (Stein, Technometrics 29 (1987) 143):
    /// what a quadratic function of each leaves. Values that are plain draws: the whole variance.
    fn between(&self, means: &[f64]) -> f64 {
        let (rows, columns) = (means.len(), 2 * self.places.len() + 1);
        if !self.asked.posterior.prior().is_independent() || rows <= columns + 1 {
            return moments::variance(means);
        }
        if self.places.len() == 1 {
            let mut order: Vec<usize> = (0..rows).collect();
            order.sort_by(|&a, &b| self.values[(a, 0)].total_cmp(&self.values[(b, 0)]));
            let step = |pair: &[usize]| (means[pair[1]] - means[pair[0]]).powi(2);
            return order.windows(2).map(step).sum::<f64>() / (2.0 * (rows - 1) as f64);
        }
        let scaled = |j: usize| {
            let column = self.values.column(j);
            let (mean, sd) = (moments::mean(&column), moments::variance(&column).sqrt());
            column.iter().map(|x| (x - mean) / sd.max(f64::MIN_POSITIVE)).collect::<Vec<f64>>()
        };
        let scaled: Vec<Vec<f64>> = (0..self.places.len()).map(scaled).collect();
        let design = Matrix::from_fn(rows, columns, |i, j| match j {
            0 => 1.0,
            _ => scaled[(j - 1) / 2][i].powi(if j % 2 == 1 { 1 } else { 2 }),
        });
        let Ok(fit) = least_squares(&design, &Matrix::from_fn(rows, 1, |i, _| means[i])) else {
            return moments::variance(means);
        };
        let left = |i: usize| {
            let fitted: f64 = (0..columns).map(|j| design[(i, j)] * fit.solution[(j, 0)]).sum();
            (means[i] - fitted).powi(2)
        };
        (0..rows).map(left).sum::<f64>() / (rows - columns) as f64
    }

    /// Reasons not to trust the draws: imputations whose chains have not converged. One of them has too few draws by itself if
    /// all together have enough.
    fn doubts(&self) -> Vec<String> {
        let disagree = |own: &&Calibrated| {
            let diagnosis = &own.outcome.diagnosis;
            diagnosis.coordinates.iter().any(|c| c.r_hat.is_nan() || c.r_hat > LARGEST_R_HAT)
        };
        let count = self.all.iter().filter(disagree).count();
        if count == 0 {
            return Vec::new();
        }
        vec![format!(
            "the chains of {count} of {} values of the cut parameters disagree: R-hat above {LARGEST_R_HAT}; raise `steps`",
            self.all.len()
        )]
    }

    /// The estimate of the likelihood with the largest variance, of those that exist.
    fn worst_estimate(&self) -> Option<LikelihoodEstimate> {
        let all = self.all.iter().filter_map(|own| own.outcome.estimate.clone());
        let size = |own: &LikelihoodEstimate| own.variance.unwrap_or(f64::INFINITY);
        all.max_by(|a, b| size(a).total_cmp(&size(b)))
    }
}
