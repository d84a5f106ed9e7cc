//! Studies whose surrogate is fitted to derivatives of the model as well.

use std::fs;
use std::net::Ipv4Addr;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use lacuna_run::arrays;
use lacuna_um_bridge::protocol::{Config, Fault, Support};
use lacuna_um_bridge::server::Stopper;
use lacuna_um_bridge::{Model, Server};
use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

/// The model of all studies here: `y(t) = exp(t a) b + c^2 t`.
const PARAMETERS: &str = r#"
[study]
title = "derivatives of the model"
seed = 8

[[parameter]]
name = "a"
unit = "1/s"
prior = { uniform = [-1.0, 1.0] }

[[parameter]]
name = "b"
unit = "mm"
prior = { log_uniform = [1.0, 4.0] }

[[parameter]]
name = "c"
unit = "1"
prior = { normal = [1.0, 0.2] }

[response]
name = "y"
unit = "mm"
axes = { t = { first = 1.0, last = 3.0, count = 3, unit = "s" } }

[design]
use = "latin_hypercube"
runs = 40

[surrogate]
use = "polynomial_chaos"
gradients = true
validation = 20

[forward]
draws = 200
"#;

/// The model as an equation, whose unit is not that of the response.
const EQUATIONS: &str = r#"
[model]
use = "equations"
observe = "exp(a * t) * b + c ^ 2 * t * 1 {mm/s}"
"#;
/// The unit of the response in that study.
const IN_METRES: &str = "response.unit=\"m\"";

fn written(model: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    fs::write(&path, format!("{PARAMETERS}{model}")).unwrap();
    (folder, path)
}

fn number(summary: &Value, pointer: &str) -> f64 {
    summary.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

/// The model behind a server.
#[derive(Default)]
struct Wave {
    /// True if the derivative by `b` has the wrong sign.
    wrong: bool,
    /// Values of `a` above this one have no derivatives.
    highest: Option<f64>,
    /// Number of derivatives after which the server stops.
    dies_after: Option<usize>,
    /// Points of which derivatives were given, by the first output.
    derived: Mutex<Vec<[u64; 3]>>,
    evaluated: AtomicUsize,
    stopper: Mutex<Option<Stopper>>,
}

const TIMES: [f64; 3] = [1.0, 2.0, 3.0];

impl Model for Wave {
    fn name(&self) -> &'static str {
        "wave"
    }
    fn support(&self) -> Support {
        Support { evaluate: true, gradient: true, ..Support::default() }
    }
    fn input_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![3])
    }
    fn output_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![3])
    }
    fn evaluate(&self, input: &[Vec<f64>], _: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        self.evaluated.fetch_add(1, Ordering::SeqCst);
        let [a, b, c] = [input[0][0], input[0][1], input[0][2]];
        Ok(vec![TIMES.map(|t| (a * t).exp() * b + c * c * t).into()])
    }
    fn gradient(
        &self,
        _: usize,
        _: usize,
        input: &[Vec<f64>],
        sens: &[f64],
        _: &Config,
    ) -> Result<Vec<f64>, Fault> {
        let [a, b, c] = [input[0][0], input[0][1], input[0][2]];
        if self.highest.is_some_and(|highest| a > highest) {
            return Err(Fault::new("InvalidInput", "the adjoint solver diverges"));
        }
        if sens[0] == 1.0 {
            let mut derived = self.derived.lock().unwrap();
            derived.push([a, b, c].map(f64::to_bits));
            if self.dies_after == Some(derived.len())
                && let Some(stopper) = &*self.stopper.lock().unwrap()
            {
                stopper.stop();
            }
        }
        let sign = if self.wrong { -1.0 } else { 1.0 };
        let sum = |slope: &dyn Fn(f64) -> f64| -> f64 {
            TIMES.iter().zip(sens).map(|(&t, s)| s * slope(t)).sum()
        };
        Ok(vec![
            sum(&|t| t * (a * t).exp() * b),
            sum(&|t| sign * (a * t).exp()),
            sum(&|t| 2.0 * c * t),
        ])
    }
}

/// Runs the study with the model behind a server.
fn served(wave: &Wave, port: u16, out: &Path) -> (Result<quick::Ran, lacuna::run::Stop>, u16) {
    let server = Server::bind(Ipv4Addr::LOCALHOST.into(), port).unwrap();
    *wave.stopper.lock().unwrap() = Some(server.stopper());
    std::thread::scope(|scope| {
        let port = server.address().port();
        let stopper = server.stopper();
        scope.spawn(move || server.serve(&[wave], 2));
        let model = format!(
            "\n[model]\nuse = \"um_bridge\"\nurl = \"http://localhost:{port}\"\nmodel = \"wave\"\nretries = 0\n"
        );
        let (_folder, path) = written(&model);
        let outcome = catch_unwind(AssertUnwindSafe(|| quick::run(&path, &[], out)));
        stopper.stop();
        (outcome.unwrap_or_else(|panic| resume_unwind(panic)), port)
    })
}

/// The same 20 runs with derivatives give an error a hundred times smaller than without.
#[test]
fn derivatives_make_the_emulator_better() {
    let (folder, path) = written(EQUATIONS);
    let errors = ["true", "false"].map(|gradients| {
        let out = folder.path().join(gradients);
        let setting = format!("surrogate.gradients={gradients}");
        quick::run(&path, &[&setting, IN_METRES], &out).unwrap_or_else(|stop| panic!("{stop}"));
        let summary = quick::summary(&out);
        assert_eq!(summary["runs"]["active_subspace"].is_object(), gradients == "true");
        number(&summary, "/surrogate/rmse")
    });
    println!("{errors:?}");
    assert!(errors[0] < 0.01 * errors[1], "{errors:?}");
    // They are kept in the unit of the study, and have their closed form.
    let kept = folder.path().join("true/4-surrogate-gradients/gradients.nc");
    let points = arrays::read(&kept, "points").unwrap().into_matrix();
    let found = arrays::read(&kept, "gradients").unwrap();
    assert_eq!(found.dimensions.iter().map(|d| d.1).collect::<Vec<_>>(), [20, 3, 3]);
    for (x, slopes) in points.iter_rows().zip(found.into_matrix().iter_rows()) {
        let expected = TIMES
            .iter()
            .flat_map(|t| [t * (x[0] * t).exp() * x[1], (x[0] * t).exp(), 2.0 * x[2] * t]);
        for (slope, expected) in slopes.iter().zip(expected.map(|in_mm| 1e-3 * in_mm)) {
            assert!((slope - expected).abs() < 1e-12 * expected.abs(), "{slope} {expected}");
        }
    }
}

#[test]
fn the_bits_are_those_of_any_number_of_threads() {
    let (folder, path) = written(EQUATIONS);
    let results = [1, 3].map(|threads| {
        let out = folder.path().join(threads.to_string());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| quick::run(&path, &[], &out).map(|_| ())).unwrap();
        quick::results(&out)
    });
    assert!(results[0].keys().any(|file| file.contains("gradients.nc")));
    assert_eq!(results[0], results[1]);
}

/// The server ends in the middle: what it has given is not asked again, and the results are those of a run without a break.
#[test]
fn a_broken_run_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let [broken, whole] = ["broken", "whole"].map(|name| folder.path().join(name));
    let wave = Wave { dies_after: Some(9), ..Wave::default() };
    let (outcome, port) = served(&wave, 0, &broken);
    assert!(outcome.is_err(), "the server has ended");
    let first = wave.derived.lock().unwrap().clone();
    let wave = Wave::default();
    served(&wave, port, &broken).0.unwrap();
    let second = wave.derived.lock().unwrap().clone();
    // The answer during which the server ended may be lost.
    let twice = second.iter().filter(|point| first.contains(point)).count();
    assert!(twice <= 2 && first.len() + second.len() - twice == 20, "{first:?} {second:?}");
    served(&Wave::default(), port, &whole).0.unwrap();
    let [broken, whole] = [broken, whole].map(|out| quick::results(&out));
    let kept = |results: &std::collections::BTreeMap<String, String>| {
        let own = |name: &&String| name.starts_with("4-surrogate");
        results
            .iter()
            .filter(|(name, _)| own(name))
            .map(|(a, b)| (a.clone(), b.clone()))
            .collect::<Vec<_>>()
    };
    assert!(!kept(&whole).is_empty());
    assert_eq!(kept(&broken), kept(&whole));
}

#[test]
fn a_wrong_sign_stops_the_study() {
    let folder = tempfile::tempdir().unwrap();
    let wave = Wave { wrong: true, ..Wave::default() };
    let (outcome, _) = served(&wave, 0, &folder.path().join("out"));
    let stop = outcome.err().unwrap().to_string();
    println!("{stop}");
    assert!(
        stop.contains("the model's derivative of `y` at t 3 s by `b` is wrong: at run run"),
        "{stop}"
    );
    let numbers: Vec<f64> = stop
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|word| word.contains('e') && word.parse::<f64>().is_ok())
        .map(|word| word.parse().unwrap())
        .collect();
    let [stated, found] = numbers[..] else { panic!("{stop}") };
    assert!((stated + found).abs() < 1e-3 * found, "{stop}");
    // Two runs along all parameters, two by `a`, two by `b`.
    assert_eq!(wave.evaluated.load(Ordering::SeqCst), 40 + 6);
    assert_eq!(wave.derived.lock().unwrap().len(), 1);
}

/// Runs without derivatives are used all the same, and are named.
#[test]
fn a_run_without_derivatives_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let wave = Wave { highest: Some(0.85), ..Wave::default() };
    let ran = served(&wave, 0, &out).0.unwrap();
    let said: Vec<&String> =
        ran.warnings.iter().filter(|text| text.contains("without its derivatives")).collect();
    assert!(!said.is_empty() && said[0].contains("the adjoint solver diverges"), "{said:?}");
    let summary = quick::summary(&out);
    assert_eq!(summary["surrogate"]["training"], 20);
    let known = summary["runs"]["active_subspace"]["runs"].as_u64().unwrap();
    assert_eq!(known as usize + said.len(), 20);
    // Without any derivatives the error is 4.2 mm.
    assert!(number(&summary, "/surrogate/rmse") < 1.4, "{}", summary["surrogate"]);
}
