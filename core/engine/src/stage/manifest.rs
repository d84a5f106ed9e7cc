//! Provenance of a run: the study as written, the study as resolved, and a record of every stage.

use std::path::{Path, PathBuf};

use lacuna::plugin::Library;
use lacuna::run::{Stop, files};
use lacuna::text::emit;
use lacuna_run::RunDirectory;
use serde_json::{Value, json};

use crate::study::Study;

/// File that holds the absolute path of the study's file.
const ORIGIN: &str = "study.path";

/// The study file that a run directory belongs to; `None` if it was not recorded.
pub fn origin(root: &Path) -> Option<PathBuf> {
    let text = std::fs::read_to_string(root.join(ORIGIN)).ok()?;
    Some(PathBuf::from(text.trim_end_matches('\n')))
}

/// Beginning of the line of `resolved.toml` that holds the hash of the study as it was written.
const OF_STUDY: &str = "# sha256 of study.toml: ";

/// SHA-256 of the study as it was written when the run began; `None` if it was not recorded.
pub fn study_hash(root: &Path) -> Option<String> {
    let text = std::fs::read_to_string(root.join("resolved.toml")).ok()?;
    Some(text.lines().find_map(|line| line.strip_prefix(OF_STUDY))?.to_owned())
}

/// Writes `study.toml` (byte for byte), `resolved.toml` (which runs as it is) and the path of the study.
pub fn begin(study: &Study, run: &mut RunDirectory) -> Result<(), Stop> {
    run.watch(study.faults());
    run.uses(study.libraries.all().map(|library| library.sha256.clone()));
    let file = std::path::absolute(&study.file).unwrap_or_else(|_| study.file.clone());
    // A resumed run is read from its own directory, which must not replace the original path.
    let root = std::path::absolute(run.root()).unwrap_or_else(|_| run.root().to_owned());
    if !file.starts_with(&root) {
        let text = format!("{}\n", file.display());
        files::write_atomic(&run.root().join(ORIGIN), text.as_bytes())?;
    }
    files::write_atomic(&run.root().join("study.toml"), study.text.as_bytes())?;
    let resolved = emit::to_toml(&study.resolved)
        .map_err(|error| Stop::new(format!("cannot write resolved.toml: {error}")))?;
    let (version, hash) = (env!("CARGO_PKG_VERSION"), files::hash(study.text.as_bytes()));
    let head = format!(
        "# Written by lacuna {version}: every default filled in. It runs as it stands.\n{OF_STUDY}{hash}\n\n"
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
        "plugins": study.libraries.all().map(described).collect::<Vec<_>>(),
        "stages": run.records(),
    });
    files::write_json(&run.root().join("manifest.json"), &manifest)
}

/// The library of plugins at a path, as the manifest of a run describes it; `None` if it describes none.
pub fn library(run: &Path, path: &Path) -> Option<&'static Library> {
    let text = std::fs::read_to_string(run.join("manifest.json")).ok()?;
    let manifest: Value = serde_json::from_str(&text).ok()?;
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let all = manifest["plugins"].as_array()?.iter();
    let recorded = all.filter_map(recorded).find(|library| library.path == path)?;
    Some(Box::leak(Box::new(recorded)))
}

/// A library from its record in a manifest.
fn recorded(record: &Value) -> Option<Library> {
    let text = |key: &str| record[key].as_str().map(str::to_owned);
    let version = |text: &str| {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    };
    let plugins = record["plugins"].as_array()?.iter().filter_map(Value::as_str);
    let plugin = |name: &str| name.split_once('.').map(|(k, n)| (k.to_owned(), n.to_owned()));
    Some(Library {
        path: text("path")?.into(),
        sha256: text("sha256")?,
        name: text("name")?,
        version: text("version")?,
        sdk: text("sdk")?,
        abi: record["abi"].as_str().and_then(version),
        plugins: plugins.filter_map(plugin).collect(),
    })
}

/// A library of plugins, as recorded in the manifest.
fn described(library: &Library) -> Value {
    let plugins: Vec<String> =
        library.plugins.iter().map(|(kind, name)| format!("{kind}.{name}")).collect();
    json!({
        "path": library.path,
        "sha256": library.sha256,
        "name": library.name,
        "version": library.version,
        "sdk": library.sdk,
        "abi": library.abi.map(|(major, minor)| format!("{major}.{minor}")),
        "plugins": plugins,
    })
}
