//! `um_bridge`: a model behind an UM-Bridge server.

mod arrangement;
mod connection;
mod environment;
mod jacobian;
mod pool;
#[cfg(test)]
mod tests;

use lacuna::plugin::model::{Call, EvalError, Gradient, Input, Response, Signature};
use lacuna::plugin::{Component, Context, Model};
use lacuna::study::problem::Complaints;
use lacuna::study::values::{Count, Positive};
use lacuna_um_bridge::client;
use lacuna_um_bridge::protocol::Config;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use connection::Connection;

/// A model behind a server that speaks UM-Bridge 1.0: any language, any machine.
///
/// The server is asked over HTTP for one evaluation at a time; several are under way when the executor runs several
/// (`threads` of `local`; with `urls` give it as many as there are servers). The study's inputs fill the model's input vectors in the study's order, and the model's
/// output vectors, one after the other, are the response: values in the order of the response's axes, the last axis
/// fastest, in the study's units. In a study with scenarios the settings sent to the model also name the
/// `scenario`.
///
/// Where the server offers `ApplyJacobian` or `Gradient`, the study has derivatives of the model, by whichever
/// takes fewer questions. `ApplyHessian` is not used: nothing in a study asks a model for second derivatives.
///
/// `lacuna check STUDY` asks the server whether it is there and whether it has the model, with the right sizes. While a study
/// runs, an evaluation that fails (an error body, a crash, a value that is not finite, an answer of another size or
/// none in time) is a failed run with its reason. A server that is gone for good, or that does not know the model,
/// stops the study; what is done is kept.
///
/// Source: Seelinger et al., J. Open Source Software 8 (2023) 4748.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UmBridge {
    /// The server's address, such as `http://localhost:4242`, or that of a load balancer in front of many.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub url: String,
    /// The addresses of several servers of the same model, in place of `url`. Each question goes to a server that is free;
    /// one that is gone is left out with a warning and its question put to another. An input over which two servers break the
    /// connection counts as failed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub urls: Vec<String>,
    /// How many evaluations are under way at a time at each address; when left out 1 with `urls`, and with `url` as many
    /// as the executor runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parallel: Option<Count>,
    /// The model's name on the server; `forward` when left out.
    #[serde(default = "UmBridge::forward")]
    pub model: String,
    /// Settings that the model is sent with every question, as it defines them, such as `{ level = 2 }`.
    #[serde(default)]
    pub config: Config,
    /// Inputs of the study that are sent among the settings, under their names, and in no input vector: fixed values or
    /// values of scenarios.
    #[serde(default)]
    pub config_inputs: Vec<String>,
    /// The names of the inputs that fill each input vector, such as `[["density", "sound_speed"], ["load"]]`; when left
    /// out, all inputs of the study fill the vectors one after the other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<Vec<Vec<String>>>,
    /// The numbers of the output vectors that make the response, the first being 0; all when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outputs: Option<Vec<usize>>,
    /// How long an evaluation may take, in seconds, waiting on the server included; an hour when left out.
    #[serde(default = "UmBridge::hour")]
    pub timeout: Positive,
    /// How many times a question is asked again when the server cannot be reached or breaks the connection, after
    /// pauses of a quarter of a second, half a second and so on up to half a minute; 5 when left out.
    #[serde(default = "UmBridge::five")]
    pub retries: u32,
    /// The server, once it was asked.
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

    /// The answer of the server to a call: the chosen output vectors, one after the other.
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

/// What an answer that is none means for the study.
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
        environment::check(self, context, complaints);
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
            // Who is not there now says so when derivatives are asked for.
            _ => Some(self),
        }
    }
}

lacuna::register!(Model, "um_bridge", UmBridge, aliases: ["umbridge"]);
