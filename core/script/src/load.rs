//! Loads files of plugins.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use lacuna::plugin::Library;
use lacuna::plugin::registry::loaded::{self, AnyEntry};
use lacuna::run::files;
use lacuna_abi::record::is_word;
use lacuna_run::process::interpreter;
use serde_json::Value as Json;

use crate::offer::{Declared, offer};
use crate::script::Script;
use crate::worker::Worker;

/// Interpreter of files whose study names none; the Python package sets it to its own.
const VARIABLE: &str = "LACUNA_PYTHON";

/// Files that were loaded.
static LOADED: Mutex<Vec<Loaded>> = Mutex::new(Vec::new());

/// A loaded file, with the interpreter that serves it.
#[derive(Clone)]
struct Loaded {
    python: PathBuf,
    library: &'static Library,
    entries: Vec<AnyEntry>,
}

impl Loaded {
    fn origin(&self) -> String {
        self.library.path.display().to_string()
    }

    /// True for a file with a plugin of the same kind and name.
    fn rivals(&self, other: &Self) -> bool {
        other.library.plugins.iter().any(|plugin| self.library.plugins.contains(plugin))
    }
}

/// Loads a file, or finds that it is loaded as it is now: its code runs from here on. It takes the place of what it was before
/// it changed, and of files that were loaded before and have plugins of the same names: those of the study that is read last
/// are meant. The interpreter is a path relative to `directory`, a program or a virtual environment; without one it is
/// that of the environment variable `LACUNA_PYTHON`, or `python3`.
///
/// # Errors
/// What is wrong with the file, in words.
pub fn load(
    file: &Path,
    named: Option<&Path>,
    directory: &Path,
) -> Result<&'static Library, String> {
    let bytes = std::fs::read(file).map_err(|error| files::in_words(&error))?;
    let sha256 = files::hash(&bytes);
    let file = file.canonicalize().map_err(|error| files::in_words(&error))?;
    let python = python(named, directory)?;
    // One at a time, so that no two files give plugins of the same name.
    let mut all = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    let known = all.iter().find(|known| {
        known.library.path == file && known.library.sha256 == sha256 && known.python == python
    });
    let next = match known {
        Some(known) => known.clone(),
        None => bring(&file, sha256, &python, &all)?,
    };
    for other in all.iter().filter(|other| other.library.path == file || other.rivals(&next)) {
        loaded::remove(&other.origin());
    }
    loaded::add(&next.origin(), next.entries.clone());
    all.retain(|other| other.library.path != file);
    let library = next.library;
    all.push(next);
    Ok(library)
}

fn python(named: Option<&Path>, directory: &Path) -> Result<PathBuf, String> {
    let variable = std::env::var_os(VARIABLE).map(PathBuf::from);
    let given = named.map(Path::to_owned).or(variable).unwrap_or_else(|| "python3".into());
    interpreter(&given, directory)
        .ok_or_else(|| format!("there is no Python interpreter `{}`", given.display()))
}

/// Runs a file and makes entries of its plugins; their names must be free but for those of other files in Python.
fn bring(file: &Path, sha256: String, python: &Path, others: &[Loaded]) -> Result<Loaded, String> {
    let (worker, said) = Worker::start(python, file)?;
    if let Some(error) = said.head.get("error").and_then(Json::as_str) {
        return Err(error.to_owned());
    }
    let declared = said.head.get("plugins").cloned().unwrap_or_default();
    let declared: Vec<Declared> = serde_json::from_value(declared)
        .map_err(|error| format!("its plugins cannot be read: {error}"))?;
    if declared.is_empty() {
        return Err(
            "it declares no plugin: expected classes with decorators such as `@lacuna.sampler`"
                .to_owned(),
        );
    }
    if let Some(odd) = declared.iter().find(|plugin| !is_word(&plugin.name)) {
        return Err(format!("`{}` is no name for a plugin", odd.name));
    }
    let path = file.to_owned();
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let plugins = declared.iter().map(|p| (p.kind.clone(), p.name.clone())).collect();
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let (sdk, abi) = (String::new(), None);
    let library: &'static Library =
        Box::leak(Box::new(Library { path, sha256, name, version, sdk, abi, plugins }));
    let script = Arc::new(Script::new(file.to_owned(), python.to_owned(), worker));
    let removed: Vec<_> =
        others.iter().map(|other| (other.origin(), loaded::remove(&other.origin()))).collect();
    let offered: Result<Vec<_>, String> =
        declared.into_iter().map(|plugin| offer(plugin, &script, library)).collect();
    for (origin, entries) in removed {
        loaded::add(&origin, entries);
    }
    Ok(Loaded { python: python.to_owned(), library, entries: offered? })
}
