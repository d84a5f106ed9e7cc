//! Evidences and shares of separate peaks against closed forms.

use lacuna::math::moments::{mean, variance};
use lacuna::plugin::Target;
use rayon::prelude::*;

use super::super::known_evidence::{Calibration, Known, regression, shells, two_data};
use super::super::truth::{Density, assert_mean, run};
use super::*;

fn with(steps: usize) -> ParallelTempering {
    ParallelTempering { walkers: 40, temperatures: 8, steps, warm_up: 300 }
}

#[test]
fn it_keeps_the_contract_of_samplers() {
    let sampler = ParallelTempering { walkers: 20, temperatures: 4, steps: 1000, warm_up: 200 };
    assert_eq!(lacuna_contract::sampler("parallel_tempering", &sampler), Ok(()));
}

/// The last state of a run from starting points of finite density.
fn ended(sampler: &ParallelTempering, target: &dyn Target, seed: u64) -> State {
    let root = Stream::root(seed);
    let drawn = target.prior_draws(100 * sampler.walkers, &root.named("start"));
    let inside = target.log_density(&drawn).into_iter().enumerate().filter(|(_, l)| l.is_finite());
    let rows: Vec<usize> = inside.map(|(i, _)| i).take(sampler.walkers).collect();
    let mut state = sampler.start(target, drawn.select_rows(&rows)).unwrap();
    for step in 0..sampler.steps {
        sampler.step(target, &mut state, &root.named("step").at(step as u64)).unwrap();
    }
    state
}

/// Evidences of many runs against the truth, with their stated errors.
fn calibration(sampler: &ParallelTempering, target: &Known, runs: usize) -> Calibration {
    let one = |seed: u64| {
        let state = ended(sampler, target, seed);
        let found = sampler.evidence(&state).unwrap();
        assert!(sampler.doubts(&state).is_empty(), "{:?}", sampler.doubts(&state));
        (found.log - target.log_evidence, found.error, state.evaluations as f64)
    };
    let found: Vec<(f64, f64, f64)> = (0..runs as u64).into_par_iter().map(one).collect();
    let of = |f: fn(&(f64, f64, f64)) -> f64| found.iter().map(f).collect::<Vec<f64>>();
    let standardised = of(|x| x.0 / x.1);
    Calibration {
        runs,
        bias: mean(&of(|x| x.0)),
        standardised: (mean(&standardised), variance(&standardised).sqrt()),
        error: mean(&of(|x| x.1)),
        evaluations: mean(&of(|x| x.2)),
    }
}

/// Two data and a regression in closed form; shells by their published evidence.
#[test]
fn evidences_are_the_known_ones_within_their_errors() {
    for (name, target) in
        [("two data", two_data()), ("regression", regression()), ("shells", shells(2))]
    {
        let found = calibration(&with(1100), &target, 20);
        found.assert_close(name);
    }
}

/// Two normal peaks in three dimensions, fourteen widths apart, with shares of 0.3 and 0.7 of the mass.
#[test]
fn separate_peaks_have_their_shares() {
    let peak = |x: &[f64], centre: f64| -> f64 {
        let square: f64 = x.iter().map(|x| ((x - centre) / 0.5).powi(2)).sum();
        -0.5 * square - 1.5 * (std::f64::consts::TAU * 0.25).ln()
    };
    let priors = vec![lacuna::math::distribution::Distribution::Uniform([-10.0, 10.0]); 3];
    let mut target = Density::new(priors, |x: &[f64]| {
        if x.iter().any(|x| x.abs() > 10.0) {
            return f64::NEG_INFINITY;
        }
        let (a, b) = (0.3_f64.ln() + peak(x, -2.0), 0.7_f64.ln() + peak(x, 2.0));
        a.max(b) + (-(a - b).abs()).exp().ln_1p()
    });
    target.bounds = vec![(-10.0, 10.0); 3];
    let draws = run(&with(4000), &target, 4);
    assert_mean(("share", &draws, true), 0.7, 0.05, |x| f64::from(u8::from(x[0] > 0.0)));
    assert_mean(("mean", &draws, true), 0.8, 0.2, |x| x[1]);
}

/// Vousden, Farr and Mandel 2016: in equilibrium all neighbours exchange equally often.
#[test]
fn the_temperatures_adapt_until_all_exchange_equally() {
    let sampler = ParallelTempering { walkers: 40, temperatures: 6, steps: 2500, warm_up: 1500 };
    let state = ended(&sampler, &regression(), 9);
    let memory: Memory = population::remembered(&state).unwrap();
    let rates = memory.ladder.rates();
    let centre = mean(&rates);
    // A fraction over 1000 steps of 40 pairs, a few hundred of them independent, is known to about 0.03.
    assert!(rates.iter().all(|rate| (rate - centre).abs() < 0.1), "{rates:?}");
    assert!(memory.ladder.powers.is_sorted_by(|a, b| a > b), "{:?}", memory.ladder.powers);
}
