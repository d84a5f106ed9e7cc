//! Checks of replicates, of data against runs, of fits and residuals.

use super::*;
use crate::assess::envelope::Beside;
use crate::assess::fit::Against;
use crate::assess::replicates::Curves;

const NAMES: [&str; 12] = ["1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12"];

fn measured(seed: u64, count: usize) -> Vec<Vec<f64>> {
    let mut rng = Stream::root(seed).named("curves").generator();
    let mut curve =
        || (0..30).map(|t| (0.3 * f64::from(t)).sin() + 0.1 * normal(&mut rng)).collect();
    (0..count).map(|_| curve()).collect()
}

fn curves(values: &[Vec<f64>]) -> Curves<'static> {
    let some = |curve: &Vec<f64>| curve.iter().copied().map(Some).collect();
    NAMES.into_iter().zip(values.iter().map(some)).collect()
}

fn duplicates(values: &[Vec<f64>]) -> Option<Finding> {
    replicates::duplicates("A", &curves(values), values.len())
}

#[test]
fn copies_and_means_among_replicates() {
    let mut sound = measured(1, 10);
    assert_eq!(duplicates(&sound), None);
    assert_eq!(replicates::symmetric("A", &curves(&sound)), None);
    let copies = vec![sound[0].clone(); 10];
    let found = duplicates(&copies);
    has(found.as_ref(), "duplicate_replicates", Severity::Failure);
    assert_eq!(found.unwrap().figure, Some(9.0));
    sound[7] = sound[2].clone();
    let found = duplicates(&sound);
    has(found.as_ref(), "duplicate_replicates", Severity::Reservation);
    // The constant signal of a dead sensor is not a copy.
    let dead = vec![vec![0.0; 30]; 4];
    assert_eq!(duplicates(&dead), None);
}

#[test]
fn a_mean_with_its_interval_is_no_replicate() {
    let values = measured(2, 8);
    let mean = |t: usize| values.iter().map(|c| c[t]).sum::<f64>() / 8.0;
    // Rounded to three decimals, as in a table.
    let round = |y: f64| (1e3 * y).round() / 1e3;
    let shifted = |by: f64| (0..30).map(|t| round(mean(t) + by)).collect::<Vec<f64>>();
    let three = vec![shifted(0.0), shifted(-0.196), shifted(0.196)];
    let found = replicates::symmetric("A", &curves(&three));
    has(found.as_ref(), "symmetric_replicates", Severity::Failure);
    let mut with_mean = values.clone();
    with_mean.push(shifted(0.0));
    let found = replicates::symmetric("A", &curves(&with_mean));
    has(found.as_ref(), "symmetric_replicates", Severity::Failure);
    assert!(found.unwrap().message.contains("`9` is the mean of all others"));
}

#[test]
fn curves_left_out_and_added() {
    assert_eq!((replicates::left_out(0, 160), replicates::added(0, 16)), (None, None));
    has(replicates::left_out(3, 160).as_ref(), "left_out_curves", Severity::Note);
    has(replicates::left_out(100, 160).as_ref(), "left_out_curves", Severity::Failure);
    has(replicates::added(3, 16).as_ref(), "added_curves", Severity::Reservation);
}

/// Runs of a line of unknown slope, and data of one of them in some unit.
fn beside(unit: f64, shift: f64) -> Beside {
    let times: Vec<f64> = (1..=20).map(|t| f64::from(t) / 20.0).collect();
    let run = |slope: f64| times.iter().map(|t| slope * t).collect::<Vec<f64>>();
    let all: Vec<Vec<f64>> = (0..40).map(|i| run(1.0 + f64::from(i) / 40.0)).collect();
    let mut rng = Stream::root(3).generator();
    let datum = |y: f64, rng: &mut _| (unit * (y + 0.01 * normal(rng)) + shift, unit * 0.01);
    let data = run(1.4).into_iter().map(|y| datum(y, &mut rng)).collect();
    let range = |t: usize| {
        let values = all.iter().map(|run| run[t]);
        (values.clone().fold(f64::INFINITY, f64::min), values.fold(0.0, f64::max))
    };
    let size = |run: &Vec<f64>| (run.iter().map(|y| y * y).sum::<f64>() / 20.0).sqrt();
    Beside {
        name: "A".to_owned(),
        data,
        runs: (0..20).map(range).collect(),
        sizes: all.iter().map(size).collect(),
    }
}

#[test]
fn data_in_another_unit_or_beyond_all_runs() {
    assert_eq!(envelope::outside(&beside(1.0, 0.0)), None);
    let small = envelope::outside(&beside(1e-3, 0.0)).unwrap();
    has(Some(&small), "data_outside_runs", Severity::Failure);
    assert!(small.message.contains("1000 times too small"), "{}", small.message);
    assert!(small.message.contains("unit"));
    let large = envelope::outside(&beside(1e3, 0.0)).unwrap();
    assert!(large.message.contains("1000 times too large"), "{}", large.message);
    let shifted = envelope::outside(&beside(1.0, 1.5));
    has(shifted.as_ref(), "data_outside_runs", Severity::Failure);
    assert_eq!(envelope::unanswered(0, 64), None);
    has(envelope::unanswered(10, 64).as_ref(), "model_without_answer", Severity::Reservation);
}

#[test]
fn a_fit_that_is_worse_than_the_reference() {
    let against = |map, reference| Against {
        log_likelihood: (map, reference),
        rmse: (36.7, 35.0),
        simulated: true,
    };
    assert_eq!(fit::reference(&against(-100.0, -100.5)), None);
    has(
        fit::reference(&against(-105.0, -100.0)).as_ref(),
        "no_better_than_reference",
        Severity::Reservation,
    );
    has(
        fit::reference(&against(-900.0, -100.0)).as_ref(),
        "no_better_than_reference",
        Severity::Failure,
    );
}

#[test]
fn a_model_that_could_not_have_made_the_data() {
    assert_eq!(fit::model_form(0.5, 1.0), None);
    has(fit::model_form(5.0, 1.0).as_ref(), "model_form", Severity::Failure);
    assert_eq!((fit::covered(950, 1000), fit::covered(17, 20)), (None, None));
    has(fit::covered(700, 1000).as_ref(), "predictive_check", Severity::Failure);
    has(fit::covered(870, 1000).as_ref(), "predictive_check", Severity::Reservation);
    assert_eq!(fit::accurate(0.9), None);
    has(fit::accurate(0.25).as_ref(), "predictive_check", Severity::Failure);
    let mut rng = Stream::root(5).generator();
    let mut expected = || (0..50).map(|_| normal(&mut rng).powi(2)).sum::<f64>() / 50.0;
    let simulated: Vec<f64> = (0..200).map(|_| expected()).collect();
    let alarms = (0..100).filter(|_| fit::misfit(expected(), &simulated).is_some()).count();
    assert!(alarms <= 5, "{alarms} of 100, where 1 is expected");
    has(fit::misfit(25.0, &simulated).as_ref(), "predictive_check", Severity::Failure);
    // The logarithm of a mean square of fifty values has standard deviation 0.2: a ratio of 2.5 is 4.6 of them; for ten
    // values (0.47) it is 1.9.
    has(fit::misfit(2.6, &simulated).as_ref(), "predictive_check", Severity::Failure);
    let mut few = || (0..10).map(|_| normal(&mut rng).powi(2)).sum::<f64>() / 10.0;
    let of_few: Vec<f64> = (0..200).map(|_| few()).collect();
    has(fit::misfit(3.5, &of_few).as_ref(), "predictive_check", Severity::Reservation);
}

#[test]
fn data_on_which_the_posterior_hangs() {
    assert_eq!(influence::influential(0, 100), None);
    has(influence::influential(2, 100).as_ref(), "influential_data", Severity::Note);
    has(influence::influential(30, 100).as_ref(), "influential_data", Severity::Reservation);
}

/// Twenty replicates of 200 independent values: F has a standard deviation of 0.10 about one.
#[test]
fn a_mean_that_the_scatter_of_the_replicates_does_not_explain() {
    let simulated = [0.9, 1.0, 1.1];
    assert_eq!(fit::scatter(1.2, &simulated, 200.0, 20.0), None);
    has(
        fit::scatter(6.0, &simulated, 200.0, 20.0).as_ref(),
        "predictive_check",
        Severity::Reservation,
    );
    // A discrepancy that itself produces such data accounts for them; few independent values prove nothing.
    assert_eq!(fit::scatter(6.0, &[5.0, 7.0], 200.0, 20.0), None);
    assert_eq!(fit::scatter(6.0, &simulated, 1.0, 20.0), None);
}

#[test]
fn residuals_that_stay_alike() {
    let simulated: Vec<f64> = (0..40).map(|i| 0.9 + 0.005 * f64::from(i)).collect();
    assert_eq!(residuals::correlated(1.05, &simulated, 1000), None);
    has(
        residuals::correlated(5.0, &simulated, 1000).as_ref(),
        "correlated_residuals",
        Severity::Reservation,
    );
    has(
        residuals::correlated(30.0, &simulated, 1000).as_ref(),
        "correlated_residuals",
        Severity::Failure,
    );
}
