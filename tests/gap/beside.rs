//! Analyses beside the search, on the chain of two masses: the level that is wrong, predictive performance, unlisted
//! physics, discrimination.

use generator::{Case, Kind, REFERENCE, SENSORS};
use lacuna::math::random::Stream;
use lacuna::plugin::effect::Situation;
use lacuna_engine::gap::candidates::{Candidate, proposed};
use lacuna_engine::gap::drift;
use lacuna_engine::gap::drift::{DriftLevel, drift};
use lacuna_engine::gap::experiment::Experiment;
use lacuna_engine::gap::noise::{Noise, ResponseTangents};
use lacuna_engine::gap::search::{
    Explanation, FurtherData, LeftOut, SearchOptions, SearchResult, cross_validate, discriminate,
    search,
};
use lacuna_engine::gap::system::System;
use lacuna_engine::gap::system::fit::fit;
use lacuna_engine::gap::system::whitener::{Whitener, condensed};
use lacuna_engine::gap::unlisted::{describe, smooth, symbolic};
use lacuna_linalg::Matrix;

use super::chain::{emulator, layouts, observations, parameters};

/// Passes a case as an experiment around its first response.
fn looked<T>(case: &Case, use_it: impl FnOnce(&Experiment<'_>, &[f64]) -> T) -> T {
    let (layouts, parameters) = (layouts(), parameters());
    let (emulator, error) = emulator();
    let data = observations(case, 0..case.replicates[0].len());
    let mut experiment = Experiment::new(&layouts, &parameters, &**emulator, &data);
    let response = emulator.mean(&Matrix::from_rows(4, [REFERENCE])).row(0).to_vec();
    experiment.common = vec![error.clone()];
    let noise = Noise::of(&experiment, &ResponseTangents::fixed(&response), None);
    experiment.common = condensed(&experiment, &noise, &response);
    use_it(&experiment, &response)
}

/// Passes the result of the search in a case, with the noise and the fit before it.
fn searched<T>(
    case: &Case,
    names: &[&str],
    use_it: impl FnOnce(&Experiment<'_>, &[Candidate], &SearchResult<'_>) -> T,
) -> T {
    looked(case, |experiment, response| {
        let noise = Noise::of(experiment, &ResponseTangents::fixed(response), None);
        let sd = noise.sd(experiment, response);
        let situation = Situation { layouts: experiment.layouts, response, noise: &sd };
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let candidates = proposed(Some(&names), &[], &situation).unwrap().candidates;
        let options = SearchOptions { naming: 0.03, unlisted: 0.02, simulations: 99, most: 1 };
        let starts = [REFERENCE.to_vec()];
        let found = search(experiment, &candidates, &starts, options, &Stream::root(1)).unwrap();
        use_it(experiment, &candidates, &found)
    })
}

/// The reading of a case without any effect.
fn reading(case: &Case) -> (DriftLevel, String) {
    looked(case, |experiment, response| {
        let system = System::new(experiment, Vec::new());
        let (_, means) = experiment.means();
        let noise = Noise::of(experiment, &ResponseTangents::fixed(response), None);
        let whitener = Whitener::new(experiment, &noise, response);
        let found = fit(&system, &whitener, &means, &REFERENCE);
        let noise = Noise::of(experiment, &ResponseTangents::fixed(&found.at.response), None);
        let whitener = Whitener::new(experiment, &noise, &found.at.response);
        let found = fit(&system, &whitener, &means, &found.at.point);
        let options = drift::DriftOptions { simulations: 99, ..drift::DriftOptions::default() };
        let map = drift(&system, &found, &noise, &whitener, options, &Stream::root(2)).unwrap();
        (map.reading, map.words)
    })
}

/// Defects of the chain are attributed to the model, those of a sensor to the sensor, and none to nothing.
#[test]
fn the_level_of_a_flaw_is_read() {
    let (mut right, mut count) = (0, 0);
    let mut judge = |kind: Option<Kind>, sensors: Vec<usize>| {
        let hidden: Vec<(Kind, Vec<usize>)> =
            kind.map(|k| (k, sensors.clone())).into_iter().collect();
        let (reading, words) = reading(&generator::case(900, &hidden, 1.0, 8));
        let model = matches!(kind, Some(Kind::Drag | Kind::Cubic | Kind::Switching));
        let fits = match &reading {
            DriftLevel::None => kind.is_none(),
            DriftLevel::Model { .. } => model,
            DriftLevel::Response { on } => {
                kind.is_some() && !model && on["sensor"] == [SENSORS[sensors[0]]]
            }
            DriftLevel::Either { .. } | DriftLevel::Explained { .. } => false,
        };
        println!("{kind:?} {sensors:?} {}: {words}", if fits { "right" } else { "WRONG" });
        right += u64::from(fits);
        count += 1;
    };
    judge(None, Vec::new());
    for kind in [Kind::Drag, Kind::Cubic, Kind::Switching] {
        judge(Some(kind), vec![0, 1, 2, 3]);
    }
    for kind in [Kind::Gain, Kind::Offset, Kind::Delay, Kind::LevelJump, Kind::Burst] {
        judge(Some(kind), vec![kind as usize % 4]);
    }
    println!("{right} of {count} right");
    assert!(right + 2 >= count, "{right} of {count}");
}

/// The true effect predicts held-out conditions and replicates better than no effect; a delay and a filter are
/// distinguished by the recommended measurement.
#[test]
fn a_right_name_foretells() {
    let case = generator::case(77, &[(Kind::Delay, vec![1])], 1.0, 8);
    searched(&case, &["delay", "low_pass", "offset"], |experiment, candidates, found| {
        let base = found.path[0].before.fit.clone();
        let none = System::new(experiment, Vec::new());
        let weighed = &found.path[0].weighed;
        let winner = Explanation::exact(&found.system, &found.last.fit);
        let without = Explanation::exact(&none, &base);
        for own in cross_validate(winner, without, &found.noise, weighed.len()) {
            println!("against none: {own:?}");
            if matches!(own.left_out, LeftOut::Condition | LeftOut::Replicate) {
                assert!(own.corrected > 0.0 && own.p.is_some_and(|p| p < 0.05), "{own:?}");
            }
        }
        let kind = |j: usize| &candidates[weighed[j].placement.candidate].kind;
        let other = (1..weighed.len()).find(|&j| kind(j) != kind(0)).unwrap();
        let placement = &weighed[other].placement;
        let system = none.with(placement.placed(experiment, candidates, kind(other)));
        let second = Explanation::exact(&system, &weighed[other].fit);
        for own in cross_validate(winner, second, &found.noise, weighed.len()) {
            println!("{} against {}: {own:?}", kind(0), kind(other));
        }
        let apart = discriminate(&[winner, second], &found.noise).unwrap();
        println!("now {}", apart.now);
        apart.ranked.iter().take(6).for_each(|own| println!("{own:?}"));
        assert!(apart.ranked.iter().any(|own| matches!(own.what, FurtherData::Condition { .. })));
    });
}

/// A burst that is not among the candidates is described, fitted by a smooth curve, and given a form that is reported
/// with its chance level.
#[test]
fn what_has_no_name_is_bridged() {
    let case = generator::case(78, &[(Kind::Burst, vec![2])], 1.5, 8);
    searched(&case, &["gain"], |experiment, _, found| {
        let diagnostics = found.path.first().map_or(&found.last, |step| &step.before);
        for region in &diagnostics.regions {
            println!("{}", describe(experiment, region, &diagnostics.statistics.residual).words);
        }
        let system = System::new(experiment, Vec::new());
        let excess = diagnostics.statistics.energy - diagnostics.expected_energy;
        let (noise, whitener) = (&found.noise, &found.whitener);
        let bridged =
            smooth(&system, &diagnostics.fit, noise, whitener, &diagnostics.regions, excess)
                .unwrap();
        println!("explained {} log evidence {}", bridged.explained, bridged.log_evidence);
        assert!(bridged.explained > 0.5);
        let stream = Stream::root(3);
        let form = symbolic(
            &system,
            &diagnostics.fit,
            whitener,
            &diagnostics.regions,
            excess,
            99,
            &stream,
        );
        println!("{form:?}");
    });
}
