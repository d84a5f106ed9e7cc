//! Models behind UM-Bridge servers, and studies as such servers.

mod pool;
mod python;
pub mod rod;
mod served;

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::sync::atomic::Ordering;

use crate::quick;
use rod::{Rod, serving, serving_at, setting};

fn study() -> PathBuf {
    quick::root().join("configs/um_bridge/study.toml")
}

/// Least-squares result: with these data flux -18.41, coefficient 0.00191 (Smith 2014, example 7.16, to the digits
/// printed there), and the digits below by Gauss-Newton iterations in double precision.
const LEAST_SQUARES: [(&str, f64, f64); 2] =
    [("flux", -18.414_851_8, 0.139_247_8), ("coefficient", 1.914_321_45e-3, 1.392_989e-5)];
/// Residual variance, for 13 degrees of freedom.
const RESIDUAL: f64 = 0.057_468_3;

/// Compares means and standard deviations of the posterior with least squares.
///
/// Given the variance the posterior is normal to the extent that the model is linear, so that its covariance is that of
/// least squares with the posterior mean of the variance in place of the residual variance.
fn agrees_with_least_squares(summary: &serde_json::Value) {
    assert_eq!(summary["converged"], true);
    let parameters = &summary["parameters"];
    let number = |name: &str, key: &str| parameters[name][key].as_f64().unwrap();
    let wider = (number("variance", "mean") / RESIDUAL).sqrt();
    for (name, estimate, error) in LEAST_SQUARES {
        let (mean, sd) = (number(name, "mean"), number(name, "sd"));
        let size = number(name, "ess_bulk");
        assert!((mean - estimate).abs() < (4.0 / size.sqrt() + 0.05) * sd, "{name}: mean {mean}");
        assert!((sd / (wider * error) - 1.0).abs() < 0.1, "{name}: sd {sd}");
    }
}

#[test]
fn the_worked_study_finds_what_least_squares_finds() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    serving(&Rod::default(), |address| {
        let ran = quick::run(&study(), &[&setting(address)], &out);
        ran.unwrap_or_else(|stop| panic!("{stop}"));
    });
    agrees_with_least_squares(&quick::summary(&out));
}

/// Problems reported: message, expected, found, advice; without the address.
fn complaints(settings: &[&str], address: &str) -> Vec<String> {
    let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    let checked = lacuna_engine::study::resolve::load(&study(), &settings);
    assert!(checked.study.is_none(), "the study is accepted");
    let said = checked.problems.sorted().into_iter().map(|problem| {
        let parts = [&problem.expected, &problem.found].into_iter().flatten().chain(&problem.help);
        let parts: Vec<&str> =
            [&problem.message].into_iter().chain(parts).map(String::as_str).collect();
        parts.join(" | ").replace(address, "ADDRESS")
    });
    said.collect()
}

#[test]
fn a_server_that_does_not_fit_is_found_before_anything_runs() {
    let cases = [
        (
            "model.model=\"road\"",
            "the server at http://ADDRESS has no model `road` | `rod` | `road` | did you mean `rod`?",
        ),
        (
            "model.inputs=[[\"flux\"], [\"coefficient\", \"conductivity\"]]",
            "`rod` at http://ADDRESS takes other inputs | vectors of the sizes [2, 1] | [1, 2]",
        ),
        (
            "model.config={ positions = [1, 2] }",
            "the outputs of `rod` at http://ADDRESS do not fill the response | \
             15 values, as `[response]` has them | 2, in vectors of the sizes [2]",
        ),
        (
            "model.outputs=[0, 1]",
            "`rod` at http://ADDRESS has no output vector 1 | numbers below 1 | 1",
        ),
        (
            "model.config={ level = 2 }",
            "the server at http://ADDRESS reports InvalidInput: the settings have no `positions`",
        ),
    ];
    serving(&Rod::default(), |address| {
        for (argument, expected) in cases {
            let said = complaints(&[&setting(address), argument], &address.to_string());
            assert_eq!(said, [expected], "{argument}");
        }
    });
}

/// Address of a server that responds to everything with the same text.
fn always(body: &'static str) -> String {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap().to_string();
    // The thread ends with the process of the test.
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let _ = stream.read(&mut [0; 4096]);
            let length = body.len();
            let _ = write!(stream, "HTTP/1.1 200 OK\r\nContent-Length: {length}\r\n\r\n{body}");
        }
    });
    address
}

#[test]
fn who_is_no_server_of_this_protocol_is_found_too() {
    let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let nobody = free.local_addr().unwrap().to_string();
    drop(free);
    let newer = always(r#"{"protocolVersion": 2.0, "models": ["rod"]}"#);
    let web = always("<html>welcome</html>");
    for (address, expected) in [
        (
            nobody,
            "no server at http://ADDRESS: the connection is refused | \
             start the server first, or correct the address",
        ),
        (
            newer,
            "the server at http://ADDRESS speaks another version of UM-Bridge | version 1.0 | version 2.0",
        ),
        (
            web,
            "the answer of the server at http://ADDRESS cannot be used: \
             expected value at line 1 column 1: `<html>welcome</html>`",
        ),
    ] {
        let said = complaints(&[&format!("model.url=\"http://{address}\"")], &address);
        assert_eq!(said, [expected]);
    }
}

#[test]
fn runs_without_an_answer_are_named_with_their_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let rod = Rod { lowest: Some(-24.0), ..Rod::default() };
    let stop = serving(&rod, |address| {
        let stop = quick::run(&study(), &[&setting(address)], folder.path()).err().unwrap();
        stop.to_string().replace(&address.to_string(), "ADDRESS")
    });
    let reason = "the server at http://ADDRESS reports InvalidInput: the rod melts at -2";
    assert!(stop.contains(" of 100 runs failed, first `run0"), "{stop}");
    assert!(stop.contains(reason), "{stop}");
    assert_eq!(rod.evaluated.load(Ordering::SeqCst), 100);
}

#[test]
fn a_server_that_dies_stops_the_study_which_goes_on_with_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let once = |address| [setting(address), "model.retries=0".to_owned()];
    let first = Rod { dies_after: Some(30), ..Rod::default() };
    let (port, stop) = serving(&first, |address| {
        let [url, retries] = once(address);
        let stop = quick::run(&study(), &[&url, &retries], folder.path()).err().unwrap();
        (address.port(), stop)
    });
    let said = stop.to_string();
    assert!(said.contains("no server at http://127.0.0.1") || said.contains("broke"), "{said}");
    assert!(said.contains(" of 100 runs in "), "{said}");
    let second = Rod::default();
    serving_at(port, &second, |address| {
        let [url, retries] = once(address);
        let ran = quick::run(&study(), &[&url, &retries], folder.path());
        ran.unwrap_or_else(|stop| panic!("{stop}"));
    });
    // 100 runs in all, plus the model at the calibrated and at the reference values. Runs in progress when the first
    // server stopped may be requested twice.
    let (before, after) = [&first, &second].map(|rod| rod.evaluated.load(Ordering::SeqCst)).into();
    assert!(before >= 30 && after <= 102 - 28, "{before} {after}");
}
