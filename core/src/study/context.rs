//! Second layer of checking: the sections of a study against each other.

use super::nearest::{nearest, one_of};
use super::resolve::Study;
use super::{Complaints, Node, Problems};
use crate::data::{Coordinates, Parameter};
use crate::plugin::model::{Input, Signature};
use crate::plugin::{Surrogate, registry};

/// Reports everything that is inconsistent.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let mut complaints = Complaints::new(root, problems);
    if study.target.is_some() {
        beside_a_target(study, root, &mut complaints);
    } else {
        sections(study, &mut complaints);
    }
    parameters(study, &mut complaints);
    runs(study, &mut complaints);
    refinement(study, &mut complaints);
    validation(study, &mut complaints);
    if let Some(model) = &study.model {
        let signature = model.built.plugin.signature(&study.context());
        inputs(study, &signature, &mut complaints);
        outputs(study, &signature, &mut complaints);
    }
    study.each_plugin(root, problems, |component, context, complaints| {
        component.check(context, complaints);
    });
}

/// A target takes the place of all that makes a likelihood.
fn beside_a_target(study: &Study, root: &Node, complaints: &mut Complaints<'_>) {
    const ALONE: [&str; 5] = ["study", "parameter", "target", "executor", "sampler"];
    for (key, _) in root.entries().iter().filter(|(key, _)| !ALONE.contains(&key.name.as_str())) {
        complaints
            .at(&key.name)
            .say(format!("a study with `[target]` has no use for `[{}]`", key.name))
            .help("the target is the whole log density: take one of the two out");
    }
    if study.sampler.is_none() {
        complaints
            .at("")
            .say("the study has no `[sampler]`")
            .help("a target is there to be sampled: add `[sampler]`");
    }
}

/// What a section needs of the others.
fn sections(study: &Study, complaints: &mut Complaints<'_>) {
    let imported = study.simulations.as_ref().is_some_and(|s| s.built.plugin.names_files());
    let simulated = study.model.is_some() && study.design.is_some();
    if !imported && !simulated {
        complaints.at("").say("the study has no simulation runs").expected(
            "`[model]` and `[design]`, or `[simulations]` with the files of finished runs",
        );
    }
    if study.numerical_error.is_some() && (!simulated || imported) {
        complaints
            .at("numerical_error")
            .say("the study makes no runs that could be repeated")
            .expected("`[model]` and `[design]`, and no files of finished runs in `[simulations]`");
    }
    if study.surrogate.is_none() {
        let names = registry::entries::<dyn Surrogate>().into_iter().map(|entry| entry.name);
        complaints
            .at("")
            .say("the study has no `[surrogate]`")
            .help(format!("add the section, with `use` set to {}", one_of(names)));
    }
    let calibration = [
        ("measurements", study.measurements.is_some()),
        ("discrepancy", study.discrepancy.is_some()),
        ("sampler", study.sampler.is_some()),
    ];
    if calibration.iter().any(|(_, there)| *there) {
        for (name, _) in calibration.iter().filter(|(_, there)| !there) {
            complaints
                .at("")
                .say(format!("the study has no `[{name}]`"))
                .help("a calibration needs `[measurements]`, `[discrepancy]` and `[sampler]`");
        }
    }
}

fn parameters(study: &Study, complaints: &mut Complaints<'_>) {
    for (i, parameter) in study.parameters.iter().enumerate() {
        if study.parameters[..i].iter().any(|other| other.name == parameter.name) {
            complaints
                .at(&format!("parameter.{}.name", parameter.name))
                .say(format!("there are two parameters `{}`", parameter.name))
                .help("give each `[[parameter]]` its own name");
        }
        inside_design(parameter, complaints);
        if let Some(value) = parameter.reference.filter(|value| !value.is_finite()) {
            complaints
                .at(&format!("parameter.{}.reference", parameter.name))
                .say("the reference is not a number")
                .expected("a finite number")
                .found(value);
        }
    }
}

/// An emulator is trained inside the design; a prior that reaches further asks it to extrapolate.
fn inside_design(parameter: &Parameter, complaints: &mut Complaints<'_>) {
    let (low, high) = parameter.design.support();
    let bulk = [0.025, 0.975].map(|p| parameter.prior.quantile(p));
    if bulk[0] < low || bulk[1] > high {
        complaints
            .at(&format!("parameter.{}.prior", parameter.name))
            .say(format!("the prior of `{}` reaches beyond its design", parameter.name))
            .expected(format!("95 % of the prior inside [{low}, {high}]"))
            .found(format!("[{}, {}]", bulk[0], bulk[1]))
            .help("widen `design`: outside it the surrogate has no runs to learn from");
    }
}

fn refinement(study: &Study, complaints: &mut Complaints<'_>) {
    let refine = study.surrogate.as_ref().and_then(|s| s.common.refine.as_ref());
    if refine.is_none() {
        return;
    }
    if study.model.is_none() {
        complaints
            .at("surrogate.refine")
            .say("the study has no model to run again")
            .expected("a `[model]` section, or no `refine`");
    }
    if study.sampler.is_none() {
        complaints
            .at("surrogate.refine")
            .say("refinement needs a calibration")
            .expected("`[measurements]`, `[discrepancy]` and `[sampler]`, or no `refine`");
    }
}

fn runs(study: &Study, complaints: &mut Complaints<'_>) {
    let (Some(design), Some(surrogate)) = (&study.design, &study.surrogate) else { return };
    let imported = study.simulations.as_ref().is_some_and(|s| s.built.plugin.names_files());
    let (runs, kept) = (design.common.runs.get(), surrogate.common.validation);
    let training = surrogate.common.training.map_or(1, usize::from);
    if !imported && training + kept > runs {
        let key = if surrogate.common.training.is_some() { "training" } else { "validation" };
        complaints
            .at(&format!("surrogate.{key}"))
            .say("more runs for training and validation than the design makes")
            .expected(format!("at most {runs} together"))
            .found(training + kept);
    }
}

fn validation(study: &Study, complaints: &mut Complaints<'_>) {
    if study.validate.rerun_model == Some(true) && study.model.is_none() {
        complaints
            .at("validate.rerun_model")
            .say("the study has no model to run again")
            .expected("a `[model]` section, or `rerun_model = false`");
    }
    if study.validate.emulator_check > 0 && study.model.is_none() {
        complaints
            .at("validate.emulator_check")
            .say("the study has no model to check the emulator against")
            .expected("a `[model]` section, or `emulator_check = 0`");
    }
    if study.validate.against.is_some() {
        for parameter in study.parameters.iter().filter(|p| p.reference.is_none()) {
            complaints
                .at("validate.against")
                .say(format!("the parameter `{}` has no `reference`", parameter.name))
                .expected("a `reference` for every parameter");
        }
    }
}

fn inputs(study: &Study, signature: &Signature, complaints: &mut Complaints<'_>) {
    let names = || signature.inputs.iter().map(|input| input.name.as_str());
    let listed = names().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
    for parameter in &study.parameters {
        let path = format!("parameter.{}", parameter.name);
        if let Some(input) = signature.inputs.iter().find(|input| input.name == parameter.name) {
            input_fits(parameter, input, &path, complaints);
            continue;
        }
        let problem = complaints
            .at(&format!("{path}.name"))
            .say(format!("the model has no input `{}`", parameter.name))
            .expected(format!("one of {listed}"));
        if let Some(near) = nearest(&parameter.name, names()) {
            problem.help(format!("did you mean `{near}`?"));
        }
    }
    let fixed = study.model.as_ref().map(|model| &model.common.fixed);
    for (name, &value) in fixed.into_iter().flatten() {
        let path = format!("model.fixed.{name}");
        let Some(input) = signature.inputs.iter().find(|input| &input.name == name) else {
            let problem = complaints
                .at(&path)
                .say(format!("the model has no input `{name}`"))
                .expected(format!("one of {listed}"));
            if let Some(near) = nearest(name, names()) {
                problem.help(format!("did you mean `{near}`?"));
            }
            continue;
        };
        if study.parameters.iter().any(|p| &p.name == name) {
            complaints
                .at(&path)
                .say(format!("`{name}` is both fixed and a parameter"))
                .help("take it out of one of the two");
        }
        if !(input.range.0..=input.range.1).contains(&value) {
            out_of_range(input, value, &input.unit.to_string(), &path, complaints);
        }
    }
    let set = |name: &str| {
        study.parameters.iter().any(|p| p.name == name)
            || fixed.is_some_and(|fixed| fixed.contains_key(name))
    };
    for input in signature.inputs.iter().filter(|i| i.default.is_none() && !set(&i.name)) {
        complaints
            .at("model")
            .say(format!("nothing sets the model's input `{}`", input.name))
            .help(format!(
                "add a `[[parameter]]` of that name, or `fixed = {{ {} = … }}`",
                input.name
            ));
    }
}

fn input_fits(parameter: &Parameter, input: &Input, path: &str, complaints: &mut Complaints<'_>) {
    let Some(factor) = parameter.unit.factor_to(&input.unit) else {
        complaints
            .at(&format!("{path}.unit"))
            .say(format!("`{}` has the wrong unit", parameter.name))
            .expected(format!("a unit that converts to `{}`", input.unit))
            .found(format!("`{}`", parameter.unit));
        return;
    };
    let (low, high) = parameter.design.support();
    for edge in [low, high] {
        // Conversions round; a bound that agrees to 12 digits is the bound.
        let slack = 1e-12 * (edge * factor).abs();
        let value = edge * factor;
        if value < input.range.0 - slack || value > input.range.1 + slack {
            let key = format!("{path}.design");
            out_of_range(input, value, &input.unit.to_string(), &key, complaints);
        }
    }
}

fn out_of_range(
    input: &Input,
    value: f64,
    unit: &str,
    path: &str,
    complaints: &mut Complaints<'_>,
) {
    let (low, high) = input.range;
    let range = match (low.is_finite(), high.is_finite()) {
        (true, true) => format!("values from {low} to {high} {unit}"),
        (true, false) => format!("values from {low} {unit} up"),
        _ => format!("values up to {high} {unit}"),
    };
    complaints
        .at(path)
        .say(format!("`{}` leaves the range in which the model answers", input.name))
        .expected(range)
        .found(format!("{value} {unit}"));
}

fn outputs(study: &Study, signature: &Signature, complaints: &mut Complaints<'_>) {
    let (ours, theirs) = (&study.layout, &signature.layout);
    if ours.unit.factor_to(&theirs.unit).is_none() {
        complaints
            .at("response.unit")
            .say(format!("the model's `{}` has another dimension", theirs.name))
            .expected(format!("a unit that converts to `{}`", theirs.unit))
            .found(format!("`{}`", ours.unit));
    }
    let names = |axes: &[crate::data::Axis]| {
        axes.iter().map(|a| format!("`{}`", a.name)).collect::<Vec<_>>().join(", ")
    };
    let same_names = ours.axes.len() == theirs.axes.len()
        && ours.axes.iter().zip(&theirs.axes).all(|(a, b)| a.name == b.name);
    if !same_names {
        complaints
            .at("response.axes")
            .say("the model's response has other axes")
            .expected(if theirs.axes.is_empty() {
                "no axes".to_owned()
            } else {
                names(&theirs.axes)
            })
            .found(if ours.axes.is_empty() { "none".to_owned() } else { names(&ours.axes) });
        return;
    }
    for (a, b) in ours.axes.iter().zip(&theirs.axes) {
        let path = format!("response.axes.{}", a.name);
        match (&a.coordinates, &b.coordinates) {
            (Coordinates::Labels(labels), Coordinates::Labels(known)) => {
                for label in labels.iter().filter(|label| !known.contains(label)) {
                    let listed = known.iter().map(|l| format!("`{l}`")).collect::<Vec<_>>();
                    complaints
                        .at(&path)
                        .say(format!("the model has no {} `{label}`", a.name))
                        .expected(format!("some of {}", listed.join(", ")));
                }
            }
            (Coordinates::Grid { unit, .. }, Coordinates::Grid { unit: known, .. }) => {
                if unit.factor_to(known).is_none() {
                    complaints
                        .at(&format!("{path}.unit"))
                        .say(format!("the axis `{}` has the wrong unit", a.name))
                        .expected(format!("a unit that converts to `{known}`"))
                        .found(format!("`{unit}`"));
                }
            }
            (Coordinates::Labels(_), Coordinates::Grid { .. }) => {
                complaints
                    .at(&path)
                    .say(format!("the axis `{}` is a grid of numbers", a.name))
                    .expected("a table such as `{ first = 1e-5, last = 1e-3, count = 100, unit = \"s\" }`")
                    .found("labels");
            }
            (Coordinates::Grid { .. }, Coordinates::Labels(_)) => {
                complaints
                    .at(&path)
                    .say(format!("the axis `{}` is a list of labels", a.name))
                    .expected("a list such as `[\"B\", \"C\"]`")
                    .found("a grid of numbers");
            }
        }
    }
}
