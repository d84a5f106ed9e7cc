//! Arrangement of the study's inputs in the model's input vectors.

use lacuna::plugin::Context;
use lacuna::plugin::model::{Call, EvalError};
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::problem::Complaints;
use lacuna_um_bridge::protocol::Config;
use serde_json::Value;

use super::{UmBridge, refused};

/// An evaluation request to the server.
pub(super) struct Question {
    /// Input vectors.
    pub(super) input: Vec<Vec<f64>>,
    /// Vector and position in it of each input of the call; `None` for an input among the settings.
    pub(super) places: Vec<Option<(usize, usize)>>,
    /// Settings.
    pub(super) config: Config,
}

fn fatal<T>(message: String) -> Result<T, EvalError> {
    Err(EvalError::Fatal(message))
}

impl UmBridge {
    /// The names of the model's inputs without repetition, those of the vectors first.
    pub(super) fn input_names(&self, context: &Context<'_>) -> Vec<String> {
        let given = || context.given.iter().map(|given| &given.name);
        let vectors: Vec<&String> = match &self.inputs {
            Some(vectors) => vectors.iter().flatten().collect(),
            None => given().filter(|name| !self.config_inputs.contains(name)).collect(),
        };
        let mut names: Vec<String> = Vec::new();
        // Names without a value are complained about in `check`.
        let config_inputs = self.config_inputs.iter().filter(|name| given().any(|g| g == *name));
        for name in vectors.into_iter().chain(config_inputs) {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }

    /// The request for a call. Fails if an input is missing or not finite, or if the inputs do not fit the vectors.
    pub(super) fn arranged(&self, call: &Call<'_>) -> Result<Question, EvalError> {
        if call.inputs.len() != call.names.len() {
            let (found, expected) = (call.inputs.len(), call.names.len());
            return fatal(format!("expected {expected} inputs, found {found}"));
        }
        if let Some(i) = call.inputs.iter().position(|x| !x.is_finite()) {
            let (name, value) = (&call.names[i], call.inputs[i]);
            return Err(EvalError::Rejected(format!("the input `{name}` is {value}")));
        }
        let vectors = self.vectors(call.names)?;
        let input =
            vectors.iter().map(|vector| vector.iter().map(|&i| call.inputs[i]).collect()).collect();
        let mut places = vec![None; call.names.len()];
        for (v, vector) in vectors.iter().enumerate() {
            for (k, &i) in vector.iter().enumerate() {
                places[i] = Some((v, k));
            }
        }
        Ok(Question { input, places, config: self.settings(call)? })
    }

    /// The indices of the inputs in each vector.
    fn vectors(&self, names: &[String]) -> Result<Vec<Vec<usize>>, EvalError> {
        let index = |name: &String| match names.iter().position(|known| known == name) {
            Some(i) => Ok(i),
            None => fatal(format!("the input `{name}` has no value")),
        };
        if let Some(vectors) = &self.inputs {
            return vectors.iter().map(|v| v.iter().map(index).collect()).collect();
        }
        let all = (0..names.len()).filter(|&i| !self.config_inputs.contains(&names[i]));
        let all: Vec<usize> = all.collect();
        let sizes = self.input_sizes().map_err(refused)?;
        if sizes.iter().sum::<usize>() != all.len() {
            let (url, model, count) = (self.place(), &self.model, all.len());
            return fatal(format!(
                "`{model}` at {url} takes input vectors of the sizes {sizes:?}, the study has {count} inputs"
            ));
        }
        let mut rest = all.as_slice();
        let split = sizes.iter().map(|&size| {
            let (vector, others) = rest.split_at(size);
            rest = others;
            vector.to_vec()
        });
        Ok(split.collect())
    }

    /// The settings for a call.
    fn settings(&self, call: &Call<'_>) -> Result<Config, EvalError> {
        let mut config = self.config.clone();
        for name in &self.config_inputs {
            let Some(i) = call.names.iter().position(|known| known == name) else {
                return fatal(format!("the input `{name}` has no value"));
            };
            config.insert(name.clone(), Value::from(call.inputs[i]));
        }
        let scenario = &call.scenario.name;
        if !scenario.is_empty() && !config.contains_key("scenario") {
            config.insert("scenario".to_owned(), Value::from(scenario.as_str()));
        }
        Ok(config)
    }

    /// Complains if neither or both of `url` and `urls` are given, and of invalid addresses.
    pub(super) fn check_address(&self, complaints: &mut Complaints<'_>) {
        if self.url.is_empty() == self.urls.is_empty() {
            let found = if self.url.is_empty() { "neither" } else { "both" };
            complaints
                .at("url")
                .say("a model has either one address or several")
                .expected("`url` or `urls`")
                .found(found);
            return;
        }
        for url in self.addresses() {
            let host = url.strip_prefix("http://").map(|rest| rest.trim_end_matches('/'));
            if host.is_none_or(|host| host.is_empty() || host.contains(char::is_whitespace)) {
                complaints
                    .at(self.address_key())
                    .say("this is not an address of an UM-Bridge server")
                    .expected("an address such as `http://localhost:4242`")
                    .found(format!("`{url}`"));
            }
        }
    }

    /// Name of the option that holds the addresses.
    pub(super) fn address_key(&self) -> &'static str {
        if self.urls.is_empty() { "url" } else { "urls" }
    }

    /// Complains of inputs that are listed twice, have no value or cannot be sent as settings.
    pub(super) fn check_names(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let vectors: Vec<&String> = self.inputs.iter().flatten().flatten().collect();
        for (i, name) in vectors.iter().enumerate() {
            if vectors[..i].contains(name) {
                complaints.at("inputs").say(format!("`{name}` is listed twice in `inputs`"));
            }
        }
        for name in &self.config_inputs {
            if vectors.contains(&name) {
                let text = format!("`{name}` is listed both in `inputs` and in `config_inputs`");
                complaints.at("config_inputs").say(text).help("take it out of one of the two");
            } else if context.parameters.iter().any(|parameter| &parameter.name == name) {
                complaints
                    .at("config_inputs")
                    .say(format!("`{name}` is an unknown of the study"))
                    .expected("fixed values or values of scenarios")
                    .help("list it in `inputs`: servers give derivatives only with respect to input vectors");
            } else if !context.given.iter().any(|given| &given.name == name) {
                let names = || context.given.iter().map(|given| given.name.as_str());
                let problem = complaints
                    .at("config_inputs")
                    .say(format!("nothing in the study sets `{name}`"))
                    .expected(one_of(names()));
                if let Some(near) = nearest(name, names()) {
                    problem.help(format!("did you mean `{near}`?"));
                }
            }
        }
        if self.outputs.as_ref().is_some_and(Vec::is_empty) {
            complaints
                .at("outputs")
                .say("the response needs at least one output vector")
                .expected("at least one number, or no `outputs` for all vectors");
        }
    }
}
