//! From a request to its response.

use std::panic::{AssertUnwindSafe, catch_unwind};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::model::unsupported;
use super::{Model, Shared, fault, status};
use crate::http::Request;
use crate::protocol::{
    About, ApplyHessian, ApplyJacobian, Config, Evaluate, Fault, Gradient, INTERNAL_ERROR,
    INVALID_INPUT, INVALID_OUTPUT, Info, InputSizes, MODEL_NOT_FOUND, ModelInfo, Output,
    OutputSizes, VERSION,
};

/// Paths that accept `POST`.
const POSTED: [&str; 7] = [
    "/ModelInfo",
    "/InputSizes",
    "/OutputSizes",
    "/Evaluate",
    "/Gradient",
    "/ApplyJacobian",
    "/ApplyHessian",
];

/// HTTP status and body of the response.
pub(super) fn answer(request: &Request, shared: &Shared<'_>) -> (u16, String) {
    let (method, path) = (request.method.as_str(), request.path.as_str());
    match method {
        "GET" if path == "/Info" => return (200, info(shared.models)),
        "POST" if POSTED.contains(&path) => {}
        _ if path == "/Info" || POSTED.contains(&path) => {
            let right = if path == "/Info" { "GET" } else { "POST" };
            let text = format!("`{path}` is asked with {right}, not {method}");
            return (405, fault(INVALID_INPUT, text));
        }
        _ => {
            let text = format!("there is no `{path}`: ask /Info, {}", POSTED.join(", "));
            return (404, fault(INVALID_INPUT, text));
        }
    }
    let work = || posted(path, &request.body, shared);
    // A panic of the model must fail only its own request.
    let outcome = catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(Fault::new(INTERNAL_ERROR, "the model panicked")));
    match outcome {
        Ok(body) => (200, body),
        Err(found) => (status(&found), fault(&found.kind, found.message.clone())),
    }
}

fn info(models: &[&dyn Model]) -> String {
    let models = models.iter().map(|model| model.name().to_owned()).collect();
    written(&Info { protocol_version: VERSION, models }).unwrap_or_default()
}

fn posted(path: &str, body: &[u8], shared: &Shared<'_>) -> Result<String, Fault> {
    match path {
        "/ModelInfo" => {
            let about: About = read(body)?;
            let support = find(shared, &about.name)?.support();
            written(&ModelInfo { support })
        }
        "/InputSizes" => {
            let about: About = read(body)?;
            let input_sizes = find(shared, &about.name)?.input_sizes(&about.config)?;
            written(&InputSizes { input_sizes })
        }
        "/OutputSizes" => {
            let about: About = read(body)?;
            let output_sizes = find(shared, &about.name)?.output_sizes(&about.config)?;
            written(&OutputSizes { output_sizes })
        }
        "/Evaluate" => evaluate(&read(body)?, shared),
        "/Gradient" => gradient(&read(body)?, shared),
        "/ApplyJacobian" => apply_jacobian(&read(body)?, shared),
        _ => apply_hessian(&read(body)?, shared),
    }
}

fn evaluate(question: &Evaluate, shared: &Shared<'_>) -> Result<String, Fault> {
    let model = find(shared, &question.name)?;
    supported(model, "Evaluate", model.support().evaluate)?;
    let sizes = Sizes::of(model, &question.config)?;
    sizes.fit(&question.input)?;
    let output = shared.turns.take(|| model.evaluate(&question.input, &question.config))?;
    let lengths: Vec<usize> = output.iter().map(Vec::len).collect();
    if lengths != sizes.outputs {
        let text = format!("the outputs have the sizes {lengths:?}, not {:?}", sizes.outputs);
        return Err(Fault::new(INVALID_OUTPUT, text));
    }
    output.iter().try_for_each(|vector| finite(vector))?;
    written(&Output { output })
}

fn gradient(question: &Gradient, shared: &Shared<'_>) -> Result<String, Fault> {
    let Gradient { name, out_wrt, in_wrt, input, sens, config } = question;
    let model = find(shared, name)?;
    supported(model, "Gradient", model.support().gradient)?;
    let sizes = Sizes::of(model, config)?;
    sizes.fit(input)?;
    let expected = sizes.input("inWrt", *in_wrt)?;
    same("sens", sens.len(), sizes.output(*out_wrt)?)?;
    let work = || model.gradient(*out_wrt, *in_wrt, input, sens, config);
    vector(shared.turns.take(work)?, expected)
}

fn apply_jacobian(question: &ApplyJacobian, shared: &Shared<'_>) -> Result<String, Fault> {
    let ApplyJacobian { name, out_wrt, in_wrt, input, vec, config } = question;
    let model = find(shared, name)?;
    supported(model, "ApplyJacobian", model.support().apply_jacobian)?;
    let sizes = Sizes::of(model, config)?;
    sizes.fit(input)?;
    let expected = sizes.output(*out_wrt)?;
    same("vec", vec.len(), sizes.input("inWrt", *in_wrt)?)?;
    let work = || model.apply_jacobian(*out_wrt, *in_wrt, input, vec, config);
    vector(shared.turns.take(work)?, expected)
}

fn apply_hessian(question: &ApplyHessian, shared: &Shared<'_>) -> Result<String, Fault> {
    let ApplyHessian { name, out_wrt, in_wrt1, in_wrt2, input, sens, vec, config } = question;
    let model = find(shared, name)?;
    supported(model, "ApplyHessian", model.support().apply_hessian)?;
    let sizes = Sizes::of(model, config)?;
    sizes.fit(input)?;
    let expected = sizes.input("inWrt1", *in_wrt1)?;
    same("vec", vec.len(), sizes.input("inWrt2", *in_wrt2)?)?;
    same("sens", sens.len(), sizes.output(*out_wrt)?)?;
    let places = [*in_wrt1, *in_wrt2];
    let work = || model.apply_hessian(*out_wrt, places, input, sens, vec, config);
    vector(shared.turns.take(work)?, expected)
}

fn find<'a>(shared: &Shared<'a>, name: &str) -> Result<&'a dyn Model, Fault> {
    shared.models.iter().copied().find(|model| model.name() == name).ok_or_else(|| {
        let names: Vec<String> = shared.models.iter().map(|m| format!("`{}`", m.name())).collect();
        let text = format!("there is no model `{name}`; there are {}", names.join(", "));
        Fault::new(MODEL_NOT_FOUND, text)
    })
}

fn supported(model: &dyn Model, what: &str, supported: bool) -> Result<(), Fault> {
    if supported { Ok(()) } else { Err(unsupported(what, model.name())) }
}

/// Sizes of a model's vectors under given settings.
struct Sizes {
    inputs: Vec<usize>,
    outputs: Vec<usize>,
}

impl Sizes {
    fn of(model: &dyn Model, config: &Config) -> Result<Self, Fault> {
        Ok(Self { inputs: model.input_sizes(config)?, outputs: model.output_sizes(config)? })
    }

    fn fit(&self, input: &[Vec<f64>]) -> Result<(), Fault> {
        let found: Vec<usize> = input.iter().map(Vec::len).collect();
        if found == self.inputs {
            return Ok(());
        }
        let text = format!("the inputs have the sizes {found:?}, expected {:?}", self.inputs);
        Err(Fault::new(INVALID_INPUT, text))
    }

    fn input(&self, what: &str, index: usize) -> Result<usize, Fault> {
        self.inputs.get(index).copied().ok_or_else(|| outside(what, index, self.inputs.len()))
    }

    fn output(&self, index: usize) -> Result<usize, Fault> {
        self.outputs.get(index).copied().ok_or_else(|| outside("outWrt", index, self.outputs.len()))
    }
}

fn outside(what: &str, index: usize, count: usize) -> Fault {
    Fault::new(INVALID_INPUT, format!("`{what}` is {index}, expected less than {count}"))
}

fn same(what: &str, found: usize, expected: usize) -> Result<(), Fault> {
    if found == expected {
        return Ok(());
    }
    Err(Fault::new(INVALID_INPUT, format!("`{what}` has the size {found}, expected {expected}")))
}

fn vector(output: Vec<f64>, expected: usize) -> Result<String, Fault> {
    let found = output.len();
    if found != expected {
        let text = format!("the derivative has the size {found}, not {expected}");
        return Err(Fault::new(INVALID_OUTPUT, text));
    }
    finite(&output)?;
    written(&Output { output })
}

fn finite(values: &[f64]) -> Result<(), Fault> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(i) => Err(Fault::new(INVALID_OUTPUT, format!("value {i} is {}", values[i]))),
        None => Ok(()),
    }
}

fn read<T: DeserializeOwned>(body: &[u8]) -> Result<T, Fault> {
    serde_json::from_slice(body)
        .map_err(|error| Fault::new(INVALID_INPUT, format!("the question does not read: {error}")))
}

fn written(answer: &impl Serialize) -> Result<String, Fault> {
    serde_json::to_string(answer)
        .map_err(|error| Fault::new(INTERNAL_ERROR, format!("the answer is no JSON: {error}")))
}
