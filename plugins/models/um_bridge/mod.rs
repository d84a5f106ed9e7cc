//! `um_bridge`: a model on an UM-Bridge server.

mod arrangement;
mod connection;
mod environment;
mod jacobian;
mod pool;
#[cfg(test)]
mod tests;

use lacuna::plugin::model::{Call, EvalError, Gradient, Input, Response, Signature};
use lacuna::plugin::{Component, Context, Model};
use lacuna::text::problem::Complaints;
use lacuna::text::values::{Count, Positive};
use lacuna_um_bridge::client;
use lacuna_um_bridge::protocol::Config;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use connection::Connection;

/// A model on a server that implements UM-Bridge 1.0, in any language, on any machine.
///
/// The server is asked over HTTP for one evaluation at a time. Several are made at the same time if the executor
/// makes several runs (`threads` of `local`; with `urls`, set it to the number of servers). The study's inputs fill
/// the model's input vectors in the study's order. The model's output vectors, one after the other, are the response:
/// values in the order of the response's axes, the last axis fastest, in the study's units. In a study with scenarios
/// the settings sent to the model also contain the name of the `scenario`.
///
/// If the server offers `ApplyJacobian` or `Gradient`, the study has derivatives of the model, obtained with the one
/// that needs fewer requests. `ApplyHessian` is not used, because no method in a study needs second derivatives of a
/// model.
///
/// `lacuna check STUDY` asks the server whether it has the model with the right sizes. While a study runs, an
/// evaluation that fails (an error body, a crash, a value that is not finite, an answer of another size, no answer in
/// time) is a failed run with its reason. If the server remains unreachable or does not know the model, the study
/// stops; completed runs are kept.
///
/// Source: Seelinger et al., J. Open Source Software 8 (2023) 4748.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UmBridge {
    /// Address of the server, such as `http://localhost:4242`, or of a load balancer for several servers.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub url: String,
    /// Addresses of several servers of the same model, in place of `url`. Each request goes to a server that is free.
    /// A server that cannot be reached is not used any more, with a warning, and its request goes to another. If two
    /// servers break the connection for the same input, that run has failed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub urls: Vec<String>,
    /// Number of concurrent evaluations at each address, at least 1. Default: 1 with `urls`; with `url` as many as
    /// the executor makes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parallel: Option<Count>,
    /// Name of the model on the server.
    #[serde(default = "UmBridge::forward")]
    pub model: String,
    /// Settings that are sent to the model with every request, as the model defines them, such as `{ level = 2 }`.
    #[serde(default)]
    pub config: Config,
    /// Names of inputs of the study that are sent with the settings under these names instead of in an input vector:
    /// fixed values or values of scenarios, no parameters.
    #[serde(default)]
    pub config_inputs: Vec<String>,
    /// Names of the inputs that fill each input vector, such as `[["density", "sound_speed"], ["load"]]`. Default:
    /// all inputs of the study fill the vectors one after the other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<Vec<Vec<String>>>,
    /// Indices of the output vectors that form the response, from 0. Default: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outputs: Option<Vec<usize>>,
    /// Time limit for an evaluation, in seconds, including the wait for a busy server; when it passes, the run has
    /// failed.
    #[serde(default = "UmBridge::hour")]
    pub timeout: Positive,
    /// Number of times that a request is repeated if the server cannot be reached or breaks the connection, with
    /// pauses of 0.25 s, 0.5 s and so on up to 30 s.
    #[serde(default = "UmBridge::five")]
    pub retries: u32,
    /// Connection to the server, made with the first request.
    #[serde(skip)]
    connection: Connection,
}

impl UmBridge {
    fn forward() -> String {
        "forward".to_owned()
    }

    fn hour() -> Positive {
        Positive::new(3600.0).unwrap_or_else(|_| unreachable!("3600 is positive"))
    }

    fn five() -> u32 {
        5
    }

    /// Answer of the server to a call: the chosen output vectors, one after the other.
    fn answer(&self, call: &Call<'_>) -> Result<Vec<f64>, EvalError> {
        let question = self.arranged(call)?;
        let about = self.about(question.config);
        let outputs = self.ask(|client| client.evaluate(&about, &question.input));
        let outputs = outputs.map_err(refused)?;
        let values = match &self.outputs {
            None => outputs.concat(),
            Some(chosen) => {
                let vectors: Option<Vec<&Vec<f64>>> =
                    chosen.iter().map(|&i| outputs.get(i)).collect();
                let vectors = vectors.ok_or_else(|| {
                    let found = outputs.len();
                    EvalError::Rejected(format!(
                        "the server at {} answered {found} output vectors, expected at least {}",
                        self.place(),
                        chosen.iter().max().map_or(0, |last| last + 1)
                    ))
                })?;
                vectors.into_iter().flatten().copied().collect()
            }
        };
        let (found, expected) = (values.len(), call.layout.len());
        if found != expected {
            return Err(EvalError::Rejected(format!(
                "the server at {} answered {found} values, expected {expected}",
                self.place()
            )));
        }
        Ok(values)
    }
}

/// Consequence of a failed request: a final error stops the study, others make the run fail.
fn refused(error: client::Error) -> EvalError {
    let reason = error.to_string();
    if error.is_final() { EvalError::Fatal(reason) } else { EvalError::Rejected(reason) }
}

impl Component for UmBridge {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.check_address(complaints);
        self.check_names(context, complaints);
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if context.starts_programs {
            environment::check(self, context, complaints);
        } else {
            self.leave_servers_alone();
        }
    }
}

impl Model for UmBridge {
    fn signature(&self, context: &Context<'_>) -> Signature {
        let unit = |name: &str| context.given.iter().find(|given| given.name == name);
        let input = |name: String| Input {
            unit: unit(&name).and_then(|given| given.unit.clone()).unwrap_or_default(),
            name,
            default: None,
            range: (f64::NEG_INFINITY, f64::INFINITY),
            description: "an input of the model on the server".to_owned(),
        };
        Signature {
            inputs: self.input_names(context).into_iter().map(input).collect(),
            layout: context.layout.clone(),
            resamples: false,
        }
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let values = self.answer(call)?;
        Ok(Response { values, valid: true, facts: Vec::new() })
    }

    fn gradient(&self) -> Option<&dyn Gradient> {
        match self.support_now() {
            Some(support) if !(support.gradient || support.apply_jacobian) => None,
            // A server that does not answer now reports this when derivatives are requested.
            _ => Some(self),
        }
    }
}

lacuna::register!(Model, "um_bridge", UmBridge, aliases: ["umbridge"]);
