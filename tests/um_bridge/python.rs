//! Interoperation with the official Python package `umbridge`, in both directions.

use std::net::{Ipv4Addr, TcpListener};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use lacuna::plugin::model::Gradient;
use lacuna_engine::stage::simulator::Simulator;
use lacuna_um_bridge::Client;

use super::served::Served;
use super::{agrees_with_least_squares, study};
use crate::python::interpreter;
use crate::quick;

/// `examples/um_bridge/server.py` at a free port.
struct Python {
    child: Child,
    url: String,
}

impl Python {
    /// Starts the server; `None` if there is no interpreter and none is required.
    fn start() -> Option<Self> {
        let python = interpreter("umbridge")?;
        let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = free.local_addr().unwrap().port();
        drop(free);
        let script = quick::root().join("examples/um_bridge/server.py");
        let mut command = Command::new(python);
        command.arg(script).arg(port.to_string()).stdout(Stdio::null());
        let started =
            Self { child: command.spawn().unwrap(), url: format!("http://localhost:{port}") };
        let client = Client::new(&started.url, Duration::from_secs(5), 0);
        let begun = Instant::now();
        while client.info().is_err() {
            assert!(begun.elapsed() < Duration::from_secs(60), "the server does not start");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(started)
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn gradient(simulator: &Simulator<'_>) -> lacuna_linalg::Matrix {
    let gradient: &dyn Gradient = simulator.model.gradient().unwrap();
    simulator.jacobian(&simulator.settings[0], gradient, &[-18.41, 0.00191]).unwrap()
}

#[test]
fn the_worked_study_runs_on_the_official_server() {
    let Some(python) = Python::start() else { return };
    let url = format!("model.url=\"{}\"", python.url);
    let loaded = quick::load(&study(), &[&url]);
    let simulator = Simulator::of(&loaded).unwrap().unwrap();
    let jacobian = gradient(&simulator);
    // The response is linear in the flux.
    let response = simulator.respond(&[-18.41, 0.00191]).unwrap().values;
    for (i, value) in response.iter().enumerate() {
        assert!((jacobian.row(i)[0] * -18.41 - value).abs() < 1e-11 * value.abs());
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    quick::run(&study(), &[&url], &out).unwrap_or_else(|stop| panic!("{stop}"));
    agrees_with_least_squares(&quick::summary(&out));

    let out = out.display().to_string();
    let served = Served::start(&study(), &["--out", &out, "--set", &url]);
    let said = client(&served.url);
    let map = quick::summary(std::path::Path::new(&out))["parameters"].clone();
    for (i, name) in ["flux", "coefficient", "variance"].into_iter().enumerate() {
        let ours = map[name]["map"].as_f64().unwrap();
        let (theirs, sd) = (&said["maximum"][i], said["sd"][i].as_f64().unwrap());
        assert!((theirs.as_f64().unwrap() - ours).abs() < 1e-3 * sd, "{name}: {theirs} {ours}");
    }
    official_client_is_understood(&served.url);
}

/// Output of `examples/um_bridge/client.py`.
fn client(url: &str) -> serde_json::Value {
    let script = quick::root().join("examples/um_bridge/client.py");
    let mut command = Command::new(interpreter("umbridge").unwrap());
    command.arg(script).arg(url).args(["-18", "0.002", "0.1"]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Every endpoint and the errors, called by the package's own client.
const ENDPOINTS: &str = r"
import sys, umbridge
url = sys.argv[1]
assert umbridge.supported_models(url) == ['model', 'emulator', 'posterior']
model, emulator = umbridge.HTTPModel(url, 'model'), umbridge.HTTPModel(url, 'emulator')
assert model.get_input_sizes() == [2] and model.get_output_sizes() == [15]
x = [[-18.41, 0.00191]]
a, b = model(x)[0], emulator(x)[0]
assert max(abs(p - q) for p, q in zip(a, b)) < 0.05, (a, b)
v = emulator.apply_jacobian(0, 0, x, [1.0, 0.0])
w = model.apply_jacobian(0, 0, x, [1.0, 0.0])
assert max(abs(p - q) for p, q in zip(v, w)) < 0.01, (v, w)
s = [1.0] + 14 * [0.0]
assert abs(emulator.gradient(0, 0, x, s)[0] - v[0]) < 1e-12
assert not model.supports_apply_hessian() and emulator.supports_apply_hessian()
assert len(emulator.apply_hessian(0, 0, 0, x, s, [0.0, 1.0])) == 2
for call, kind in [
    (lambda: emulator([[1.0, 0.00191]]), 'InvalidInput: `flux` is 1'),
    (lambda: emulator([[1.0]]), 'InvalidInput: the inputs have the sizes [1], expected [2]'),
    (lambda: emulator(x, {'level': 3}), 'InvalidInput: there is no setting `level`'),
]:
    try:
        call()
    except Exception as error:
        assert kind in str(error), str(error)
    else:
        raise AssertionError(kind)
";

fn official_client_is_understood(url: &str) {
    let mut command = Command::new(interpreter("umbridge").unwrap());
    let output = command.args(["-c", ENDPOINTS, url]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
