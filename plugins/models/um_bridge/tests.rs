//! Tests with the server of `lacuna_um_bridge`; those with the official server are in `tests/um_bridge.rs` of the
//! workspace.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::net::Ipv4Addr;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use lacuna::data::{Axis, Layout, Scenario, Unit};
use lacuna::plugin::model::{Call, EvalError, Response};
use lacuna::plugin::registry::from_text;
use lacuna::plugin::{Context, Given, Model};
use lacuna_um_bridge::protocol::{Config, Fault, Support};
use lacuna_um_bridge::{Model as Served, Server};

/// A map from the vectors `[a, b]`, `[c]` to `[a b, level c]` and `[a + c]`; it fails for `a` below zero.
struct Toy {
    support: Support,
    /// Number of requests for derivatives.
    derivatives: AtomicUsize,
}

impl Toy {
    fn new(apply_jacobian: bool, gradient: bool) -> Self {
        let support = Support { evaluate: true, gradient, apply_jacobian, apply_hessian: false };
        Self { support, derivatives: AtomicUsize::new(0) }
    }

    /// The derivatives of an output vector with respect to an input vector.
    fn block(out: usize, by: usize, input: &[Vec<f64>], config: &Config) -> Vec<Vec<f64>> {
        match (out, by) {
            (0, 0) => vec![vec![input[0][1], input[0][0]], vec![0.0, 0.0]],
            (0, _) => vec![vec![0.0], vec![level(config)]],
            (_, 0) => vec![vec![1.0, 0.0]],
            _ => vec![vec![1.0]],
        }
    }
}

fn level(config: &Config) -> f64 {
    let named = if config.get("scenario").is_some_and(|name| name == "high") { 10.0 } else { 1.0 };
    named * config.get("level").and_then(serde_json::Value::as_f64).unwrap_or(1.0)
}

impl Served for Toy {
    fn name(&self) -> &'static str {
        "forward"
    }
    fn support(&self) -> Support {
        self.support
    }
    fn input_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![2, 1])
    }
    fn output_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![2, 1])
    }
    fn evaluate(&self, input: &[Vec<f64>], config: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        let (a, b, c) = (input[0][0], input[0][1], input[1][0]);
        if a < 0.0 {
            return Err(Fault::new("InvalidInput", "`a` is negative"));
        }
        Ok(vec![vec![a * b, level(config) * c], vec![a + c]])
    }
    fn gradient(
        &self,
        out_wrt: usize,
        in_wrt: usize,
        input: &[Vec<f64>],
        sens: &[f64],
        config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        self.derivatives.fetch_add(1, Ordering::SeqCst);
        let block = Self::block(out_wrt, in_wrt, input, config);
        let sum = |j: usize| block.iter().zip(sens).map(|(row, s)| row[j] * s).sum();
        Ok((0..block[0].len()).map(sum).collect())
    }
    fn apply_jacobian(
        &self,
        out_wrt: usize,
        in_wrt: usize,
        input: &[Vec<f64>],
        vec: &[f64],
        config: &Config,
    ) -> Result<Vec<f64>, Fault> {
        self.derivatives.fetch_add(1, Ordering::SeqCst);
        let block = Self::block(out_wrt, in_wrt, input, config);
        Ok(block.iter().map(|row| row.iter().zip(vec).map(|(d, v)| d * v).sum()).collect())
    }
}

/// A study with the inputs `a`, `b`, `c` and some conditions.
struct Case {
    names: Vec<String>,
    layout: Layout,
    scenario: Scenario,
}

impl Case {
    fn new(names: &[&str], values: usize) -> Self {
        let grid = (0..values).map(|i| i as f64).collect();
        let axes = vec![Axis::grid("time", grid, Unit::parse("s").unwrap())];
        Self {
            names: names.iter().map(ToString::to_string).collect(),
            layout: Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes },
            scenario: Scenario::default(),
        }
    }

    fn call<'a>(&'a self, inputs: &'a [f64]) -> Call<'a> {
        Call::new(inputs, &self.names, &self.layout, &self.scenario)
    }
}

/// The plugin with these options and a server of this model.
fn on(toy: &Toy, options: &str, ask: impl FnOnce(&dyn Model)) {
    let server = Server::bind(Ipv4Addr::LOCALHOST.into(), 0).unwrap();
    let url = format!("http://{}", server.address());
    std::thread::scope(|scope| {
        scope.spawn(|| server.serve(&[toy], 2));
        let options = format!("url = \"{url}/\"\nretries = 0\n{options}");
        let asked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            ask(&*from_text::<dyn Model>("um_bridge", &options).unwrap().plugin);
        }));
        server.stopper().stop();
        asked.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

fn values(outcome: Result<Response, EvalError>) -> Vec<f64> {
    outcome.unwrap().values
}

#[test]
fn inputs_fill_the_vectors_and_outputs_the_response() {
    let case = Case::new(&["a", "b", "c"], 3);
    on(&Toy::new(false, false), "", |model| {
        assert_eq!(values(model.predict(&case.call(&[2.0, 3.0, 5.0]))), [6.0, 5.0, 7.0]);
        assert!(model.gradient().is_none());
    });
    let other = Case::new(&["b", "c", "a"], 1);
    let options = "inputs = [[\"a\", \"b\"], [\"c\"]]\noutputs = [1]";
    on(&Toy::new(false, false), options, |model| {
        assert_eq!(values(model.predict(&other.call(&[3.0, 5.0, 2.0]))), [7.0]);
    });
}

#[test]
fn settings_are_sent_along_with_what_is_known_of_the_run() {
    let mut case = Case::new(&["a", "b", "c"], 3);
    on(&Toy::new(false, false), "config = { level = 2 }", |model| {
        assert_eq!(values(model.predict(&case.call(&[2.0, 3.0, 5.0])))[1], 10.0);
    });
    case.scenario.name = "high".to_owned();
    case.names = ["level", "a", "b", "c"].map(str::to_owned).to_vec();
    on(&Toy::new(true, false), "config_inputs = [\"level\"]", |model| {
        let call = case.call(&[3.0, 2.0, 3.0, 5.0]);
        assert_eq!(values(model.predict(&call)), [6.0, 150.0, 7.0]);
        let jacobian = model.gradient().unwrap().jacobian(&call).unwrap();
        assert_eq!(jacobian.column(0), [0.0; 3]);
        assert_eq!(jacobian.column(3), [0.0, 30.0, 1.0]);
    });
}

#[test]
fn derivatives_take_as_few_questions_as_possible() {
    let expected = [[3.0, 2.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]];
    // By columns: three inputs times two outputs. By rows: three values times two input vectors. The numbers are
    // equal, and columns are used; with one output of one value rows need fewer requests.
    for (toy, options, rows, questions) in [
        (Toy::new(true, true), "", &expected[..], 6),
        (Toy::new(true, false), "", &expected[..], 6),
        (Toy::new(false, true), "", &expected[..], 6),
        (Toy::new(true, true), "outputs = [1]", &expected[2..], 2),
        (Toy::new(true, false), "outputs = [1]", &expected[2..], 3),
    ] {
        let case = Case::new(&["a", "b", "c"], rows.len());
        on(&toy, options, |model| {
            let jacobian = model.gradient().unwrap().jacobian(&case.call(&[2.0, 3.0, 5.0]));
            let jacobian = jacobian.unwrap();
            for (i, row) in rows.iter().enumerate() {
                assert_eq!(jacobian.row(i), row);
            }
        });
        assert_eq!(toy.derivatives.load(Ordering::SeqCst), questions, "{options}");
    }
}

#[test]
fn what_has_no_answer_is_rejected_and_what_never_will_is_fatal() {
    let case = Case::new(&["a", "b", "c"], 3);
    on(&Toy::new(false, false), "", |model| {
        let outcome = model.predict(&case.call(&[-1.0, 3.0, 5.0]));
        let Err(EvalError::Rejected(reason)) = outcome else { panic!("{outcome:?}") };
        assert!(reason.ends_with("reports InvalidInput: `a` is negative"), "{reason}");
        let outcome = model.predict(&case.call(&[f64::NAN, 3.0, 5.0]));
        assert_eq!(outcome, Err(EvalError::Rejected("the input `a` is NaN".to_owned())));
        let longer = Case::new(&["a", "b", "c"], 4);
        let outcome = longer.call(&[1.0, 3.0, 5.0]);
        let Err(EvalError::Rejected(reason)) = model.predict(&outcome) else { panic!() };
        assert!(reason.ends_with("answered 3 values, expected 4"), "{reason}");
        let fewer = Case::new(&["a", "b"], 3);
        let Err(EvalError::Fatal(reason)) = model.predict(&fewer.call(&[1.0, 3.0])) else {
            panic!()
        };
        let expected = "takes input vectors of the sizes [2, 1], the study has 2 inputs";
        assert!(reason.ends_with(expected), "{reason}");
    });
    on(&Toy::new(false, false), "model = \"backward\"\ninputs = [[\"a\"]]", |model| {
        let Err(EvalError::Fatal(reason)) = model.predict(&case.call(&[1.0, 3.0, 5.0])) else {
            panic!()
        };
        let expected = "ModelNotFound: there is no model `backward`; there are `forward`";
        assert!(reason.ends_with(expected), "{reason}");
    });
    let nobody = "url = \"http://127.0.0.1:1\"\nretries = 0";
    let nobody = from_text::<dyn Model>("um_bridge", nobody).unwrap().plugin;
    assert!(matches!(nobody.predict(&case.call(&[1.0, 3.0, 5.0])), Err(EvalError::Fatal(_))));
    let derivatives = nobody.gradient().unwrap().jacobian(&case.call(&[1.0, 3.0, 5.0]));
    assert!(matches!(derivatives, Err(EvalError::Fatal(_))));
}

#[test]
fn the_study_gives_names_and_units() {
    let case = Case::new(&["a", "b"], 3);
    let given = [("a", Some("m")), ("level", None), ("b", Some("kg"))].map(|(name, unit)| Given {
        name: name.to_owned(),
        unit: unit.map(|unit| Unit::parse(unit).unwrap()),
    });
    let context = Context { given: &given, ..Context::new(Path::new("."), &[], &case.layout) };
    let options = "url = \"http://localhost\"\nconfig_inputs = [\"level\"]";
    let model = from_text::<dyn Model>("um_bridge", options).unwrap().plugin;
    let signature = model.signature(&context);
    let inputs = signature.inputs.iter().map(|input| (input.name.as_str(), input.unit.as_str()));
    assert_eq!(inputs.collect::<Vec<_>>(), [("a", "m"), ("b", "kg"), ("level", "1")]);
    assert_eq!(signature.layout, case.layout);
}

/// Servers of one model; those after the first are stopped during the test or do not exist.
#[test]
fn questions_go_to_servers_that_are_there() {
    let toy = Toy::new(false, false);
    let case = Case::new(&["a", "b", "c"], 3);
    let servers: Vec<Server> =
        (0..3).map(|_| Server::bind(Ipv4Addr::LOCALHOST.into(), 0).unwrap()).collect();
    let urls: Vec<String> = servers.iter().map(|s| format!("\"http://{}\"", s.address())).collect();
    let options = format!("urls = [{}, \"http://127.0.0.1:1\"]\nretries = 0", urls.join(", "));
    let model = from_text::<dyn Model>("um_bridge", &options).unwrap().plugin;
    std::thread::scope(|scope| {
        let stoppers: Vec<_> = servers.iter().map(Server::stopper).collect();
        // A server that has ended is dropped and does not listen any more.
        let toy = &toy;
        let mut threads: Vec<_> = servers
            .into_iter()
            .map(|server| Some(scope.spawn(move || server.serve(&[toy], 1))))
            .collect();
        let ask = |count: usize| {
            let threads: Vec<_> = (0..count)
                .map(|i| {
                    let (model, case) = (&model, &case);
                    scope.spawn(move || values(model.predict(&case.call(&[i as f64, 3.0, 5.0]))))
                })
                .collect();
            for (i, thread) in threads.into_iter().enumerate() {
                let i = i as f64;
                assert_eq!(thread.join().unwrap(), [3.0 * i, 5.0, i + 5.0]);
            }
        };
        let asked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            ask(12);
            stoppers[1].stop();
            threads[1].take().unwrap().join().unwrap();
            ask(12);
            // An input without an answer fails and makes no server unused.
            let outcome = model.predict(&case.call(&[-1.0, 3.0, 5.0]));
            assert!(matches!(outcome, Err(EvalError::Rejected(_))), "{outcome:?}");
            ask(3);
        }));
        for stopper in &stoppers {
            stopper.stop();
        }
        asked.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
    let outcome = model.predict(&case.call(&[1.0, 3.0, 5.0]));
    assert!(matches!(outcome, Err(EvalError::Fatal(_))), "{outcome:?}");
}
