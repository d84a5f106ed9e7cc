//! Checks of the server at the beginning of `lacuna run`.

use std::time::Duration;

use lacuna::plugin::Context;
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::problem::Complaints;
use lacuna_um_bridge::Client;
use lacuna_um_bridge::client::Error;
use lacuna_um_bridge::protocol::{About, VERSION};

use super::UmBridge;

/// Time limit for each of these requests, in seconds.
const PATIENCE: f64 = 10.0;

/// Complains of servers that cannot be reached or do not have the model with the right sizes.
pub(super) fn check(model: &UmBridge, context: &Context<'_>, complaints: &mut Complaints<'_>) {
    for url in model.addresses() {
        of_address(model, url, context, complaints);
    }
}

fn of_address(model: &UmBridge, url: &str, context: &Context<'_>, complaints: &mut Complaints<'_>) {
    let patience = Duration::from_secs_f64(model.timeout.get().min(PATIENCE));
    let client = Client::new(url, patience, 0);
    let about = model.about(model.config.clone());
    if !knows_the_model(model, url, &client, complaints) {
        return;
    }
    match client.support(&about) {
        Ok(support) if !support.evaluate => {
            let text = format!("`{}` at {url} cannot be evaluated", model.model);
            complaints
                .at("model")
                .say(text)
                .expected("a model that supports Evaluate")
                .found("one that does not");
        }
        Ok(_) => sizes(model, &client, &about, context, complaints),
        Err(error) => asked_in_vain(model, &error, complaints),
    }
}

fn asked_in_vain(model: &UmBridge, error: &Error, complaints: &mut Complaints<'_>) {
    let problem = complaints.at(model.address_key()).say(error.to_string());
    if matches!(error, Error::Unreachable { .. }) {
        problem.help("start the server first, or correct the address");
    }
}

fn knows_the_model(
    model: &UmBridge,
    url: &str,
    client: &Client,
    complaints: &mut Complaints<'_>,
) -> bool {
    let info = match client.info() {
        Ok(info) => info,
        Err(error) => {
            asked_in_vain(model, &error, complaints);
            return false;
        }
    };
    if info.protocol_version != VERSION {
        complaints
            .at(model.address_key())
            .say(format!("the server at {url} speaks another version of UM-Bridge"))
            .expected("version 1.0")
            .found(format!("version {:?}", info.protocol_version));
        return false;
    }
    if !info.models.contains(&model.model) {
        let names = || info.models.iter().map(String::as_str);
        let text = format!("the server at {url} has no model `{}`", model.model);
        let problem = complaints.at("model").say(text).expected(one_of(names()));
        problem.found(format!("`{}`", model.model));
        if let Some(near) = nearest(&model.model, names()) {
            problem.help(format!("did you mean `{near}`?"));
        }
        return false;
    }
    true
}

fn sizes(
    model: &UmBridge,
    client: &Client,
    about: &About,
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) {
    match (client.input_sizes(about), client.output_sizes(about)) {
        (Ok(inputs), Ok(outputs)) => {
            inputs_fit(model, &inputs, context, complaints);
            outputs_fit(model, &outputs, context, complaints);
        }
        (Err(error), _) | (_, Err(error)) => asked_in_vain(model, &error, complaints),
    }
}

fn inputs_fit(
    model: &UmBridge,
    sizes: &[usize],
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) {
    let takes = format!("`{}` at {} takes other inputs", model.model, model.place());
    if let Some(vectors) = &model.inputs {
        let ours: Vec<usize> = vectors.iter().map(Vec::len).collect();
        if ours != sizes {
            complaints
                .at("inputs")
                .say(takes)
                .expected(format!("vectors of the sizes {sizes:?}"))
                .found(format!("{ours:?}"));
        }
        return;
    }
    let names = model.input_names(context);
    let names: Vec<String> = names
        .iter()
        .filter(|name| !model.config_inputs.contains(name))
        .map(|name| format!("`{name}`"))
        .collect();
    if sizes.iter().sum::<usize>() != names.len() {
        complaints
            .at("")
            .say(takes)
            .expected(format!(
                "{} inputs, for vectors of the sizes {sizes:?}",
                sizes.iter().sum::<usize>()
            ))
            .found(format!("{}: {}", names.len(), names.join(", ")));
    }
}

fn outputs_fit(
    model: &UmBridge,
    sizes: &[usize],
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) {
    let all: Vec<usize> = (0..sizes.len()).collect();
    let chosen = model.outputs.as_deref().unwrap_or(&all);
    let path = if model.outputs.is_some() { "outputs" } else { "" };
    if let Some(&unknown) = chosen.iter().find(|&&i| i >= sizes.len()) {
        complaints
            .at("outputs")
            .say(format!("`{}` at {} has no output vector {unknown}", model.model, model.place()))
            .expected(format!("numbers below {}", sizes.len()))
            .found(unknown);
        return;
    }
    let (found, expected): (usize, usize) =
        (chosen.iter().map(|&i| sizes[i]).sum(), context.layout.len());
    if found != expected {
        complaints
            .at(path)
            .say(format!(
                "the outputs of `{}` at {} do not fill the response",
                model.model,
                model.place()
            ))
            .expected(format!("{expected} values, as `[response]` has them"))
            .found(format!("{found}, in vectors of the sizes {sizes:?}"));
    }
}
