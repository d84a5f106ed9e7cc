//! Search for the hyperparameters with the largest likelihood.

use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::plugin::Target;
use lacuna_linalg::Matrix;
use lacuna_optimise::{Precision, ascend};
use rayon::prelude::*;

use super::likelihood::{Hyperparameters, Restricted, measured};
use super::nearest::{Nearby, Neighbours};
use super::options::Nugget;
use super::scoring::score;

/// Number of runs on which several starts are followed, if there are at least twice as many.
const FEW: usize = 120;
/// Precision sufficient to distinguish two maxima.
const ROUGH: Precision = Precision { gradient: 0.05, gain: Some(1e-5), steps: 30 };
/// Precision at which the remaining error of a length scale is below a tenth of its standard error.
const FINE: Precision = Precision { gradient: 1e-2, gain: Some(1e-6), steps: 100 };
/// Region from which starts are drawn: length scales and nuggets.
const REGION: [[f64; 2]; 2] = [[0.1, 3.0], [1e-8, 1e-2]];
/// Gain in log-likelihood that a step must promise; and the same for many runs, which leaves the hyperparameters within
/// about a tenth of their standard errors.
const GAIN: f64 = 1e-4;
const ROUGH_GAIN: f64 = 1e-2;
/// Number of runs on which the search begins if each has neighbours.
const PART: usize = 1000;
/// Number of runs whose densities given their neighbours make up the likelihood: they determine the hyperparameters to a few
/// hundredths, whatever the number of runs.
const BLOCKS: usize = 2000;
/// Number of times that neighbours are sought.
const ROUNDS: usize = 4;
/// Change of the logarithms of the length scales that leaves the neighbours as they are.
const SAME: f64 = 0.1;
/// Typical standard error of the logarithm of a hyperparameter.
const SCALE: f64 = 0.3;

/// Returns the hyperparameters with the largest restricted likelihood that `starts` searches find; `None` if no start
/// has a likelihood.
///
/// The starts are followed by L-BFGS-B. With many runs a random subset of them is used, because a likelihood costs
/// the cube of the number of runs; all runs then select among the end points (and the first start), and one search
/// from there, by scoring, gives the result, which is a maximum of the full likelihood.
pub fn search(problem: &Restricted<'_>, starts: usize, stream: &Stream) -> Option<Hyperparameters> {
    let starts = starting_points(problem, starts, &stream.named("starts"));
    let runs = problem.points.columns();
    let few = FEW.max(3 * problem.trend.columns());
    let start = if runs < 2 * few {
        climbs(problem, &starts, ROUGH).into_iter().next()?.0
    } else {
        let mut chosen = permutation(&mut stream.named("runs").generator(), runs);
        chosen.truncate(few);
        let mut ends = climbs_on(problem, &chosen, &starts);
        ends.push(starts.row(0).to_vec());
        ends.dedup_by(|a, b| near(a, b));
        let on_all = |end: &Vec<f64>| (end.clone(), problem.value(end));
        let ends: Vec<(Vec<f64>, f64)> = ends.par_iter().map(on_all).collect();
        let better = |a: (Vec<f64>, f64), b: (Vec<f64>, f64)| if b.1 > a.1 { b } else { a };
        ends.into_iter().reduce(better).filter(|(_, value)| value.is_finite())?.0
    };
    let (mut point, reached) = score(problem, &start, GAIN)?;
    if !reached {
        let scales = vec![SCALE; point.len()];
        point = ascend(problem, &point, &scales, FINE)?.point;
    }
    Some(problem.at(&point))
}

/// Returns the hyperparameters with the largest restricted likelihood by Vecchia's approximation, as far as a search
/// from those of a random part of the runs finds it; `None` if there is no likelihood.
///
/// Order and neighbours of the runs are those in the metric of the length scales (Katzfuss, Guinness and Lawrence, SIAM/ASA
/// Journal on Uncertainty Quantification 10 (2022) 537). They are fixed while the likelihood climbs, so that it is
/// smooth, and renewed until the length scales hardly change.
pub fn search_nearby(
    problem: &Restricted<'_>,
    neighbours: usize,
    starts: usize,
    stream: &Stream,
) -> Option<Hyperparameters> {
    let (d, runs) = (problem.points.rows(), problem.points.columns());
    let mut chosen = permutation(&mut stream.named("part").generator(), runs);
    chosen.truncate(PART.max(3 * problem.trend.columns()));
    let first = on_part(problem, &chosen, |part| search(part, starts, stream))?;
    let mut point: Vec<f64> = first.length_scales.iter().map(|scale| scale.ln()).collect();
    if matches!(problem.nugget, Nugget::Estimated(_)) {
        point.push(first.nugget.ln());
    }
    for round in 1..=ROUNDS {
        let scales: Vec<f64> = point[..d].iter().map(|x| x.exp()).collect();
        let place = measured(problem.points, &scales);
        let found = Neighbours::of_some(&place, neighbours, BLOCKS);
        let nearby = Nearby { whole: *problem, neighbours: &found };
        let (mut next, reached) = score(&nearby, &point, ROUGH_GAIN)?;
        if round == ROUNDS && !reached {
            next = ascend(&nearby, &next, &vec![SCALE; next.len()], FINE)?.point;
        }
        let same = next[..d].iter().zip(&point).all(|(a, b)| (a - b).abs() < SAME);
        point = next;
        if same {
            break;
        }
    }
    Some(problem.at(&point))
}

/// Calls `give` with the problem of some of the runs.
fn on_part<T>(
    problem: &Restricted<'_>,
    runs: &[usize],
    give: impl FnOnce(&Restricted<'_>) -> T,
) -> T {
    give(&Restricted {
        points: &problem.points.select_columns(runs),
        trend: &problem.trend.select_rows(runs),
        scores: &problem.scores.select_rows(runs),
        ..*problem
    })
}

/// Returns the end points of the searches on some of the runs, the best first.
fn climbs_on(problem: &Restricted<'_>, runs: &[usize], starts: &Matrix) -> Vec<Vec<f64>> {
    let ends = on_part(problem, runs, |part| climbs(part, starts, ROUGH));
    ends.into_iter().map(|(point, _)| point).collect()
}

/// Returns the end points of the searches from all starts, the best first.
fn climbs(problem: &Restricted<'_>, starts: &Matrix, precision: Precision) -> Vec<(Vec<f64>, f64)> {
    let scales = vec![SCALE; Target::dimension(problem)];
    let mut ends: Vec<(Vec<f64>, f64)> = (0..starts.rows())
        .into_par_iter()
        .filter_map(|i| ascend(problem, starts.row(i), &scales, precision))
        .map(|optimum| (optimum.point, optimum.value))
        .collect();
    ends.sort_by(|a, b| b.1.total_cmp(&a.1));
    ends
}

/// Returns true if two end points of rough searches belong to the same maximum.
fn near(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() < SCALE)
}

/// Returns the default start, half of the design's diagonal, and random starts.
fn starting_points(problem: &Restricted<'_>, count: usize, stream: &Stream) -> Matrix {
    let d = problem.points.rows();
    let mut rng = stream.generator();
    let diagonal = (d as f64).sqrt();
    let mut logarithm =
        |[low, high]: [f64; 2]| f64::ln(low) + (f64::ln(high) - f64::ln(low)) * uniform(&mut rng);
    let mut starts = Matrix::zeros(0, Target::dimension(problem));
    for i in 0..count.max(1) {
        let mut start: Vec<f64> = (0..d).map(|_| logarithm(REGION[0]) + diagonal.ln()).collect();
        let nugget = logarithm(REGION[1]);
        if i == 0 {
            start.fill((0.5 * diagonal).ln());
        }
        if matches!(problem.nugget, Nugget::Estimated(_)) {
            start.push(if i == 0 { 1e-6_f64.ln() } else { nugget });
        }
        starts.push_row(&start);
    }
    starts
}
