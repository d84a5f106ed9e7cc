//! The model of `examples/um_bridge/server.py`, and servers that offer it.

use std::net::{Ipv4Addr, SocketAddr};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use lacuna_um_bridge::protocol::{Config, Fault, Support};
use lacuna_um_bridge::server::Stopper;
use lacuna_um_bridge::{Model, Server};

/// The heated rod.
#[derive(Default)]
pub struct Rod {
    /// Fluxes below this value are rejected.
    pub lowest: Option<f64>,
    /// Number of evaluations after which the server stops.
    pub dies_after: Option<usize>,
    /// Number of evaluations so far.
    pub evaluated: AtomicUsize,
    /// Stops the server.
    pub stopper: Mutex<Option<Stopper>>,
}

fn positions(config: &Config) -> Result<Vec<f64>, Fault> {
    let values = config.get("positions").and_then(|value| value.as_array());
    let values = values.map(|list| list.iter().filter_map(serde_json::Value::as_f64).collect());
    values.ok_or_else(|| Fault::new("InvalidInput", "the settings have no `positions`"))
}

impl Model for Rod {
    fn name(&self) -> &'static str {
        "rod"
    }
    fn support(&self) -> Support {
        Support { evaluate: true, ..Support::default() }
    }
    fn input_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![2, 1])
    }
    fn output_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![positions(config)?.len()])
    }
    fn evaluate(&self, input: &[Vec<f64>], config: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        let count = self.evaluated.fetch_add(1, Ordering::SeqCst) + 1;
        if self.dies_after == Some(count)
            && let Some(stopper) = &*self.stopper.lock().unwrap()
        {
            stopper.stop();
        }
        let (flux, h, k) = (input[0][0], input[0][1], input[1][0]);
        if self.lowest.is_some_and(|lowest| flux < lowest) {
            return Err(Fault::new("InvalidInput", format!("the rod melts at {flux:.0} W/cm2")));
        }
        let (width, length) = (0.95, 70.0);
        let g = (4.0 * h / (width * k)).sqrt();
        let up = (g * length).exp() * (h + k * g);
        let down = (-g * length).exp() * (h - k * g);
        let scale = flux / (k * g);
        let c1 = -scale * up / (up + down);
        let c2 = scale + c1;
        let at = |x: &f64| c1 * (-g * x).exp() + c2 * (g * x).exp();
        Ok(vec![positions(config)?.iter().map(at).collect()])
    }
}

/// Runs a server while `act` runs.
pub fn serving<R>(rod: &Rod, act: impl FnOnce(SocketAddr) -> R) -> R {
    serving_at(0, rod, act)
}

/// Like [`serving`], at a given port.
pub fn serving_at<R>(port: u16, rod: &Rod, act: impl FnOnce(SocketAddr) -> R) -> R {
    let server = Server::bind(Ipv4Addr::LOCALHOST.into(), port).unwrap();
    *rod.stopper.lock().unwrap() = Some(server.stopper());
    std::thread::scope(|scope| {
        let address = server.address();
        // The server ends with its thread and releases the port.
        let stopper = server.stopper();
        scope.spawn(move || server.serve(&[rod], 2));
        let outcome = catch_unwind(AssertUnwindSafe(|| act(address)));
        stopper.stop();
        outcome.unwrap_or_else(|panic| resume_unwind(panic))
    })
}

/// The `--set` argument that lets a study use the server.
pub fn setting(address: SocketAddr) -> String {
    format!("model.url=\"http://{address}\"")
}
