//! Predictions of the data at selected draws of the posterior: the log density of each datum, and simulated data.

use lacuna::data::{Draws, Measurements, Observations};
use lacuna::diagnose::chains;
use lacuna::math::moments::mean;
use lacuna::math::random::Stream;
use lacuna::plugin::{Forward, Likelihood};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::calibrate::{Calibrated, Law};
use super::pieces::Pieces;
use super::{predict, stream};
use crate::study::Study;

/// Quantities from which the data are predicted.
pub struct Predicting<'a> {
    /// Forward map.
    pub forward: &'a dyn Forward,
    /// Likelihood of the data.
    pub likelihood: &'a dyn Likelihood,
    /// Discrepancy and common errors of the likelihood, block by block.
    pub law: Law<'a>,
    /// Data of the likelihood.
    pub data: &'a Observations,
}

/// Densities of the measured data, and a simulator of new ones.
pub struct Predictor<'a> {
    /// Densities of the measured data.
    pub densities: Predicting<'a>,
    /// Likelihood that simulates data around a response.
    pub makes: &'a dyn Likelihood,
}

/// Number of draws at which the data are predicted, if there are as many.
const WANTED: usize = 1000;

/// Smallest such number, unless the posterior has fewer draws or they do not fit into memory.
const FEWEST: usize = 400;

/// Preferred limit on the number of values of one kind written to `posterior.nc`, if it leaves enough draws: 32 MB.
const PREFERRED: usize = 4_000_000;

/// Hard limit on the number of values written: 80 MB.
const WRITTEN: usize = 10_000_000;

/// Largest number of response values held at once.
const HELD: usize = 1 << 24;

/// Number of draws processed together for long records, and for very long ones the number of values.
const TOGETHER: usize = 40;
const VALUES_TOGETHER: usize = 1 << 22;

/// Selected draws of the posterior, chain by chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// Indices of the chains.
    pub chains: Vec<usize>,
    /// Indices of the steps in each of these chains, counted after the burn-in.
    pub steps: Vec<usize>,
    /// Points in natural units, one per row.
    pub points: Matrix,
    /// Ratio of independent to selected draws.
    pub efficiency: f64,
    /// True if the numbers for each datum at each draw are few enough to be written.
    pub written: bool,
}

impl Chosen {
    /// Selects draws for the prediction of `data` values: evenly spaced over all chains after the burn-in.
    pub fn of(calibrated: &Calibrated, data: usize) -> Self {
        let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
        let (count, written) = number(draws.len(), data);
        let (chains, steps) = grid(draws.chains, draws.steps, count);
        let d = draws.dimension();
        let cells = chains.iter().flat_map(|&c| steps.iter().map(move |&s| (c, s)));
        let points = Matrix::from_rows(d, cells.map(|(c, s)| draws.point(c, s)));
        let efficiency = efficiency(calibrated, &draws, points.rows());
        Self { chains, steps, points, efficiency, written }
    }
}

/// Number of draws at which this many data are predicted, and whether the numbers are written.
fn number(draws: usize, data: usize) -> (usize, bool) {
    let wanted = draws.min(WANTED);
    let fewest = wanted.min(FEWEST);
    if WRITTEN / data.max(1) >= fewest {
        (wanted.min((PREFERRED / data.max(1)).max(fewest)), true)
    } else {
        (predict::affordable(fewest, data), false)
    }
}

/// Returns true if predictions of this many data are written, at draws of the posterior or of the prior.
pub fn are_written(calibrated: &Calibrated, data: usize) -> bool {
    let draws = calibrated.draws.from_step(calibrated.outcome.burn_in).len();
    number(draws, data).1 || from_prior(data) > 0
}

/// Number of draws from the prior at which this many data are predicted; zero if even few draws give too many numbers
/// to write.
pub fn from_prior(data: usize) -> usize {
    let fit = PREFERRED / data.max(1);
    if fit >= 50 { fit.min(500) } else { 0 }
}

/// Evenly spaced chains and steps, whose combinations number about `count` and no more.
fn grid(chains: usize, steps: usize, count: usize) -> (Vec<usize>, Vec<usize>) {
    let deep = count.div_ceil(chains.max(1)).min(steps);
    let wide = (count / deep.max(1)).min(chains);
    (predict::spaced(wide, chains), predict::spaced(deep, steps))
}

/// Ratio of independent draws to `count` selected draws: the mean effective sample size of the unknowns divided by
/// their number, as in ArviZ, and at most one for thinned draws. One for a single chain.
fn efficiency(calibrated: &Calibrated, draws: &Draws, count: usize) -> f64 {
    if draws.chains < 2 || count == 0 {
        return 1.0;
    }
    let judged = &calibrated.outcome.diagnosis.coordinates;
    // Draws of a harvest are distributed over artificial chains, whose autocorrelation says nothing about their
    // effective size.
    let sizes: Vec<f64> = if calibrated.outcome.acceptance.is_empty() {
        judged.iter().map(|j| j.ess_bulk).collect()
    } else {
        let of = |j| chains::ess_mean(&draws.coordinate(j).collect::<Vec<_>>());
        (0..draws.dimension()).into_par_iter().map(of).collect()
    };
    let share = mean(&sizes) / count as f64;
    let thinned = count < draws.len();
    if !(share.is_finite() && share > 0.0) {
        1.0
    } else if thinned {
        share.min(1.0)
    } else {
        share
    }
}

/// Responses at selected draws; `None` if there are too many to hold.
pub fn responses(
    study: &Study,
    p: &Predicting<'_>,
    chosen: &Chosen,
    pieces: &mut Pieces<'_>,
) -> Result<Option<Vec<Vec<f64>>>, Stop> {
    let (count, outputs) = (chosen.points.rows(), p.forward.outputs());
    if count * outputs > HELD {
        return Ok(None);
    }
    pieces.announce(count.div_ceil(TOGETHER));
    let mut all = Vec::with_capacity(count);
    for rows in blocks(count, TOGETHER) {
        let some = chosen.points.select_rows(&rows);
        let made = || at_points(study, p, &some).map(|responses| responses.concat());
        all.extend(pieces.next(made)?.chunks_exact(outputs.max(1)).map(<[f64]>::to_vec));
    }
    Ok(Some(all))
}

/// Responses at points, unless the model has given up.
fn at_points(study: &Study, p: &Predicting<'_>, points: &Matrix) -> Result<Vec<Vec<f64>>, Stop> {
    let responses = predict::responses(study, p.forward, points);
    p.forward.failure().map_or(Ok(responses), |reason| Err(Stop::new(reason)))
}

/// Consecutive indices, so many together.
fn blocks(count: usize, together: usize) -> impl Iterator<Item = Vec<usize>> {
    (0..count).step_by(together).map(move |first| (first..count.min(first + together)).collect())
}

/// Log density of each datum given all others and the parameters, `draws x data`; `None` if the discrepancy has no such
/// form.
pub fn pointwise(
    study: &Study,
    p: &Predicting<'_>,
    chosen: &Chosen,
    responses: Option<&[Vec<f64>]>,
    pieces: &mut Pieces<'_>,
) -> Result<Option<Matrix>, Stop> {
    let all = |response: &[f64], hyper: &[f64]| p.likelihood.left_out(response, hyper);
    by_draw(study, p, chosen, responses, &all, pieces)
}

/// Like [`pointwise`], for the data with these indices, which increase.
pub fn pointwise_at(
    study: &Study,
    p: &Predicting<'_>,
    chosen: &Chosen,
    responses: Option<&[Vec<f64>]>,
    data: &[usize],
    pieces: &mut Pieces<'_>,
) -> Result<Option<Matrix>, Stop> {
    let some = |response: &[f64], hyper: &[f64]| p.likelihood.left_out_at(response, hyper, data);
    by_draw(study, p, chosen, responses, &some, pieces)
}

/// Log densities from the response and the hyperparameters of a draw.
type Densities<'a> = dyn Fn(&[f64], &[f64]) -> Option<Vec<f64>> + Sync + 'a;

fn by_draw(
    study: &Study,
    p: &Predicting<'_>,
    chosen: &Chosen,
    responses: Option<&[Vec<f64>]>,
    densities: &Densities<'_>,
    pieces: &mut Pieces<'_>,
) -> Result<Option<Matrix>, Stop> {
    let count = chosen.points.rows();
    let own = p.likelihood.hyperparameters().len();
    let mut all: Option<Matrix> = None;
    let together = TOGETHER.min(VALUES_TOGETHER / p.forward.outputs().max(1)).max(1);
    pieces.announce(count.div_ceil(together));
    for rows in blocks(count, together) {
        let some = chosen.points.select_rows(&rows);
        // Without densities of left-out data the piece is empty.
        let piece = pieces.next(|| {
            let made;
            let at = if let Some(held) = responses {
                &held[rows[0]..rows[0] + rows.len()]
            } else {
                made = at_points(study, p, &some)?;
                &made[..]
            };
            let left_out = |(i, response): (usize, &Vec<f64>)| {
                densities(response, &some.row(i)[some.columns() - own..])
            };
            let found: Option<Vec<_>> = at.par_iter().enumerate().map(left_out).collect();
            Ok(found.unwrap_or_default().concat())
        })?;
        if piece.is_empty() {
            return Ok(None);
        }
        let data = piece.len() / rows.len();
        let all = all.get_or_insert_with(|| Matrix::zeros(count, data));
        for (row, density) in rows.iter().zip(piece.chunks_exact(data)) {
            all.row_mut(*row).copy_from_slice(density);
        }
    }
    Ok(all)
}

/// Data simulated at draws of the posterior, one set per row, in the order of the measured ones: the group
/// `posterior_predictive` of `posterior.nc`.
pub fn simulated_from_posterior(
    study: &Study,
    p: &Predictor<'_>,
    responses: &[Vec<f64>],
    points: &Matrix,
) -> Matrix {
    simulated(p, responses, points, &stream(study, "posterior_predictive"))
}

/// Simulated data, one set per row, in the order of the measured ones.
pub fn simulated(
    p: &Predictor<'_>,
    responses: &[Vec<f64>],
    points: &Matrix,
    random: &Stream,
) -> Matrix {
    let (own, count) = (p.makes.hyperparameters().len(), p.densities.data.count());
    let one = |(i, response): (usize, &Vec<f64>)| -> Vec<f64> {
        let point = points.row(i);
        let hyper = &point[point.len() - own..];
        let blocks = p.makes.simulate(response, hyper, &random.named("data").at(i as u64));
        let values = |block: &Measurements| -> Vec<f64> {
            block.replicates.iter().flat_map(|r| r.values.iter().flatten()).copied().collect()
        };
        let all: Vec<f64> = blocks.iter().flat_map(values).collect();
        // A failing discrepancy in a library reports its fault separately.
        if all.len() == count { all } else { vec![f64::NAN; count] }
    };
    let rows: Vec<Vec<f64>> = responses.par_iter().enumerate().map(one).collect();
    Matrix::from_rows(count, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_records_have_fewer_draws_and_the_longest_are_not_written() {
        for (draws, data, expected) in [
            (72_000, 100, (1000, true)),
            (300, 100, (300, true)),
            (72_000, 8_000, (500, true)),
            (72_000, 18_000, (400, true)),
            (72_000, 25_000, (400, true)),
            (72_000, 25_001, (400, false)),
            (72_000, 170_000, (197, false)),
        ] {
            assert_eq!(number(draws, data), expected, "{draws} {data}");
        }
    }

    #[test]
    fn long_records_have_fewer_draws_from_the_prior() {
        assert_eq!([100, 18_000, 80_000, 80_001].map(from_prior), [500, 222, 50, 0]);
    }

    #[test]
    fn draws_are_spread_over_chains_and_steps() {
        assert_eq!(grid(4, 1000, 1000), ((0..4).collect(), (0..250).map(|k| 4 * k + 2).collect()));
        let (chains, steps) = grid(120, 600, 555);
        assert_eq!((chains.len(), steps), (111, vec![60, 180, 300, 420, 540]));
        assert!(chains.windows(2).all(|pair| pair[0] < pair[1]) && chains[110] < 120);
        assert_eq!(grid(2, 3, 6), (vec![0, 1], vec![0, 1, 2]));
        assert_eq!(grid(3, 0, 0), (vec![], vec![]));
    }
}
