//! UM-Bridge client.

mod answer;
mod error;

use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::protocol::{
    About, ApplyHessian, ApplyJacobian, Evaluate, Gradient, Info, InputSizes, ModelInfo, Output,
    OutputSizes, Support,
};

pub use answer::read as read_answer;
pub use error::Error;

/// Largest response that is read, in bytes: ten million numbers with all their digits. In memory it takes up to eight times
/// that.
const LARGEST: u64 = 1 << 28;

/// Longest wait for a connection.
const CONNECTING: Duration = Duration::from_secs(10);

/// Longest pause before another attempt.
const PAUSE: Duration = Duration::from_secs(30);

/// A connection to a server; may be used from many threads at once.
pub struct Client {
    agent: ureq::Agent,
    url: String,
    timeout: Duration,
    retries: u32,
}

/// Selects the derivative of one output vector by one input vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Index of the output vector.
    pub output: usize,
    /// Index of the input vector.
    pub input: usize,
}

impl Client {
    /// A client of the server at `url`, such as `http://localhost:4242`.
    ///
    /// A request without a response within `timeout` fails. A request that finds no server, or whose connection breaks,
    /// is repeated up to `retries` times, after a quarter of a second, half a second, one second and so on.
    pub fn new(url: &str, timeout: Duration, retries: u32) -> Self {
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            // A model's server is on this machine or nearby; the proxy settings of the environment are for the web.
            .proxy(None)
            // A redirect would send the question to an address that the study does not name.
            .max_redirects(0)
            .timeout_global(Some(timeout))
            .timeout_connect(Some(timeout.min(CONNECTING)))
            .max_idle_connections_per_host(64)
            .build();
        let url = url.trim_end_matches('/').to_owned();
        Self { agent: config.new_agent(), url, timeout, retries }
    }

    /// Address of the server.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Version of the protocol and names of the models.
    pub fn info(&self) -> Result<Info, Error> {
        self.patiently(|| self.sent(self.agent.get(self.path("Info")).call()))
    }

    /// Operations that a model supports.
    pub fn support(&self, about: &About) -> Result<Support, Error> {
        self.ask::<ModelInfo>("ModelInfo", about).map(|info| info.support)
    }

    /// Length of each input vector.
    pub fn input_sizes(&self, about: &About) -> Result<Vec<usize>, Error> {
        self.ask::<InputSizes>("InputSizes", about).map(|sizes| sizes.input_sizes)
    }

    /// Length of each output vector.
    pub fn output_sizes(&self, about: &About) -> Result<Vec<usize>, Error> {
        self.ask::<OutputSizes>("OutputSizes", about).map(|sizes| sizes.output_sizes)
    }

    /// Evaluates the output vectors at these input vectors.
    pub fn evaluate(&self, about: &About, input: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, Error> {
        let About { name, config } = about.clone();
        let question = Evaluate { name, input: input.to_vec(), config };
        let answer: Output<Vec<Vec<Option<f64>>>> = self.ask("Evaluate", &question)?;
        let vectors = answer.output.into_iter().enumerate();
        vectors.map(|(i, values)| self.numbers(&format!(" of output vector {i}"), values)).collect()
    }

    /// Gradient of `sens · output` by the input.
    pub fn gradient(
        &self,
        about: &About,
        at: Place,
        input: &[Vec<f64>],
        sens: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let About { name, config } = about.clone();
        let (out_wrt, in_wrt) = (at.output, at.input);
        let (input, sens) = (input.to_vec(), sens.to_vec());
        self.vector("Gradient", &Gradient { name, out_wrt, in_wrt, input, sens, config })
    }

    /// Derivative of the output along the direction `vec` of the input.
    pub fn apply_jacobian(
        &self,
        about: &About,
        at: Place,
        input: &[Vec<f64>],
        vec: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let About { name, config } = about.clone();
        let (out_wrt, in_wrt) = (at.output, at.input);
        let (input, vec) = (input.to_vec(), vec.to_vec());
        self.vector("ApplyJacobian", &ApplyJacobian { name, out_wrt, in_wrt, input, vec, config })
    }

    /// Second derivative of `sens · output` by the input and along the direction `vec` of the input `second`.
    pub fn apply_hessian(
        &self,
        about: &About,
        at: Place,
        second: usize,
        input: &[Vec<f64>],
        sens: &[f64],
        vec: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let About { name, config } = about.clone();
        let question = ApplyHessian {
            name,
            out_wrt: at.output,
            in_wrt1: at.input,
            in_wrt2: second,
            input: input.to_vec(),
            sens: sens.to_vec(),
            vec: vec.to_vec(),
            config,
        };
        self.vector("ApplyHessian", &question)
    }

    fn path(&self, endpoint: &str) -> String {
        format!("{}/{endpoint}", self.url)
    }

    fn vector(&self, endpoint: &str, question: &impl Serialize) -> Result<Vec<f64>, Error> {
        let answer: Output<Vec<Option<f64>>> = self.ask(endpoint, question)?;
        self.numbers("", answer.output)
    }

    /// The values, or an error unless all are numbers.
    fn numbers(&self, of: &str, values: Vec<Option<f64>>) -> Result<Vec<f64>, Error> {
        let number = |(i, value): (usize, Option<f64>)| {
            let reason = || format!("value {i}{of} is not a finite number");
            value.filter(|v| v.is_finite()).ok_or_else(|| self.useless(reason()))
        };
        values.into_iter().enumerate().map(number).collect()
    }

    fn ask<T: DeserializeOwned>(
        &self,
        endpoint: &str,
        question: &impl Serialize,
    ) -> Result<T, Error> {
        let text = serde_json::to_vec(question)
            .map_err(|error| self.useless(format!("the question is no JSON: {error}")))?;
        let post = || self.agent.post(self.path(endpoint)).content_type("application/json");
        self.patiently(|| self.sent(post().send(&text[..])))
    }

    /// Repeats a request while the connection fails.
    fn patiently<T>(&self, ask: impl Fn() -> Result<T, Error>) -> Result<T, Error> {
        let mut pause = Duration::from_millis(250);
        for _ in 0..self.retries {
            match ask() {
                Err(error) if error.may_pass() => std::thread::sleep(pause),
                answer => return answer,
            }
            pause = (2 * pause).min(PAUSE);
        }
        ask()
    }

    fn sent<T: DeserializeOwned>(
        &self,
        response: Result<ureq::http::Response<ureq::Body>, ureq::Error>,
    ) -> Result<T, Error> {
        let mut response = response.map_err(|error| self.failed(error))?;
        let status = response.status().as_u16();
        if response.status().is_redirection()
            && let Some(place) = response.headers().get("location")
        {
            let to = String::from_utf8_lossy(place.as_bytes()).into_owned();
            return Err(Error::Moved { url: self.url.clone(), to });
        }
        let body = response.body_mut().with_config().limit(LARGEST).read_to_vec();
        let body = body.map_err(|error| match self.failed(error) {
            Error::Broken { url, .. } => {
                let reason = "the answer breaks off before its end".to_owned();
                Error::Broken { url, reason }
            }
            other => other,
        })?;
        answer::read(&self.url, status, &body)
    }

    fn useless(&self, reason: String) -> Error {
        Error::Useless { url: self.url.clone(), reason }
    }

    fn failed(&self, error: ureq::Error) -> Error {
        Error::of(error, &self.url, self.timeout)
    }
}

#[cfg(test)]
mod tests;
