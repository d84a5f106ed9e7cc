//! Models in Python.

use lacuna::matrix::Matrix;
use lacuna::plugin::Context;
use lacuna::plugin::model::{Call as Run, EvalError, Gradient, Model, Response, Signature};
use lacuna_abi::check::{numbers_only, shaped};
use lacuna_abi::wire::{OwnedContext, SignatureAbout};
use lacuna_abi::{Refusal, status};
use serde_json::json;

use crate::object::{Call, Plugin, answer, matrices, matrix};

impl Plugin {
    fn run<'a>(
        &self,
        what: &'static str,
        first: &Run<'_>,
        inputs: &'a [&'a Matrix],
    ) -> Result<Call<'a>, Refusal> {
        let known = self.0.known(first.names, first.layout, Some(first.scenario))?;
        Ok(Call { known, ..Call::new(what, inputs) })
    }

    fn answers(&self, calls: &[Run<'_>]) -> Result<Vec<Result<Response, EvalError>>, Refusal> {
        let Some(first) = calls.first() else { return Ok(Vec::new()) };
        calls.iter().try_for_each(sound)?;
        let inputs = Matrix::from_rows(first.inputs.len(), calls.iter().map(|call| call.inputs));
        let message = self.0.ask(&self.run("predict", first, &[&inputs])?)?;
        let reasons: Vec<Option<String>> = answer(&message)?;
        let [values] = matrices(message)?;
        shaped("predict", &values, calls.len(), first.layout.len())?;
        let each = values.iter_rows().zip(reasons).map(|(values, reason)| match reason {
            Some(reason) => self.0.or_error(Err(Refusal::new(status::REJECTED, reason))),
            None => match values.iter().position(|y| !y.is_finite()) {
                Some(i) => {
                    let place = first.layout.describe(i);
                    let text = format!("the response is {} at {place}", values[i]);
                    self.0.or_error(Err(Refusal::new(status::REJECTED, text)))
                }
                None => Ok(Response { values: values.to_vec(), valid: true, facts: Vec::new() }),
            },
        });
        Ok(each.collect())
    }
}

/// Refuses a call without one finite number for each input.
fn sound(call: &Run<'_>) -> Result<(), Refusal> {
    let (names, inputs) = (call.names.len(), call.inputs.len());
    if names != inputs {
        return Err(Refusal::stop(format!("expected {names} inputs, found {inputs}")));
    }
    match call.names.iter().zip(call.inputs).find(|(_, x)| !x.is_finite()) {
        Some((name, x)) => {
            Err(Refusal::new(status::REJECTED, format!("the input `{name}` is {x}")))
        }
        None => Ok(()),
    }
}

impl Model for Plugin {
    fn signature(&self, context: &Context<'_>) -> Signature {
        let asked = || -> Result<SignatureAbout, Refusal> {
            let context = json!({ "context": OwnedContext::from(context) });
            answer(&self.0.ask(&Call::new("signature", &[]).about(context))?)
        };
        self.0.or_fault(asked(), SignatureAbout::default).in_study(context)
    }

    fn predict(&self, call: &Run<'_>) -> Result<Response, EvalError> {
        self.predict_batch(&[*call])
            .pop()
            .unwrap_or_else(|| Err(EvalError::Fatal("a model gave no answer".to_owned())))
    }

    fn batch(&self) -> usize {
        BATCH
    }

    fn predict_batch(&self, calls: &[Run<'_>]) -> Vec<Result<Response, EvalError>> {
        match self.0.or_error(self.answers(calls)) {
            Ok(answers) => answers,
            // One run that cannot be made takes no other with it.
            Err(EvalError::Rejected(_)) if calls.len() > 1 => {
                calls.iter().map(|call| self.predict(call)).collect()
            }
            Err(error) => calls.iter().map(|_| Err(error.clone())).collect(),
        }
    }

    fn gradient(&self) -> Option<&dyn Gradient> {
        self.0.has("gradient").then_some(self)
    }
}

/// Runs of one call: the arrays that a model gets stay small, and the cost of a call does not count.
const BATCH: usize = 128;

impl Gradient for Plugin {
    fn jacobian(&self, call: &Run<'_>) -> Result<Matrix, EvalError> {
        let asked = || {
            sound(call)?;
            let inputs = crate::object::row(call.inputs);
            let message = self.0.ask(&self.run("gradient", call, &[&inputs])?)?;
            let slopes = matrix("gradient", message, call.layout.len(), call.inputs.len())?;
            numbers_only("gradient", slopes.as_slice())?;
            Ok(slopes)
        };
        self.0.or_error(asked())
    }
}
