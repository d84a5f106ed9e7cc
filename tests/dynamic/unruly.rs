//! Misbehaving models, samplers and surrogates: each gives an error that names it.

use lacuna::data::{Layout, Layouts, Parameter, Scenario};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::model::{Call, EvalError};
use lacuna::plugin::registry::{self, Kind};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Emulator, Model, Sampler, Surrogate, Target};
use lacuna::run::{Progress, Silent};
use lacuna_engine::host::library;
use lacuna_linalg::Matrix;
use tempfile::TempDir;

use super::hostile::misguided;
use super::quick;

/// A plugin that misbehaves in one way, and the folder of its library.
pub fn misbehaving<K: Kind + ?Sized>(name: &str, define: &str) -> (Box<K>, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let library = misguided(folder.path(), "unruly.c", name, &[define]);
    library::load(&library, None).unwrap_or_else(|e| panic!("{e}"));
    let built = registry::from_text::<K>(name, "").unwrap_or_else(|e| panic!("{e}"));
    (built.plugin, folder)
}

#[test]
fn an_answer_of_a_model_is_checked() {
    for (name, define, expected) in [
        (
            "odd_status",
            "ODD_STATUS",
            Err((true, "gives a run the status 77, which has no meaning")),
        ),
        ("no_status", "NO_STATUS", Err((true, "`predict` has no answer and gives no reason"))),
        ("no_reason", "NO_REASON", Err((false, "`predict` has no answer and gives no reason"))),
        ("odd_mark", "ODD_MARK", Err((true, "gives 2 as mark 1 of 1, expected 0 or 1"))),
        ("no_mark", "NO_MARK", Err((true, "gives 255 as mark 1 of 1, expected 0 or 1"))),
        ("no_value", "NO_VALUE", Err((false, "`predict` gives NaN as value 1 of 1"))),
        ("too_much", "SAYS_TOO_MUCH", Err((true, "says something of 5 calls where there are 2"))),
        ("sound", "SOUND", Ok(())),
    ] {
        let (model, _folder) = misbehaving::<dyn Model>(name, define);
        let (layout, scenario) = (Layout::number("y"), Scenario::default());
        let call = Call::new(&[], &[], &layout, &scenario);
        for answer in model.predict_batch(&[call, call]) {
            let (answer, expected) = match (answer, expected) {
                (Ok(response), Ok(())) => {
                    assert_eq!(response.values, [1.0]);
                    continue;
                }
                (Err(EvalError::Fatal(message)), Err(expected)) => ((true, message), expected),
                (Err(EvalError::Rejected(message)), Err(expected)) => ((false, message), expected),
                (answer, _) => panic!("{name}: {answer:?}"),
            };
            assert_eq!(answer.0, expected.0, "{name}: {}", answer.1);
            let who = format!("model `{name}` of lib{name}.so: ");
            assert!(answer.1.starts_with(&who) && answer.1.contains(expected.1), "{}", answer.1);
        }
    }
}

/// A library that ends the program is named, and the program ends with an error.
#[test]
fn an_end_of_the_program_names_the_plugin() {
    for (define, said, code) in [
        ("EXITS", "error: model `ends` of libends.so ended the program by `exit`", Some(1)),
        ("ABORTS", "error: model `ends` of libends.so aborted the program", None),
    ] {
        let folder = tempfile::tempdir().unwrap();
        misguided(folder.path(), "unruly.c", "ends", &[define]);
        let ended = quick::command()
            .args(["plugins", "test", "libends.so"])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&ended.stderr);
        assert!(text.contains(said), "{text}");
        assert_eq!(ended.status.code(), code, "{text}");
    }
}

/// A constant density.
pub struct Flat;

impl Target for Flat {
    fn dimension(&self) -> usize {
        1
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }
    fn gradient(&self, _: &[f64]) -> (f64, Vec<f64>) {
        (0.0, vec![0.0])
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(0.0, 1.0)]
    }
    fn prior_draws(&self, count: usize, _: &Stream) -> Matrix {
        Matrix::zeros(count, 1)
    }
}

#[test]
fn a_state_of_a_sampler_is_checked() {
    for (name, define, expected) in [
        ("asks_nowhere", "ASKS_NOWHERE", "gives 2 rows of 1 numbers, and none is there"),
        ("asks_askew", "ASKS_ASKEW", "was asked at points of 7 coordinates in place of 1"),
        ("asks_for_all", "ASKS_FOR_ALL", "was asked for 9223372036854775807 draws"),
        ("endless_density", "ENDLESS_DENSITY", "`start` gives inf as value 1 of 2"),
        ("endless_point", "ENDLESS_POINT", "`start` gives -inf as value 1 of 2"),
        ("odd_accepted", "ODD_ACCEPTED", "`start` gives 3 as mark 2 of 2, expected 0 or 1"),
    ] {
        let (sampler, _folder) = misbehaving::<dyn Sampler>(name, define);
        let said = sampler.start(&Flat, Matrix::zeros(2, 1)).unwrap_err().message;
        let who = format!("sampler `{name}` of lib{name}.so: ");
        assert!(said.starts_with(&who) && said.contains(expected), "{said}");
    }
}

#[test]
fn a_plan_of_a_sampler_is_checked() {
    for (name, define, expected) in [
        ("endless_plan", "ENDLESS_PLAN", "steps, more than there can be"),
        ("empty_plan", "EMPTY_PLAN", "`plan` plans 2 chains of 0 steps"),
        ("odd_plan", "ODD_PLAN", "`plan` gives 9 as mark 1 of 1, expected 0 or 1"),
    ] {
        let (sampler, _folder) = misbehaving::<dyn Sampler>(name, define);
        assert_eq!(sampler.plan(1).steps, 0);
        let faults = sampler.faults();
        let said = faults[0].said().unwrap();
        assert!(said.contains(expected) && said.contains(&format!("lib{name}.so")), "{said}");
    }
}

pub fn fitted(surrogate: &dyn Surrogate) -> Result<Box<dyn Emulator>, String> {
    let parameters = [Parameter::plain("a", Distribution::Uniform([0.0, 1.0]))];
    let layouts = Layouts::from(Layout::number("y"));
    let (points, responses) = (Matrix::zeros(6, 1), Matrix::zeros(6, 1));
    let training = Training {
        parameters: &parameters,
        layouts: &layouts,
        points: &points,
        responses: &responses,
        gradients: None,
    };
    let fit = surrogate.fit(&training, &Stream::root(1), &Progress::new(&Silent));
    fit.map_err(|stop| stop.message)
}

#[test]
fn an_emulator_is_checked_and_ended_once() {
    for (name, define, expected) in [
        ("short_residuals", "SHORT_RESIDUALS", "answers 2 rows of 1 numbers where 6 of 1 belong"),
        ("wide_errors", "WIDE_ERRORS", "answers 1 rows of 3 numbers where 1 of 1 belong"),
        ("lacks", "EMULATOR_LACKS", "its emulator has no function `save`"),
        ("wide", "WIDE_EMULATOR", "where 1 of 2 belong"),
    ] {
        let name = format!("fits_{name}");
        let (surrogate, folder) = misbehaving::<dyn Surrogate>(&name, define);
        let said = fitted(&*surrogate).map(|_| ()).unwrap_err();
        let who = format!("surrogate `{name}` of lib{name}.so: ");
        assert!(said.starts_with(&who) && said.contains(expected), "{said}");
        let ended = std::fs::read_to_string(folder.path().join("ended")).unwrap();
        assert_eq!(ended, "e", "{name}");
    }
}

#[test]
fn a_linear_form_is_checked() {
    for (name, define, expected) in [
        ("none", "NO_COEFFICIENTS", "gives 2 rows of 1 numbers, and none is there"),
        ("wide", "WIDE_COEFFICIENTS", "`linear` answers 2 rows of 4 numbers where 2 of 1 belong"),
        ("endless", "ENDLESS_COEFFICIENTS", "more than there can be"),
    ] {
        let name = format!("linear_{name}");
        let (surrogate, _folder) = misbehaving::<dyn Surrogate>(&name, define);
        let emulator = fitted(&*surrogate).unwrap();
        assert!(emulator.linear().is_none());
        let said = emulator.failure().unwrap();
        assert!(said.contains(expected) && said.contains(&format!("lib{name}.so")), "{said}");
    }
}

#[test]
fn a_schema_and_a_complaint_may_say_anything() {
    misbehaving::<dyn Model>("circle", "SCHEMA_IN_A_CIRCLE");
    // A type that contains itself is infinite, but its description is finite.
    let manual = registry::find::<dyn Model>("circle").unwrap().documentation();
    let keys: Vec<&str> = manual.options.iter().map(|option| option.key.as_str()).collect();
    assert_eq!(keys, ["a", "b"]);

    let folder = tempfile::tempdir().unwrap();
    let library = misguided(folder.path(), "unruly.c", "far", &["FAR_COMPLAINT"]);
    library::load(&library, None).unwrap_or_else(|e| panic!("{e}"));
    let said = registry::from_text::<dyn Model>("far", "word = \"short\"").map(|_| ()).unwrap_err();
    assert!(said.contains("a bad word"), "{said}");
}
