//! `lacuna serve`, called by our own client.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use lacuna_engine::stage::simulator::Simulator;
use lacuna_run::arrays;
use lacuna_um_bridge::Client;
use lacuna_um_bridge::client::Place;
use lacuna_um_bridge::protocol::About;

use super::rod::{Rod, serving, setting};
use crate::quick;

/// `lacuna serve` at a free port.
pub struct Served {
    child: Child,
    pub url: String,
    /// Output before it listened.
    pub said: String,
}

impl Served {
    pub fn start(study: &Path, arguments: &[&str]) -> Self {
        let mut command = quick::command();
        command.arg("serve").arg(study).args(["--port", "0"]).args(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let (url, said) = (String::new(), String::new());
        let mut served = Self { child: command.spawn().unwrap(), url, said };
        let mut lines = BufReader::new(served.child.stdout.as_mut().unwrap());
        loop {
            let mut line = String::new();
            if lines.read_line(&mut line).unwrap() == 0 {
                let mut errors = String::new();
                served.child.stderr.take().unwrap().read_to_string(&mut errors).unwrap();
                panic!("{}{errors}", served.said);
            }
            if let Some(rest) = line.strip_prefix("listening at ") {
                rest.split(';').next().unwrap().clone_into(&mut served.url);
                return served;
            }
            served.said += &line;
        }
    }

    pub fn client(&self) -> Client {
        Client::new(&self.url, Duration::from_secs(60), 0)
    }

    /// Sends Ctrl-C and returns the exit code.
    fn interrupt(mut self) -> Option<i32> {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn about(name: &str) -> About {
    About { name: name.to_owned(), config: serde_json::Map::new() }
}

const WHOLE: Place = Place { output: 0, input: 0 };

/// A served run of the study that `lacuna new study` writes.
fn finished(folder: &Path) -> Served {
    let (study, out) = (folder.join("study.toml"), folder.join("run"));
    let short = ["sampler.steps=100", "surrogate.degree=6"];
    quick::run(&study, &short, &out).unwrap_or_else(|stop| panic!("{stop}"));
    let out = out.display().to_string();
    let arguments = ["--out", &out, "--set", short[0], "--set", short[1]];
    Served::start(&study, &arguments)
}

#[test]
fn the_posterior_that_is_served_is_the_one_that_was_sampled() {
    let folder = quick::tables();
    let served = finished(folder.path());
    assert_eq!(
        served.said,
        "`emulator`: frequency [Hz], damping [1/s] -> 20 values\n\
         `posterior`: frequency [Hz], damping [1/s], variance [mm^2] -> 1 value\n"
    );
    let client = served.client();
    assert_eq!(client.info().unwrap().models, ["emulator", "posterior"]);
    let posterior = about("posterior");
    let path = folder.path().join("run/5-calibrate/draws.nc");
    let [draws, densities] =
        ["draws", "log_density"].map(|name| arrays::read(&path, name).unwrap());
    for i in [0, 1234, 3999] {
        let point = draws.values[3 * i..3 * (i + 1)].to_vec();
        let value = client.evaluate(&posterior, std::slice::from_ref(&point)).unwrap()[0][0];
        // The sampler's coordinate is the logarithm of the variance: its density includes the Jacobian.
        let expected = densities.values[i] - point[2].ln();
        assert!((value - expected).abs() < 1e-9 * expected.abs(), "{value} {expected}");
    }
    derivatives_agree(&client, &posterior, &draws.values[..3]);
    let outside = vec![2.0, 1.0, -1.0];
    let value = client.evaluate(&posterior, std::slice::from_ref(&outside)).unwrap()[0][0];
    assert_eq!(value, f64::MIN);
    let error = client.gradient(&posterior, WHOLE, &[outside], &[1.0]).unwrap_err().to_string();
    assert!(error.contains("InvalidInput: the density is zero here"), "{error}");
    assert_eq!(served.interrupt(), Some(0));
}

/// Compares gradients with differences of values, and second derivatives with differences of gradients.
fn derivatives_agree(client: &Client, model: &About, point: &[f64]) {
    let value = |x: &[f64]| client.evaluate(model, &[x.to_vec()]).unwrap()[0][0];
    let gradient = |x: &[f64]| client.gradient(model, WHOLE, &[x.to_vec()], &[1.0]).unwrap();
    let at = gradient(point);
    for j in 0..point.len() {
        let step = 1e-4 * point[j].abs();
        let moved = |sign: f64| {
            let mut x = point.to_vec();
            x[j] += sign * step;
            x
        };
        let slope = (value(&moved(1.0)) - value(&moved(-1.0))) / (2.0 * step);
        let size = at[j].abs().max(1.0 / step);
        assert!((slope - at[j]).abs() < 1e-4 * size, "{j}: {slope} {}", at[j]);
        let direction: Vec<f64> = (0..point.len()).map(|i| f64::from(u8::from(i == j))).collect();
        let along = client.apply_jacobian(model, WHOLE, &[point.to_vec()], &direction).unwrap();
        assert_eq!(along, [at[j]]);
        let second =
            client.apply_hessian(model, WHOLE, 0, &[point.to_vec()], &[1.0], &direction).unwrap();
        let (after, before) = (gradient(&moved(1.0)), gradient(&moved(-1.0)));
        for i in 0..point.len() {
            let slope = (after[i] - before[i]) / (2.0 * step);
            let size = slope.abs().max(1e-3 / (step * point[i].abs()));
            assert!((slope - second[i]).abs() < 1e-3 * size, "{i} {j}: {slope} {}", second[i]);
        }
    }
}

#[test]
fn an_emulator_answers_where_it_was_fitted() {
    let folder = quick::tables();
    let served = finished(folder.path());
    let (client, emulator) = (served.client(), about("emulator"));
    let inside = client.evaluate(&emulator, &[vec![2.0, 1.0]]).unwrap();
    assert_eq!(inside[0].len(), 20);
    let error = client.evaluate(&emulator, &[vec![2.0, 9.0]]).unwrap_err().to_string();
    let expected = "InvalidInput: `damping` is 9, outside 0.5 to 3 where the emulator was fitted";
    assert!(error.ends_with(expected), "{error}");
    // At the edge second derivatives are one-sided; values beside it must converge to them.
    let curve = |damping: f64| {
        let weights = [1.0; 20];
        let input = [vec![2.0, damping]];
        client.apply_hessian(&emulator, WHOLE, 0, &input, &weights, &[0.0, 1.0]).unwrap()[1]
    };
    let [edge, near, far] = [0.0, 1e-4, 2e-4].map(|step| curve(3.0 - step));
    assert!((edge - (2.0 * near - far)).abs() < 1e-4 * edge.abs(), "{edge} {near} {far}");
}

#[test]
fn a_model_crosses_with_every_bit() {
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    let served = Served::start(&path, &[]);
    assert!(served.said.starts_with("no finished run in runs/quick: the model alone is served\n"));
    let study = quick::load(&path, &[]);
    let point = [2e5, 13_000.0, 1500.0];
    let ours = Simulator::of(&study).unwrap().unwrap().respond(&point).unwrap();
    let client = served.client();
    let theirs = client.evaluate(&about("model"), &[point.to_vec()]).unwrap();
    assert_eq!(theirs, [ours.values]);
    let error = client.evaluate(&about("model"), &[vec![2e5, -1.0, 1500.0]]).unwrap_err();
    assert!(error.to_string().contains("InvalidInput: `density` is -1"), "{error}");
}

#[test]
fn a_run_of_another_study_is_not_served() {
    let folder = quick::tables();
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("run"));
    let short = ["sampler.steps=100", "surrogate.degree=6"];
    quick::run(&study, &short, &out).unwrap_or_else(|stop| panic!("{stop}"));
    let serve = |out: &Path| {
        let mut command = quick::command();
        let (code, text) = quick::said(command.arg("serve").arg(&study).arg("--out").arg(out));
        (code, text.replace(&folder.path().display().to_string(), "DIR"))
    };
    let message = "error: the run in DIR/run was made from another version of the study\n\
                   help: run the study again, or serve the run's own: `DIR/run/resolved.toml` with `--out DIR/run`\n";
    assert_eq!(serve(&out), (Some(1), message.to_owned()));
    let message = "error: there is no finished run in DIR/none\n\
                   help: run the study first, or leave `--out` out\n";
    assert_eq!(serve(&folder.path().join("none")), (Some(1), message.to_owned()));
}

/// `configs/records` has three scenarios, of 81, 101 and 61 values.
#[test]
fn scenarios_are_asked_for_one_at_a_time() {
    let served = Served::start(&quick::root().join("configs/records/study.toml"), &[]);
    assert!(served.said.contains("-> 243 values: `gentle` 81, `middle` 101, `steep` 61\n"));
    let client = served.client();
    let of = |name: &str| About {
        config: serde_json::json!({ "scenario": name }).as_object().unwrap().clone(),
        ..about("model")
    };
    let point = vec![vec![9.8, 0.35, 0.1, -0.05, 0.3, 0.2, 0.0, -0.5]];
    let all = client.evaluate(&about("model"), &point).unwrap().concat();
    assert_eq!(client.output_sizes(&of("middle")).unwrap(), [101]);
    let parts = ["gentle", "middle", "steep"]
        .map(|name| client.evaluate(&of(name), &point).unwrap().concat());
    assert_eq!(parts.concat(), all);
    // Derivative by gravity of the second record alone, and as part of all records.
    let along = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let whole = client.apply_jacobian(&about("model"), WHOLE, &point, &along).unwrap();
    let middle = client.apply_jacobian(&of("middle"), WHOLE, &point, &along).unwrap();
    assert_eq!(whole[81..182], middle);
    let error = client.evaluate(&of("flat"), &point).unwrap_err().to_string();
    let expected =
        "InvalidInput: there is no scenario \"flat\", expected one of `gentle`, `middle`, `steep`";
    assert!(error.ends_with(expected), "{error}");
}

/// The study of `configs/um_bridge`, whose server ends when the run is finished.
#[test]
fn what_a_finished_run_keeps_needs_no_server() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let short = ["sampler.steps=300", "sampler.warm_up=150"];
    serving(&Rod::default(), |address| {
        let ran = quick::run(&super::study(), &[&setting(address), short[0], short[1]], &out);
        ran.unwrap_or_else(|stop| panic!("{stop}"));
    });
    for verb in ["report", "resume"] {
        let (code, text) = quick::said(quick::command().arg(verb).arg(&out));
        assert_eq!(code, Some(0), "{verb}: {text}");
    }
    let served = Served::start(&out.join("resolved.toml"), &["--out", &out.display().to_string()]);
    let client = served.client();
    let point = [vec![-18.4, 1.9e-3]];
    assert_eq!(client.evaluate(&about("emulator"), &point).unwrap()[0].len(), 15);
    assert!(client.evaluate(&about("model"), &point).is_err());
    // An unfinished run calls the model, and reports that the server is not available.
    std::fs::remove_file(out.join("manifest.json")).unwrap();
    let (code, text) = quick::said(quick::command().arg("resume").arg(&out));
    assert!(code == Some(2) && text.contains("the connection is refused"), "{text}");
}
