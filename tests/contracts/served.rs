//! A server for the contract of models behind servers.

use std::net::Ipv4Addr;

use lacuna_um_bridge::protocol::{Config, Fault, Support};
use lacuna_um_bridge::{Model, Server};

/// Maps `a` and `b`, each in its own vector, to five values and their derivatives.
struct Curve;

impl Model for Curve {
    fn name(&self) -> &'static str {
        "curve"
    }
    fn support(&self) -> Support {
        Support { evaluate: true, apply_jacobian: true, ..Support::default() }
    }
    fn input_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![1, 1])
    }
    fn output_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![5])
    }
    fn evaluate(&self, input: &[Vec<f64>], _: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        let (a, b) = (input[0][0], input[1][0]);
        Ok(vec![(1..=5).map(|t| (a * f64::from(t)).sin() + b * f64::from(t)).collect()])
    }
    fn apply_jacobian(
        &self,
        _: usize,
        in_wrt: usize,
        input: &[Vec<f64>],
        vec: &[f64],
        _: &Config,
    ) -> Result<Vec<f64>, Fault> {
        let slope = |t: f64| if in_wrt == 0 { t * (input[0][0] * t).cos() } else { t };
        Ok((1..=5).map(|t| vec[0] * slope(f64::from(t))).collect())
    }
}

/// Options of a model behind a server that runs until the process of the test ends.
pub fn options() -> &'static [&'static str] {
    let server = Server::bind(Ipv4Addr::LOCALHOST.into(), 0).unwrap();
    let options = format!("url = \"http://{}\"\nmodel = \"curve\"", server.address());
    std::thread::spawn(move || server.serve(&[&Curve], 2));
    let options: &'static str = options.leak();
    Vec::leak(vec![options])
}
