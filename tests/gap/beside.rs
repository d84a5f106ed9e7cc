//! Beside the search, on the chain of two masses: which level is wrong, what is foretold, what bridges and what separates.

use generator::{Case, Kind, REFERENCE, SENSORS};
use lacuna::gap::candidates::{Candidate, proposed};
use lacuna::gap::drift::{self, Reading, drift};
use lacuna::gap::experiment::Experiment;
use lacuna::gap::fit::fit;
use lacuna::gap::name::{Desk, Found, LeftOut, Options, Rival, What, foretell, search, separate};
use lacuna::gap::noise::{Around, Noise};
use lacuna::gap::system::System;
use lacuna::gap::unlisted::{describe, stopgap, symbolic};
use lacuna::gap::whitener::{Whitener, condensed};
use lacuna::linalg::Matrix;
use lacuna::math::random::Stream;
use lacuna::plugin::effect::Situation;

use crate::chain::{emulator, layouts, observations, parameters};

/// Hands over a case as an experiment around its first response.
fn looked<T>(case: &Case, use_it: impl FnOnce(&Experiment<'_>, &[f64]) -> T) -> T {
    let (layouts, parameters) = (layouts(), parameters());
    let (emulator, error) = emulator();
    let data = observations(case, 0..case.replicates[0].len());
    let mut experiment = Experiment::new(&layouts, &parameters, &**emulator, &data);
    let response = emulator.mean(&Matrix::from_rows(4, [REFERENCE])).row(0).to_vec();
    experiment.common = vec![error.clone()];
    let noise = Noise::of(&experiment, &Around::fixed(&response), None);
    experiment.common = condensed(&experiment, &noise, &response);
    use_it(&experiment, &response)
}

/// Hands over what the search finds in a case, with the noise and the fit before.
fn searched<T>(
    case: &Case,
    names: &[&str],
    use_it: impl FnOnce(&Experiment<'_>, &[Candidate], &Found<'_>) -> T,
) -> T {
    looked(case, |experiment, response| {
        let noise = Noise::of(experiment, &Around::fixed(response), None);
        let sd = noise.sd(experiment, response);
        let situation = Situation { layouts: experiment.layouts, response, noise: &sd };
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let candidates = proposed(Some(&names), &situation).unwrap();
        let options = Options { naming: 0.03, unlisted: 0.02, simulations: 99, most: 1 };
        let starts = [REFERENCE.to_vec()];
        let found = search(experiment, &candidates, &starts, options, &Stream::root(1)).unwrap();
        use_it(experiment, &candidates, &found)
    })
}

/// The reading of a case without any effect.
fn reading(case: &Case) -> (Reading, String) {
    looked(case, |experiment, response| {
        let system = System::new(experiment, Vec::new());
        let (_, means) = experiment.means();
        let noise = Noise::of(experiment, &Around::fixed(response), None);
        let whitener = Whitener::new(experiment, &noise, response);
        let found = fit(&system, &whitener, &means, &REFERENCE);
        let noise = Noise::of(experiment, &Around::fixed(&found.at.response), None);
        let whitener = Whitener::new(experiment, &noise, &found.at.response);
        let found = fit(&system, &whitener, &means, &found.at.point);
        let options = drift::Options { simulations: 99, ..drift::Options::default() };
        let map = drift(&system, &found, &noise, &whitener, options, &Stream::root(2)).unwrap();
        (map.reading, map.words)
    })
}

/// Flaws of the chain are read as the model's, those of a sensor as its own, and none as none.
#[test]
fn the_level_of_a_flaw_is_read() {
    let (mut right, mut count) = (0, 0);
    let mut judge = |kind: Option<Kind>, sensors: Vec<usize>| {
        let hidden: Vec<(Kind, Vec<usize>)> =
            kind.map(|k| (k, sensors.clone())).into_iter().collect();
        let (reading, words) = reading(&generator::case(900, &hidden, 1.0, 8));
        let model = matches!(kind, Some(Kind::Drag | Kind::Cubic | Kind::Switching));
        let fits = match &reading {
            Reading::None => kind.is_none(),
            Reading::Model { .. } => model,
            Reading::Response { on } => {
                kind.is_some() && !model && on["sensor"] == [SENSORS[sensors[0]]]
            }
            Reading::Either { .. } => false,
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

/// The true name foretells conditions and replicates better than none; a delay and a filter are told apart by what is
/// ranked first.
#[test]
fn a_right_name_foretells() {
    let case = generator::case(77, &[(Kind::Delay, vec![1])], 1.0, 8);
    searched(&case, &["delay", "low_pass", "offset"], |experiment, candidates, found| {
        let base = found.path[0].before.fit.clone();
        let none = System::new(experiment, Vec::new());
        let judged = &found.path[0].judged;
        let winner = Rival { system: &found.system, fit: &found.last.fit };
        let without = Rival { system: &none, fit: &base };
        for own in foretell(winner, without, &found.noise, judged.len()) {
            println!("against none: {own:?}");
            if matches!(own.left_out, LeftOut::Condition | LeftOut::Replicate) {
                assert!(own.corrected > 0.0 && own.p.is_some_and(|p| p < 0.05), "{own:?}");
            }
        }
        let kind = |j: usize| &candidates[judged[j].suspect.candidate].kind;
        let other = (1..judged.len()).find(|&j| kind(j) != kind(0)).unwrap();
        let desk = Desk {
            system: &none,
            candidates,
            whitener: &found.whitener,
            means: &found.means,
            sensors: 4,
        };
        let system = desk.with(&judged[other].suspect);
        let second = Rival { system: &system, fit: &judged[other].fit };
        for own in foretell(winner, second, &found.noise, judged.len()) {
            println!("{} against {}: {own:?}", kind(0), kind(other));
        }
        let apart = separate(&[winner, second], &found.noise).unwrap();
        println!("now {}", apart.now);
        apart.ranked.iter().take(6).for_each(|own| println!("{own:?}"));
        assert!(apart.ranked.iter().any(|own| matches!(own.what, What::Condition { .. })));
    });
}

/// A burst that no candidate has is described, bridged, and given a form that is told with what chance would give.
#[test]
fn what_has_no_name_is_bridged() {
    let case = generator::case(78, &[(Kind::Burst, vec![2])], 1.5, 8);
    searched(&case, &["gain"], |experiment, _, found| {
        let look = found.path.first().map_or(&found.last, |step| &step.before);
        for region in &look.regions {
            println!("{}", describe(experiment, region, &look.statistics.left).words);
        }
        let system = System::new(experiment, Vec::new());
        let excess = look.statistics.energy - look.expected_energy;
        let (noise, whitener) = (&found.noise, &found.whitener);
        let bridged = stopgap(&system, &look.fit, noise, whitener, &look.regions, excess).unwrap();
        println!("explained {} log evidence {}", bridged.explained, bridged.log_evidence);
        assert!(bridged.explained > 0.5);
        let stream = Stream::root(3);
        let form = symbolic(&system, &look.fit, whitener, &look.regions, excess, 99, &stream);
        println!("{form:?}");
    });
}
