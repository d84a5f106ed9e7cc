//! What a run was made from: the study as written, the study as resolved, and the provenance of every stage.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::plugin::abi::Library;
use crate::run::{RunDirectory, Stop, files};
use crate::study::{Study, emit};

/// Where the study of a run directory is: the absolute path of its file.
const ORIGIN: &str = "study.path";

/// The file of the study that a run directory belongs to; `None` where it was not noted.
pub fn origin(root: &Path) -> Option<PathBuf> {
    let text = std::fs::read_to_string(root.join(ORIGIN)).ok()?;
    Some(PathBuf::from(text.trim_end_matches('\n')))
}

/// Writes `study.toml` (byte for byte), `resolved.toml` (which runs as it stands) and where the study is.
pub fn begin(study: &Study, run: &mut RunDirectory) -> Result<(), Stop> {
    run.watch(study.faults());
    let file = std::path::absolute(&study.file).unwrap_or_else(|_| study.file.clone());
    // A run that is resumed is read from its own directory.
    let root = std::path::absolute(run.root()).unwrap_or_else(|_| run.root().to_owned());
    if !file.starts_with(&root) {
        let text = format!("{}\n", file.display());
        files::write_atomic(&run.root().join(ORIGIN), text.as_bytes())?;
    }
    files::write_atomic(&run.root().join("study.toml"), study.text.as_bytes())?;
    let resolved = emit::to_toml(&study.resolved)
        .map_err(|error| Stop::new(format!("cannot write resolved.toml: {error}")))?;
    let version = env!("CARGO_PKG_VERSION");
    let head = format!(
        "# Written by lacuna {version}: every default filled in. It runs as it stands.\n\n"
    );
    files::write_atomic(&run.root().join("resolved.toml"), (head + &resolved).as_bytes())
}

/// Writes `manifest.json`: versions, and for each stage the hash of its inputs, its files and its time.
pub fn end(study: &Study, run: &RunDirectory) -> Result<(), Stop> {
    let manifest = json!({
        "schema": 1,
        "study": study.name,
        "study_sha256": files::hash(study.text.as_bytes()),
        "lacuna": env!("CARGO_PKG_VERSION"),
        "seed": study.about.seed,
        "plugins": study.libraries.loaded.iter().map(|library| described(library)).collect::<Vec<_>>(),
        "stages": run.records(),
    });
    files::write_json(&run.root().join("manifest.json"), &manifest)
}

/// A library of plugins, as the manifest records it.
fn described(library: &Library) -> Value {
    let (major, minor) = library.abi;
    let plugins: Vec<String> =
        library.plugins.iter().map(|(kind, name)| format!("{kind}.{name}")).collect();
    json!({
        "path": library.path,
        "sha256": library.sha256,
        "name": library.name,
        "version": library.version,
        "sdk": library.sdk,
        "abi": format!("{major}.{minor}"),
        "plugins": plugins,
    })
}
