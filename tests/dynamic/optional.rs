//! Functions that a library may leave out: without them a plugin has the defaults of a plugin in the source tree, and
//! their results are checked.

use lacuna::data::statistics::Kind;
use lacuna::data::{Axis, Layout, Parameter, Scenario, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::forward::Wanted;
use lacuna::plugin::model::Call;
use lacuna::plugin::reader::MeasurementSource;
use lacuna::plugin::registry::Built;
use lacuna::plugin::sampler::Start;
use lacuna::plugin::{
    Component, Design, Discrepancy, Model, Reader, Sampler, Surrogate, surrogate,
};
use lacuna_linalg::Matrix;

use super::hostile::{data, likelihood, misbehaving as discrepancy};
use super::unruly::{Flat, fitted, misbehaving};

/// Requires that the error contains these words and the file of the library.
fn is_told(error: &impl std::fmt::Display, library: &str, words: &str) {
    let said = error.to_string();
    assert!(said.contains(words) && said.contains(&format!("lib{library}.so")), "{said}");
}

/// Functions added in version 1.1 are absent in a library of version 1.0, whatever bytes follow its tables.
#[test]
fn a_library_of_the_first_version_does_what_it_did() {
    let part = |built: &Built<dyn Discrepancy>| {
        let data = data();
        let made = built.plugin.likelihood_of_part(&Known::without_slopes(&data, &[]), &data);
        made.map(|made| made.is_some()).map_err(|stop| stop.to_string())
    };
    let first = discrepancy("first_version", "FIRST_VERSION");
    assert_eq!(first.revision, 1);
    assert_eq!(part(&first), Ok(false));
    assert!(!first.plugin.takes_stated_noise());
    assert_eq!(likelihood(&first).unwrap().log_likelihood(&[0.0; 10], &[1.0]), -1.0);
    let second = discrepancy("second_version", "SOUND");
    assert_eq!(second.revision, 5);
    assert_eq!(second.revisions()["discrepancy.second_version"], 5);
    assert_eq!(part(&second), Ok(true));
    assert!(second.plugin.takes_stated_noise());
    for built in [first, second] {
        assert_eq!(built.plugin.faults()[0].said(), None);
    }
}

#[test]
fn the_likelihood_of_a_part_is_checked() {
    for (name, define, expected) in [
        ("part_stops", "PART_STOPS", Err("no part is whole")),
        ("part_absent", "PART_ABSENT", Ok(())),
        ("part_nothing", "PART_MAKES_NOTHING", Err("its likelihood has no functions")),
        ("part_lacks", "LIKELIHOOD_LACKS", Err("its likelihood has no function `gradient`")),
    ] {
        let built = discrepancy(name, define);
        let data = data();
        let made = built.plugin.likelihood_of_part(&Known::without_slopes(&data, &[]), &data);
        match (made, expected) {
            (Ok(made), Ok(())) => assert!(made.is_none()),
            (Err(stop), Err(expected)) => {
                let who = format!("discrepancy `{name}` of lib{name}.so: {expected}");
                assert_eq!(stop.message, who);
            }
            (made, _) => panic!("{name}: {:?}", made.map(|made| made.is_some())),
        }
    }
}

#[test]
fn whether_stated_noise_is_used_is_checked() {
    for (name, define, expected) in [
        ("takes_stops", "TAKES_STOPS", "who knows"),
        ("odd_takes", "ODD_TAKES", "gives 7 as mark 1 of 1, expected 0 or 1"),
        ("no_takes", "NO_TAKES", "gives 255 as mark 1 of 1, expected 0 or 1"),
    ] {
        let built = discrepancy(name, define);
        assert!(!built.plugin.takes_stated_noise());
        let faults = built.plugin.faults();
        let said = faults[0].said().unwrap();
        assert!(said.contains(expected) && said.contains(&format!("lib{name}.so")), "{said}");
    }
}

/// The fault of a plugin, which names its library.
fn fault(plugin: &dyn Component, name: &str) -> String {
    let faults = plugin.faults();
    let said = faults[0].said().unwrap_or_else(|| panic!("{name} has no fault"));
    assert!(said.contains(&format!("`{name}` of lib{name}.so: ")), "{said}");
    said.to_owned()
}

#[test]
fn what_a_sampler_says_of_its_starts_and_draws_is_checked() {
    let (sound, _folder) = misbehaving::<dyn Sampler>("says_soundly", "SOUND");
    assert!(!sound.uses_starts() && sound.steps_are_draws());
    assert_eq!(sound.start_where(), Start::Sobol);
    assert_eq!(sound.faults()[0].said(), None);
    let uses: fn(&dyn Sampler) = |s| assert!(s.uses_starts());
    let starts: fn(&dyn Sampler) = |s| assert_eq!(s.start_where(), Start::Map);
    let draws: fn(&dyn Sampler) = |s| assert!(!s.steps_are_draws());
    for (name, define, ask, expected) in [
        ("odd_uses", "ODD_USES", uses, "`uses_starts` gives 2 as mark 1 of 1, expected 0 or 1"),
        ("no_uses", "NO_USES", uses, "`uses_starts` gives 255 as mark 1 of 1, expected 0 or 1"),
        (
            "nowhere",
            "STARTS_NOWHERE",
            starts,
            "`start_where` answers no start: unknown variant `nowhere`, expected one of `map`, `prior`",
        ),
        ("unsaid", "STARTS_UNSAID", starts, "`start_where` answers no start: unknown variant ``"),
        ("odd_draws", "ODD_DRAWS", draws, "`steps_are_draws` gives 9 as mark 1 of 1"),
        ("draws_stop", "DRAWS_STOP", draws, "draws or not"),
    ] {
        let (sampler, _folder) = misbehaving::<dyn Sampler>(name, define);
        ask(&*sampler);
        let said = fault(&*sampler, name);
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn statistics_of_a_sampler_are_checked() {
    let state = |sampler: &dyn Sampler| sampler.start(&Flat, Matrix::zeros(2, 1)).unwrap();
    let (sound, _folder) = misbehaving::<dyn Sampler>("tells_soundly", "SOUND");
    let told = sound.statistics(&state(&*sound));
    let told: Vec<_> = told.iter().map(|s| (&*s.name, s.kind, &*s.values)).collect();
    assert_eq!(told, [("a", Kind::Flag, &[0.0, 1.0][..]), ("b", Kind::Count, &[3.0, 4.0])]);
    assert_eq!(sound.faults()[0].said(), None);
    for (name, define, expected) in [
        ("odd_flag", "ODD_FLAG", "`statistics` gives 0.5 as `a`, expected 0 or 1"),
        ("odd_count", "ODD_COUNT", "`statistics` gives -4 as `b`, expected a whole number"),
        ("odd_kind", "ODD_KIND", "`statistics` answers JSON that cannot be read"),
        ("same_names", "SAME_NAMES", "statistic 2 is called `a`, expected a name of its own"),
        ("short_told", "SHORT_STATISTICS", "answers 2 rows of 1 numbers where 2 of 2 belong"),
        ("few_told", "FEW_STATISTICS", "answers 1 rows of 2 numbers where 2 of 2 belong"),
        ("none_told", "NO_STATISTICS", "`statistics` answers 0 matrices where 1 belong"),
    ] {
        let (sampler, _folder) = misbehaving::<dyn Sampler>(name, define);
        assert_eq!(sampler.statistics(&state(&*sampler)), []);
        let said = fault(&*sampler, name);
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn a_response_with_its_derivatives_is_checked() {
    for (name, define, expected) in [
        ("both", "SOUND", Some(Ok(()))),
        ("both_absent", "BOTH_ABSENT", None),
        ("both_rejected", "BOTH_REJECTED", Some(Err("not both"))),
        (
            "both_unsaid",
            "BOTH_SAY_TOO_MUCH",
            Some(Err("`with_response` says something of 2 calls")),
        ),
        ("both_flat", "NO_SLOPES", Some(Err("`with_response` gives no number as value 1 of 3"))),
        ("both_unmarked", "NO_MARK", Some(Err("`with_response` gives 255 as mark 1 of 1"))),
        ("both_empty", "NO_VALUE", Some(Err("`with_response` gives NaN as value 1 of 1"))),
    ] {
        let (model, _folder) = misbehaving::<dyn Model>(name, define);
        let names = ["a", "b", "c"].map(str::to_owned);
        let (layout, scenario) = (Layout::number("y"), Scenario::default());
        let call = Call::new(&[1.0, 2.0, 3.0], &names, &layout, &scenario);
        match (model.gradient().unwrap().with_response(&call), expected) {
            (None, None) => {}
            (Some(Ok((response, slopes))), Some(Ok(()))) => {
                assert_eq!((response.values, response.valid), (vec![1.0], true));
                assert_eq!(slopes, Matrix::from_vec(1, 3, vec![2.0; 3]));
            }
            (Some(Err(error)), Some(Err(expected))) => {
                is_told(&error, name, expected);
            }
            (found, _) => panic!("{name}: {found:?}"),
        }
    }
}

#[test]
fn a_sum_of_emulators_is_checked_and_ended_once() {
    let parts = [surrogate::Summand { bytes: b"", weights: &[1.0] }];
    for (name, define, expected, ended) in [
        ("adds", "SOUND", Ok(true), "e"),
        ("adds_not", "SUM_ABSENT", Ok(false), ""),
        ("adds_up", "SUM_STOPS", Err("nothing adds up"), ""),
        ("adds_nothing", "SUM_OF_NOTHING", Err("its emulator has no functions"), ""),
        ("adds_lacking", "EMULATOR_LACKS", Err("its emulator has no function `save`"), "e"),
        ("adds_widely", "WIDE_SUM", Err("an emulator of 2 outputs where 1 belong"), "e"),
        // Error estimates of a sum are meaningless.
        ("adds_unjudged", "WIDE_ERRORS", Ok(true), "e"),
    ] {
        let (surrogate, folder) = misbehaving::<dyn Surrogate>(name, define);
        let sum = surrogate.sum(&parts, &[0.0]).map(|sum| sum.is_some());
        match (sum, expected) {
            (Ok(found), Ok(expected)) => assert_eq!(found, expected, "{name}"),
            (Err(stop), Err(expected)) => {
                let said = stop.message;
                assert!(
                    said.contains(expected) && said.contains(&format!("lib{name}.so")),
                    "{said}"
                );
            }
            (found, _) => panic!("{name}: {found:?}"),
        }
        let found = std::fs::read_to_string(folder.path().join("ended")).unwrap_or_default();
        assert_eq!(found, ended, "{name}");
    }
}

#[test]
fn means_with_derivatives_are_checked() {
    for (name, define, expected) in [
        ("means", "SOUND", None),
        ("no_means", "NO_MEANS", Some("`mean_and_jacobian` gives no number as value 1 of 1")),
        (
            "no_slopes",
            "NO_EMULATOR_SLOPES",
            Some("`mean_and_jacobian` gives no number as value 1 of 1"),
        ),
    ] {
        let (surrogate, _folder) = misbehaving::<dyn Surrogate>(name, define);
        let emulator = fitted(&*surrogate).unwrap();
        let (both, some) = (
            emulator.mean_and_jacobian(&[0.5]),
            emulator.mean_and_jacobian_by(&[0.5], Wanted::by(&[0])),
        );
        if let Some(expected) = expected {
            let said = emulator.failure().unwrap();
            assert!(said.contains(expected) && said.contains(&format!("lib{name}.so")), "{said}");
        } else {
            assert_eq!(both, (vec![7.0], Matrix::from_vec(1, 1, vec![1.0])));
            assert_eq!(some, (vec![7.0], Matrix::from_vec(1, 1, vec![2.0])));
            assert_eq!(emulator.failure(), None);
        }
    }
}

#[test]
fn further_points_of_a_design_are_checked() {
    let parameters =
        ["a", "b"].map(|name| Parameter::plain(name, Distribution::Uniform([0.0, 1.0])));
    let fixed = "this design cannot be extended without moving its points";
    for (name, define, expected) in [
        ("grows", "SOUND", Ok(())),
        ("grows_not", "EXTEND_ABSENT", Err((fixed, Some("a greater number of `runs`")))),
        ("grows_full", "EXTEND_STOPS", Err(("libgrows_full.so: it is full", Some("begin anew")))),
        (
            "grows_blank",
            "EXTEND_UNWRITTEN",
            Err(("`extend` gives no number as value 1 of 6", None)),
        ),
        ("grows_out", "EXTEND_OUTSIDE", Err(("lies outside the open unit cube, at 1", None))),
    ] {
        let (design, _folder) = misbehaving::<dyn Design>(name, define);
        let known = Matrix::from_vec(1, 2, vec![0.5; 2]);
        match (design.extend(&parameters, &known, 3, &Stream::root(1)), expected) {
            (Ok(points), Ok(())) => assert_eq!(points, Matrix::from_vec(3, 2, vec![0.5; 6])),
            (Err(stop), Err((message, help))) => {
                assert!(stop.message.ends_with(message), "{stop}");
                let found = stop.help.unwrap_or_default();
                assert!(help.map_or(found.is_empty(), |help| found.contains(help)), "{found}");
            }
            (found, _) => panic!("{name}: {found:?}"),
        }
    }
}

#[test]
fn noise_that_a_reader_states_is_checked() {
    let axes = vec![Axis::labels("sensor", ["A", "B"])];
    let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
    let source = MeasurementSource { directory: ".".as_ref(), scenario: None, layout: &layout };
    for (name, define, expected) in [
        ("states", "SOUND", Ok(true)),
        ("states_none", "NO_DEVIATIONS", Ok(false)),
        ("states_part", "PART_OF_A_DEVIATION", Err("answers the standard deviation NaN")),
        ("states_below", "DEVIATION_BELOW_ZERO", Err("answers the standard deviation -0.4")),
        ("states_few", "FEW_DEVIATIONS", Err("answers 1 rows of 2 numbers where 2 of 2 belong")),
        (
            "states_askew",
            "ASKEW_COVARIANCE",
            Err("answers 0.4 and 0.5 as the covariance of outputs 1 and 2"),
        ),
        ("states_minus", "VARIANCE_BELOW_ZERO", Err("answers the variance -1")),
        ("states_endless", "ENDLESS_COVARIANCE", Err("gives inf as value 1 of 4")),
        ("states_wide", "WIDE_COVARIANCE", Err("answers 1 rows of 4 numbers where 2 of 2 belong")),
        ("states_less", "NO_COVARIANCE", Err("answers 2 matrices where 3 belong")),
    ] {
        let (reader, _folder) = misbehaving::<dyn Reader>(name, define);
        match (reader.measurements(&source), expected) {
            (Ok(read), Ok(second)) => {
                let sd = [Some(vec![0.1, 0.2]), second.then(|| vec![0.3, 0.4])];
                assert_eq!([read.replicates[0].sd.clone(), read.replicates[1].sd.clone()], sd);
                let covariance = Matrix::from_vec(2, 2, vec![1.0, 0.5, 0.5, 1.0]);
                assert_eq!(read.covariance, Some(covariance));
            }
            (Err(error), Err(expected)) => {
                is_told(&error, name, expected);
            }
            (found, _) => panic!("{name}: {found:?}"),
        }
    }
}

#[test]
fn the_number_of_runs_that_may_fail_is_checked() {
    for (name, define, expected) in [
        ("fails", "SOUND", Ok(3)),
        ("fails_stop", "FAILURES_STOP", Err("none or all")),
        ("fails_unsaid", "NO_FAILURES", Err("`allowed_failures` gives no number of runs")),
    ] {
        let (reader, _folder) = misbehaving::<dyn Reader>(name, define);
        match (reader.allowed_failures(7), expected) {
            (Some(found), Ok(expected)) => assert_eq!(found, expected),
            (None, Err(expected)) => {
                let said = fault(&*reader, name);
                assert!(said.contains(expected), "{said}");
            }
            (found, _) => panic!("{name}: {found:?}"),
        }
    }
}
