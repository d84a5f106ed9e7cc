//! Checks of the options of `external`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use lacuna::plugin::Context;
use lacuna::text::nearest::nearest;
use lacuna::text::problem::{Complaints, Problem};

use super::folder::stays_inside;
use super::run::{NOT_INPUTS, STDERR, STDIN, STDOUT, of_the_study};
use super::template::{Place, Template};
use super::{External, Input, Output, given};
use lacuna_run::process;

/// Checks the options against the rest of the study.
pub fn options(model: &External, context: &Context<'_>, complaints: &mut Complaints<'_>) {
    if model.command.first().is_none_or(|word| word.as_str().trim().is_empty()) {
        complaints
            .at("command")
            .say("there is no command")
            .expected("a program and its arguments, such as `[\"./solver\", \"deck.i\"]`");
    }
    for name in NOT_INPUTS {
        if context.given.iter().any(|input| input.name == name) {
            complaints
                .at("")
                .say(format!("the input name `{name}` is reserved for another value in templates"))
                .help(format!(
                    "give it another name than {}",
                    given::listed(NOT_INPUTS.into_iter())
                ));
        }
    }
    let mut all_known = true;
    for (path, template) in texts(model) {
        for place in template.places() {
            if let Some(unknown) = Unknown::of(place, context) {
                all_known = false;
                let spot = complaints.at(&path).inside(place.at.clone());
                unknown.explain(spot.say(unknown.message()));
            }
        }
    }
    given::check_units(&model.units, context, complaints);
    places(model, complaints);
    if let Output::File(file) = &model.output {
        file.check(context, complaints);
    }
    if all_known && model.templates.is_empty() {
        unused(model, BTreeSet::new(), context, complaints);
    }
}

/// Checks the options against the files and programs of the machine.
pub fn files(model: &External, context: &Context<'_>, complaints: &mut Complaints<'_>) {
    program(model, context, complaints);
    let mut read = Some(BTreeSet::new());
    for (i, template) in model.templates.iter().enumerate() {
        let path = beside(context, &template.from);
        let spot = format!("templates.{i}.from");
        let used = template_file(&path, &spot, context, complaints);
        read = read.zip(used).map(|(all, used)| all.union(&used).cloned().collect());
    }
    if let (Some(read), false) = (read, model.templates.is_empty()) {
        unused(model, read, context, complaints);
    }
    for (key, paths) in [("copy", &model.copy), ("link", &model.link)] {
        for (i, path) in paths.iter().enumerate() {
            let path = beside(context, path);
            if !path.exists() {
                let text = format!("there is no file `{}`", path.display());
                complaints.at(&format!("{key}.{i}")).say(text);
            }
        }
    }
}

/// Iterates over the templates in the study itself, with their paths in the section.
fn texts(model: &External) -> impl Iterator<Item = (String, &Template)> {
    let words = model.command.iter().enumerate().map(|(i, word)| (format!("command.{i}"), word));
    let variables = model.environment.iter();
    words.chain(variables.map(|(key, text)| (format!("environment.{key}"), text)))
}

/// An unknown name in a template, or a format where none is allowed.
struct Unknown<'a> {
    place: &'a Place,
    names: Vec<&'a str>,
}

impl<'a> Unknown<'a> {
    fn of(place: &'a Place, context: &Context<'a>) -> Option<Self> {
        let inputs = context.given.iter().map(|input| input.name.as_str());
        let known = inputs.clone().any(|name| name == place.name);
        let text = NOT_INPUTS.contains(&place.name.as_str()) && place.format.is_none();
        (!known && !text).then(|| Self { place, names: inputs.chain(NOT_INPUTS).collect() })
    }

    fn message(&self) -> String {
        let name = &self.place.name;
        if NOT_INPUTS.contains(&name.as_str()) {
            return format!("`{name}` is a text and takes no format");
        }
        format!("there is no input `{name}`")
    }

    fn explain(&self, problem: &mut Problem) {
        if NOT_INPUTS.contains(&self.place.name.as_str()) {
            return;
        }
        problem.expected(given::listed(self.names.iter().copied()));
        if let Some(near) = nearest(&self.place.name, self.names.iter().copied()) {
            problem.help(format!("did you mean `{near}`?"));
        }
    }
}

/// Returns the inputs that a template file uses; `None` if it is invalid.
fn template_file(
    path: &Path,
    spot: &str,
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) -> Option<BTreeSet<String>> {
    let text = match fs::read(path).map(String::from_utf8) {
        Ok(Ok(text)) => text,
        Ok(Err(error)) => {
            let byte = error.utf8_error().valid_up_to();
            let text = format!("`{}` is no UTF-8 text (byte {byte})", path.display());
            complaints.at(spot).say(text);
            return None;
        }
        Err(_) => {
            complaints.at(spot).say(format!("there is no file `{}`", path.display()));
            return None;
        }
    };
    let located = |at: usize, message: &str| {
        let (line, column) = Template::position(&text, at);
        format!("{}:{line}:{column}: {message}", path.display())
    };
    let template = match Template::parse(text.as_str()) {
        Ok(template) => template,
        Err(error) => {
            complaints.at(spot).say(located(error.at, &error.message));
            return None;
        }
    };
    let mut all_known = true;
    for unknown in template.places().filter_map(|place| Unknown::of(place, context)) {
        all_known = false;
        let said = located(unknown.place.at.start, &unknown.message());
        unknown.explain(complaints.at(spot).say(said));
    }
    all_known.then(|| template.places().map(|place| place.name.clone()).collect())
}

/// Reports inputs that do not reach the command, because the response could not depend on them.
fn unused(
    model: &External,
    mut used: BTreeSet<String>,
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) {
    if model.input == Input::Json {
        return;
    }
    for (_, template) in texts(model) {
        used.extend(template.places().map(|place| place.name.clone()));
    }
    for input in context.given.iter().filter(|input| !used.contains(&input.name)) {
        let name = &input.name;
        let key = if model.templates.is_empty() { "" } else { "templates" };
        complaints
            .at(key)
            .say(format!("the input `{name}` does not reach the command"))
            .help(format!("write `{{{{ {name} }}}}` into a template, or say `input = \"json\"`"));
    }
}

/// Reports files that would lie outside the run's folder, or coincide.
fn places(model: &External, complaints: &mut Complaints<'_>) {
    let mut taken: Vec<&Path> = [STDOUT, STDERR, STDIN].map(Path::new).to_vec();
    let copied =
        [("copy", &model.copy), ("link", &model.link)].into_iter().flat_map(|(key, list)| {
            list.iter()
                .enumerate()
                .map(move |(i, path)| (format!("{key}.{i}"), path, path.file_name()))
        });
    let made = model.templates.iter().enumerate();
    let made =
        made.map(|(i, file)| (format!("templates.{i}.to"), &file.to, Some(file.to.as_os_str())));
    for (spot, written, name) in copied.chain(made) {
        let path = Path::new(name.unwrap_or_default());
        if !stays_inside(path) {
            outside(&spot, written, complaints);
        } else if taken.contains(&path) {
            let text = format!("a run's folder already has a file `{}`", path.display());
            complaints.at(&spot).say(text);
        }
        taken.push(path);
    }
    if !stays_inside(&model.success.file) {
        outside("success.file", &model.success.file, complaints);
    }
    if let Output::File(file) = &model.output
        && !file.path().as_os_str().is_empty()
        && !stays_inside(file.path())
    {
        outside("output.path", file.path(), complaints);
    }
}

/// A path of the study as messages name it: `./solver` and not `././solver` for a study in the current directory.
fn beside(context: &Context<'_>, path: &Path) -> PathBuf {
    context.directory.join(path).components().collect()
}

fn outside(spot: &str, path: &Path, complaints: &mut Complaints<'_>) {
    complaints
        .at(spot)
        .say("this is not a path inside a run's folder")
        .expected("a relative path without `..`")
        .found(format!("`{}`", path.display()));
}

/// Reports a command that does not exist.
fn program(model: &External, context: &Context<'_>, complaints: &mut Complaints<'_>) {
    let fill = |template: &Template| template.fill(|name| of_the_study(name, context.directory));
    let Some(Ok(name)) = model.command.first().map(fill) else { return };
    let path = model.environment.get("PATH").and_then(|path| fill(path).ok());
    if process::find(&name, context.directory, path.as_deref().map(AsRef::as_ref)).is_some() {
        return;
    }
    let spot = complaints.at("command.0");
    if Path::new(&name).components().count() > 1 {
        let path = beside(context, Path::new(&name));
        if path.is_file() {
            spot.say(format!("`{}` is not an executable file", path.display()));
        } else {
            spot.say(format!("there is no file `{}`: the command is not there", path.display()));
        }
    } else {
        spot.say(format!(
            "there is no file `{name}` in the folders of `PATH`: the command is not there"
        ))
        .help("install it, or write its path");
    }
}
