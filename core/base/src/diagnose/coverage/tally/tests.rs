use super::super::{Calibration, EDGE, Word};
use super::*;
use crate::data::Unit;
use crate::math::distribution::Distribution;
use crate::math::random::{Stream, normal};
use crate::math::special::{normal_cdf, normal_quantile};

fn coordinate(name: &str) -> Coordinate {
    Coordinate {
        name: name.into(),
        unit: Unit::dimensionless(),
        prior: Distribution::Normal([0.0, 1.0]),
        of_prior: true,
    }
}

/// A normal truth of sd 1, measured with an error of sd 0.5: the posterior is normal with mean 0.8 y and variance 0.2.
/// The stated standard deviation is the correct one times `factor`.
fn case(number: usize, unknowns: usize, factor: f64) -> Case {
    let mut rng = Stream::root(77).at(number as u64).generator();
    let mut one = || {
        let truth = normal(&mut rng);
        let (mean, sd) = (0.8 * (truth + 0.5 * normal(&mut rng)), factor * 0.2_f64.sqrt());
        let ends =
            |level: f64| [-1.0, 1.0].map(|s| mean + s * sd * normal_quantile(0.5 + 0.5 * level));
        // The coverage expected at the edges is in closed form too.
        let within = |low: f64, high: f64| {
            (normal_cdf((high - mean) / sd) - normal_cdf((low - mean) / sd)).max(0.0)
        };
        let edges = [EDGE, 1.0 - EDGE].map(normal_quantile);
        let central = |[low, high]: [f64; 2]| within(low.max(edges[0]), high.min(edges[1]));
        Judged {
            truth,
            mean,
            sd,
            rank: (normal_cdf((truth - mean) / sd) * (RANKS + 1) as f64) as usize,
            size: 1000.0,
            intervals: LEVELS.map(ends),
            edge: 1.0 - within(edges[0], edges[1]),
            edge_inside: LEVELS.map(|level| level - central(ends(level))),
            inside: LEVELS,
        }
    };
    let unknowns = (0..unknowns).map(|_| one()).collect();
    let calibration =
        Calibration { converged: !number.is_multiple_of(10), advice: Vec::new(), unknowns };
    Case { number, ended: Ended::Calibrated(calibration) }
}

fn cases(count: usize, unknowns: usize, factor: f64) -> Vec<Case> {
    (0..count).map(|number| case(number, unknowns, factor)).collect()
}

#[test]
fn right_intervals_are_called_nominal() {
    let coordinates = [coordinate("a"), coordinate("b")];
    let tally = tally(&coordinates, &cases(300, 2, 1.0));
    assert_eq!(tally.verdict.word, Word::Nominal, "{tally:?}");
    assert_eq!((tally.truths, tally.calibrated, tally.converged), (300, 300, 270));
    assert_eq!(tally.rows[0].uniform, Some(true));
    // The posterior sd is 0.447 times the prior's, whatever the data.
    assert!((tally.rows[0].shrinkage[1] - 0.2_f64.sqrt()).abs() < 1e-12);
    assert!(tally.overall_converged.is_some());
}

#[test]
fn intervals_too_narrow_and_too_wide_are_told() {
    let coordinates = [coordinate("a"), coordinate("b")];
    let narrow = tally(&coordinates, &cases(200, 2, 1.0 / 3.0));
    assert_eq!(narrow.verdict.word, Word::TooNarrow, "{}", narrow.verdict.text);
    assert_eq!(narrow.rows[0].uniform, Some(false));
    // A 95 % interval of a third of the width: 2 Phi(1.96 / 3) - 1 = 48.6 %.
    let share = narrow.rows[0].levels[2].share;
    assert!((share - 0.486).abs() < 4.0 * (0.25_f64 / 200.0).sqrt(), "{share}");
    let wide = tally(&coordinates, &cases(200, 2, 2.0));
    assert_eq!(wide.verdict.word, Word::TooWide, "{}", wide.verdict.text);
}

/// Ranks concentrated half at each end, with intervals of nominal coverage, are not uniform.
#[test]
fn a_shifted_posterior_has_ranks_that_are_not_uniform() {
    let mut all = cases(300, 1, 1.0);
    for case in &mut all {
        if let Ended::Calibrated(calibration) = &mut case.ended {
            for judged in &mut calibration.unknowns {
                judged.rank = 50 + judged.rank / 2;
            }
        }
    }
    assert_eq!(tally(&[coordinate("a")], &all).verdict.word, Word::NotUniform);
}

#[test]
fn failed_calibrations_are_told_and_raise_a_doubt() {
    let mut all = cases(100, 1, 1.0);
    for case in &mut all[..20] {
        case.ended = Ended::Failed("no maximum".to_owned());
    }
    all[20].ended = Ended::NoData("the model failed".to_owned());
    let found = tally(&[coordinate("a")], &all);
    assert_eq!(found.failed, [("no maximum".to_owned(), 20)]);
    assert_eq!(found.without_data, [("the model failed".to_owned(), 1)]);
    assert_eq!((found.calibrated, found.verdict.word), (79, Word::Doubtful));
    assert_eq!(tally(&[coordinate("a")], &[]).verdict.word, Word::Nothing);
}

/// Unknowns of one case that are all inside or all outside count as one.
#[test]
fn unknowns_that_depend_on_each_other_count_as_one() {
    let shares: Vec<f64> = (0..100).map(|i| f64::from(u8::from(i % 10 > 0))).collect();
    let together = clustered(0.9, 450, 500, &shares, 5);
    let one = interval(90.0, 100.0, 0.95);
    assert!((together.interval[0] - one[0]).abs() < 0.01, "{together:?} {one:?}");
    let apart: Vec<f64> = vec![0.9; 100];
    let free = clustered(0.9, 450, 500, &apart, 5);
    let all = interval(450.0, 500.0, 0.95);
    assert!((free.interval[0] - all[0]).abs() < 1e-9);
}

/// Unknowns whose truths were not drawn from the prior are shown and do not enter the verdict.
#[test]
fn truths_that_are_not_of_the_prior_judge_nothing() {
    let coordinates = [coordinate("a"), Coordinate { of_prior: false, ..coordinate("b") }];
    let mut all = cases(200, 2, 1.0);
    for case in &mut all {
        if let Ended::Calibrated(calibration) = &mut case.ended {
            calibration.unknowns[1].truth += 10.0;
        }
    }
    let found = tally(&coordinates, &all);
    assert_eq!(found.verdict.word, Word::Nominal, "{}", found.verdict.text);
    assert_eq!((found.rows[1].levels[2].inside, found.rows[1].uniform), (0, None));
    assert_eq!(found.overall.unwrap().levels[2].of, 200);
}

/// Intervals that miss only truths in the tails of the prior have nominal coverage overall, and are reported as too
/// narrow there.
#[test]
fn misses_at_the_edges_are_told() {
    let mut all = cases(400, 1, 1.0);
    let coordinate = coordinate("a");
    for case in &mut all {
        if let Ended::Calibrated(calibration) = &mut case.ended {
            let judged = &mut calibration.unknowns[0];
            // A quarter of the truths at an edge is moved out of its intervals; others are moved in to compensate.
            if judged.is_at_edge(&coordinate) {
                if case.number % 4 == 0 {
                    judged.intervals[2] = judged.intervals[2].map(|x| x - 9.0);
                }
            } else {
                judged.intervals[2] = [judged.truth - 1.0, judged.truth + 1.0];
            }
        }
    }
    let found = tally(&[coordinate], &all);
    assert_eq!(found.verdict.word, Word::TooNarrow, "{}", found.verdict.text);
    assert!(found.verdict.text.contains("at the edges"), "{}", found.verdict.text);
}
