//! Growth of a design: further runs for the study of a run directory.

use std::fs;
use std::path::Path;

use lacuna::run::{Stop, files};
use lacuna::text::emit;
use lacuna_run::RunDirectory;
use toml::{Table, Value};

use crate::stage::design;
use crate::stage::manifest::{self, RESOLVED};
use crate::study::{Study, resolve};

/// Result of an extension.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grown {
    /// Number of runs now requested, without the imported ones.
    pub runs: usize,
    /// Line with the same effect for the user's own study, section `[design]`.
    pub line: String,
}

/// Adds runs to the design of a run directory. Existing runs are kept.
pub fn extend(run: &RunDirectory, count: usize) -> Result<Grown, Stop> {
    let mut line = String::new();
    let study = change(run, |design| {
        let list = list(design, "extended")?;
        list.push(Value::Integer(count as i64));
        line = format!("extended = {}", Value::Array(list.clone()));
        Ok(())
    })?;
    let runs = study.design.as_ref().map_or(0, |section| section.common.total());
    Ok(Grown { runs, line })
}

/// Adds a folder of finished runs to the design of a run directory.
pub(super) fn add_import(run: &RunDirectory, folder: &Path) -> Result<Study, Stop> {
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    change(run, |design| {
        list(design, "imports")?.push(Value::String(folder.display().to_string()));
        Ok(())
    })
}

fn list<'a>(design: &'a mut Table, key: &str) -> Result<&'a mut Vec<Value>, Stop> {
    let value = design.entry(key).or_insert_with(|| Value::Array(Vec::new()));
    value.as_array_mut().ok_or_else(|| Stop::new(format!("`{key}` in `[design]` is no list")))
}

/// Changes the design of `resolved.toml`, if the changed study has no problems and the design can be extended.
fn change(
    run: &RunDirectory,
    change: impl FnOnce(&mut Table) -> Result<(), Stop>,
) -> Result<Study, Stop> {
    let path = run.root().join(RESOLVED);
    let text = String::from_utf8_lossy(&files::read(&path)?).into_owned();
    let mut study: Table = text
        .parse()
        .map_err(|error| Stop::new(format!("cannot read {}: {error}", path.display())))?;
    let design = study.get_mut("design").and_then(Value::as_table_mut).ok_or_else(|| {
        Stop::new("the study has no `[design]` that could grow")
            .help("add the runs to the files of `[simulations]`")
    })?;
    change(design)?;
    let (head, _) = text.split_once("\n\n").unwrap_or_default();
    let grown = emit::to_toml(&study)
        .map_err(|error| Stop::new(format!("cannot write {}: {error}", path.display())))?;
    let grown = format!("{head}\n\n{grown}");
    let checked = resolve::load_text_for(&path, &grown, resolve::Use::Look);
    let complaints = checked.complaints();
    let study = checked.study.ok_or_else(|| {
        Stop::new(format!("the study would be wrong with this change:\n{}", complaints.trim_end()))
    })?;
    if let Some(section) = &study.design {
        design::cube(section, study.trained())?;
    }
    // Further runs and imported ones need names of their own.
    design::run_names(study.trained())?;
    if manifest::resolved_is_edited(run.root()) {
        // The record stays that of the text before it was edited, so that the warning about it stays too.
        files::write_atomic(&path, grown.as_bytes())?;
    } else {
        manifest::write_resolved(run.root(), &grown)?;
    }
    // The run is no longer finished.
    let manifest = run.root().join("manifest.json");
    match fs::remove_file(&manifest) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(files::cannot_write(&manifest, &error))
        }
        _ => Ok(study),
    }
}
