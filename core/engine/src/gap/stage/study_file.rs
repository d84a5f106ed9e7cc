//! The study with the effects, as a file beside the original one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use lacuna::text::emit::{key, string, to_line};
use lacuna::text::values::Name;
use lacuna::text::{Problems, Sources, read};
use serde::Serialize;

use crate::gap::edit::{Edit, with_keys};
use crate::gap::inside;
use crate::gap::inside::Pieces;
use crate::gap::inside::companion::edit::with_added;
use crate::gap::law;
use crate::gap::result::{AddedEffect, Estimate, GapResult};
use crate::gap::search::needless::Needless;
use crate::gap::test::is_at_floor;
use crate::study::Study;

/// Writes `STUDY+EFFECT.toml` beside the study, or into another folder, and returns its path. An existing file of that
/// name with another text is renamed first.
pub fn write(
    study: &Study,
    path: &Path,
    folder: Option<&Path>,
    result: &GapResult,
) -> Result<PathBuf, Stop> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = format!("{}.toml", with_names(&stem, study, result));
    let mut text = text(study, path, result)?;
    let new = match folder {
        None => path.with_file_name(name),
        Some(folder) => {
            text = moved(text, &study.directory, path);
            folder.join(name)
        }
    };
    match std::fs::read_to_string(&new) {
        Ok(old) if old == text => return Ok(new),
        Ok(_) => set_aside(&new)?,
        Err(_) => {}
    }
    files::write_atomic(&new, text.as_bytes())?;
    Ok(new)
}

/// The text with absolute paths of its files, so that it can be read from any folder.
fn moved(mut text: String, directory: &Path, path: &Path) -> String {
    let absolute = |path: &Path| {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        string(&path.to_string_lossy())
    };
    let place = |text: &str, key: &str| {
        let mut sources = Sources::default();
        let source = sources.add_file(Path::new("study"), text.to_owned());
        let root = read::read(source, &sources, &mut Problems::new())?;
        let found = root.find(key)?;
        Some((found.place.span.clone(), found.as_str().unwrap_or_default().to_owned()))
    };
    if let Some((span, base)) = place(&text, "extends") {
        text.replace_range(span, &absolute(&path.with_file_name("").join(base)));
    }
    let directory = absolute(directory);
    match place(&text, "study.directory") {
        Some((span, _)) => text.replace_range(span, &directory),
        None => match header(&text, "[study]") {
            Some(end) => text.insert_str(end, &format!("\ndirectory = {directory}")),
            // Without a `[study]` section, all keys of that section come from the study it extends.
            None => text.push_str(&format!("\n[study]\ndirectory = {directory}\n")),
        },
    }
    text
}

/// Offset of the end of a table's header.
fn header(text: &str, header: &str) -> Option<usize> {
    let mut begin = 0;
    for line in text.split_inclusive('\n') {
        let start = line.len() - line.trim_start().len();
        if line.trim_start().starts_with(header) {
            return Some(begin + start + header.len());
        }
        begin += line.len();
    }
    None
}

/// A name followed by those of the effects: `sns+damping`.
pub fn with_names(name: &str, study: &Study, result: &GapResult) -> String {
    let effects = result.additions.iter().map(|addition| free_name(study, addition));
    std::iter::once(name.to_owned()).chain(effects).collect::<Vec<_>>().join("+")
}

/// Renames a file to the first free name with `.old`.
fn set_aside(path: &Path) -> Result<(), Stop> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let free = (1..).map(|n| match n {
        1 => path.with_file_name(format!("{name}.old")),
        n => path.with_file_name(format!("{name}.old{n}")),
    });
    let free = free.into_iter().find(|candidate| !candidate.exists());
    let free = free.unwrap_or_else(|| unreachable!("numbers do not end"));
    std::fs::rename(path, &free).map_err(|error| files::cannot_write(&free, &error))
}

/// The name of an addition, distinct from those of the effects that the study already has.
pub fn free_name(study: &Study, addition: &AddedEffect) -> String {
    let taken: Vec<String> = study.placed_effects().into_iter().map(|e| e.name).collect();
    let mut name = addition.name.clone();
    let mut count = 1;
    while taken.contains(&name) {
        count += 1;
        name = format!("{}_{count}", addition.name);
    }
    name
}

/// The original study with the inputs and terms inside the model set free, and a block for each effect on the response;
/// comments give the reasons.
fn text(study: &Study, path: &Path, result: &GapResult) -> Result<String, Stop> {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let mut text = format!(
        "# Written by `lacuna gap` from `{file}`: that study, word for word, and at its end what its data say is\n\
         # missing. Run it like any other study.\n\n"
    );
    let (inside, on_top) = divided(study, result)?;
    let own = match inside {
        Some((edit, why)) => {
            let why = [reasons(result).join("\n"), why].join("\n");
            edit.text(study, &why).map_err(|error| Stop::new(format!("the new study {error}")))?
        }
        None => study.text.clone(),
    };
    let own = in_companion(own, study, result)?;
    let own = in_runs(own, study, result)?;
    text.push_str(&renamed(own, study, result));
    if !text.ends_with('\n') {
        text.push('\n');
    }
    if on_top.len() == result.additions.len() {
        for line in reasons(result) {
            text.push_str(&format!("\n# {line}"));
        }
        text.push('\n');
    }
    let is_plugin =
        |addition: &&&AddedEffect| !addition.is_in_companion() && !addition.is_in_runs();
    for addition in on_top.iter().filter(is_plugin) {
        text.push('\n');
        text.push_str(&block(study, addition)?);
    }
    if inside_alone(&result.additions) {
        text.push_str(&starts(study, result)?);
    }
    Ok(text)
}

/// Returns true if all effects act through parameters of the model, so that the fit is a point of the new study.
fn inside_alone(additions: &[AddedEffect]) -> bool {
    let is_inside = |added: &AddedEffect| {
        !added.model
            && !added.switches.is_empty()
            && !added.is_in_companion()
            && !added.is_in_runs()
    };
    !additions.is_empty() && additions.iter().all(is_inside)
}

/// The fit that was found, as the place where the search for the best fit begins: with missing physics in the model it is
/// often far from where the prior is.
fn starts(study: &Study, result: &GapResult) -> Result<String, Stop> {
    let mut text =
        "\n# The fit of the search, where the search for the best fit begins.\n".to_owned();
    let calibrated = result.parameters.iter().map(|shift| (&shift.name, shift.value[1]));
    let own = result.additions.iter().flat_map(|added| &added.unknowns);
    let all = calibrated.chain(own.map(|unknown| (&unknown.name, unknown.value)));
    for (name, value) in all.filter(|(_, value)| value.is_finite()) {
        if !study.starts.iter().any(|start| start.name == *name) {
            text.push_str(&format!(
                "[[start]]\nname = {}\nvalue = {}\n",
                string(name),
                line(&value)?
            ));
        }
    }
    Ok(text)
}

/// The changes for the effects inside the model with the reasons for them, and the effects on the response.
type Divided<'a> = (Option<(Edit, String)>, Vec<&'a AddedEffect>);

fn divided<'a>(study: &Study, result: &'a GapResult) -> Result<Divided<'a>, Stop> {
    let is_inside = |addition: &&AddedEffect| addition.model || !addition.switches.is_empty();
    let (inside, on_top): (Vec<_>, Vec<_>) = result.additions.iter().partition(is_inside);
    if inside.is_empty() {
        return Ok((None, on_top));
    }
    let why: String = inside.iter().map(|addition| found(addition).replace("# ", "")).collect();
    let mut edit = Edit::default();
    if let Some(other) = inside.iter().find(|addition| addition.model) {
        edit = inside::swapped(study, &other.name)?.unwrap_or_default();
    }
    let places: Vec<&[usize]> = inside.iter().map(|addition| &addition.switches[..]).collect();
    let law = result.law.iter().filter(|law| law.accepted);
    let law: Vec<_> = law.flat_map(|law| law::pieces(&law.candidates())).collect();
    if let Some(pieces) = Pieces::with(study, law)?.filter(|_| !edit.is_swap()) {
        edit = pieces.edit(study, &places);
    }
    Ok((Some((edit, why)), on_top))
}

/// The text with the effects that act inside the companion.
fn in_companion(text: String, study: &Study, result: &GapResult) -> Result<String, Stop> {
    let own = result.additions.iter().filter(|addition| addition.is_in_companion());
    let own: Vec<&AddedEffect> = own.collect();
    let Some(companion) = result.companion.as_ref().filter(|_| !own.is_empty()) else {
        return Ok(text);
    };
    let names: Vec<&str> = own.iter().map(|addition| addition.kind.as_str()).collect();
    let comments: String = own.iter().map(|addition| found(addition)).collect();
    let parameters = result.parameters.iter().zip(&study.parameters);
    let mut around: BTreeMap<&str, f64> =
        parameters.map(|(shift, own)| (own.name.as_str(), shift.value[1])).collect();
    let sizes = own.iter().map(|addition| (addition.kind.as_str(), addition.unknowns[0].value));
    around.extend(sizes);
    with_added(text, study, &names, companion, &around, &comments)
}

/// The text with the effects that further tables of runs show.
fn in_runs(text: String, study: &Study, result: &GapResult) -> Result<String, Stop> {
    let own = result.additions.iter().filter(|addition| addition.is_in_runs());
    let own: Vec<&AddedEffect> = own.collect();
    if own.is_empty() {
        return Ok(text);
    }
    let before = study.gap.keys.add.iter().map(Name::as_str);
    let names: Vec<&str> = before.chain(own.iter().map(|added| added.kind.as_str())).collect();
    let comments: String = own.iter().map(|addition| found(addition)).collect();
    Ok(with_keys(text, "[gap]", vec![("add", line(&names)?)], &comments))
}

/// The text with a name of its own if it gives one: two studies with the same name would share a run directory.
fn renamed(mut text: String, study: &Study, result: &GapResult) -> String {
    let mut sources = Sources::default();
    let source = sources.add_file(Path::new("study"), text.clone());
    let root = read::read(source, &sources, &mut Problems::new());
    let name = root.as_ref().and_then(|root| root.find("study.name"));
    let Some(name) = name else { return text };
    text.replace_range(name.place.span.clone(), &string(&with_names(&study.name, study, result)));
    text
}

/// The reasons for which the effects are added.
fn reasons(result: &GapResult) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(step) = result.path.first() {
        lines.push(format!(
            "Without any missing effect, p-values: score {}, scan {}, energy {}.",
            probability(step.p[0], result.simulations),
            probability(step.p[1], result.simulations),
            probability(step.p[2], result.simulations),
        ));
    }
    for part in &result.held_out {
        let all = &part.proof.all;
        lines.push(format!(
            "By the search, on held-out data ({} {}): gap {:.3} before, {:.3} after, in standard deviations of the noise; {:.0} % closed ({:.0} to {:.0} %).",
            all.replicates,
            part.kind.words(),
            all.before,
            all.after,
            100.0 * all.closed,
            100.0 * all.lower,
            100.0 * all.upper,
        ));
    }
    lines.extend(result.verdict.reasons.iter().cloned());
    lines.extend(result.needless.iter().map(Needless::words));
    lines
}

fn probability(p: f64, simulations: usize) -> String {
    let text = format!("{p:.4}").trim_end_matches('0').trim_end_matches('.').to_owned();
    if is_at_floor(p, simulations) { format!("<= {text}") } else { text }
}

/// The calibrated unknowns of an effect, as comments.
fn found(addition: &AddedEffect) -> String {
    let mut text = format!("# {}\n#   {}\n", addition.title, addition.formula);
    for Estimate { name, unit, value, sd } in &addition.unknowns {
        let unit = match unit.as_str() {
            "" | "1" => String::new(),
            unit => format!(" {unit}"),
        };
        text.push_str(&format!("# found: {name} = {value:.4e} ± {sd:.1e}{unit}\n"));
    }
    let own = addition.class.iter().filter(|kind| **kind != addition.label());
    let others: Vec<String> = own.map(|kind| format!("`{kind}`")).collect();
    if others.is_empty() {
        text.push_str(&format!("# probability: {:.2}\n", addition.probability));
    } else {
        text.push_str(&format!(
            "# These data cannot tell it from {} (its own probability: {:.2}).\n",
            others.join(", "),
            addition.probability
        ));
    }
    text
}

fn block(study: &Study, addition: &AddedEffect) -> Result<String, Stop> {
    let mut text = found(addition);
    text.push_str(&format!("[[effect]]\nuse = {}\n", string(&addition.plugin)));
    text.push_str(&format!("name = {}\n", string(&free_name(study, addition))));
    if !addition.on.is_empty() {
        text.push_str(&format!("on = {}\n", line(&addition.on)?));
    }
    for (name, value) in &addition.options {
        text.push_str(&format!("{} = {}\n", key(name), line(value)?));
    }
    Ok(text)
}

fn line(value: &impl Serialize) -> Result<String, Stop> {
    to_line(value).map_err(|error| Stop::new(format!("the new study {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All files that a study names are found from any folder: the study it extends beside its file, the others in its
    /// directory.
    #[test]
    fn a_study_that_is_moved_names_its_files_from_the_root() {
        let (directory, path) = (Path::new("/data"), Path::new("/studies/a.toml"));
        for (text, expected) in [
            (
                "extends = \"base.toml\"\n\n# [study] of others\n[study]\ntitle = \"x\"\n",
                "extends = \"/studies/base.toml\"\n\n# [study] of others\n[study]\ndirectory = \"/data\"\ntitle = \"x\"\n",
            ),
            (
                "[study]\ntitle = \"x\"\ndirectory = \"../data\"\n",
                "[study]\ntitle = \"x\"\ndirectory = \"/data\"\n",
            ),
            (
                "extends = \"base.toml\"\n[design]\nruns = 3\n",
                "extends = \"/studies/base.toml\"\n[design]\nruns = 3\n\n[study]\ndirectory = \"/data\"\n",
            ),
        ] {
            assert_eq!(moved(text.to_owned(), directory, path), expected);
        }
    }
}
