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

/// File that holds the SHA-256 of the study as it was written when the run began.
const HASH: &str = "study.sha256";

/// SHA-256 of the study as it was written when the run began; `None` if it was not recorded.
pub fn study_hash(root: &Path) -> Option<String> {
    Some(std::fs::read_to_string(root.join(HASH)).ok()?.trim_end().to_owned())
}

/// The study of a run directory with every default filled in.
pub const RESOLVED: &str = "resolved.toml";

/// File that holds the SHA-256 of `resolved.toml` as it was last written.
const RESOLVED_HASH: &str = "resolved.sha256";

/// True if `resolved.toml` is not as it was last written; false if its hash was not recorded.
pub fn resolved_is_edited(root: &Path) -> bool {
    let recorded = std::fs::read_to_string(root.join(RESOLVED_HASH));
    let found = std::fs::read(root.join(RESOLVED));
    match (recorded, found) {
        (Ok(recorded), Ok(found)) => recorded.trim_end() != files::hash(&found),
        _ => false,
    }
}

/// Writes `resolved.toml` and records its hash.
pub fn write_resolved(root: &Path, text: &str) -> Result<(), Stop> {
    files::write_atomic(&root.join(RESOLVED), text.as_bytes())?;
    let hash = format!("{}\n", files::hash(text.as_bytes()));
    files::write_atomic(&root.join(RESOLVED_HASH), hash.as_bytes())
}

/// Writes `study.toml` (byte for byte), `resolved.toml` (which runs as it is), their hashes and the path of the study.
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
    // Its own `resolved.toml` is the recorded study, whatever has become of the copy beside it.
    if file != root.join(RESOLVED) || study_hash(&root).is_none() {
        let hash = format!("{}\n", files::hash(study.text.as_bytes()));
        files::write_atomic(&run.root().join(HASH), hash.as_bytes())?;
        files::write_atomic(&run.root().join("study.toml"), study.text.as_bytes())?;
    }
    let resolved = emit::to_toml(&study.resolved)
        .map_err(|error| Stop::new(format!("cannot write resolved.toml: {error}")))?;
    let version = env!("CARGO_PKG_VERSION");
    let head = format!(
        "# Written by lacuna {version}: every default filled in. It runs as it stands.\n\n"
    );
    write_resolved(run.root(), &(head + &resolved))
}

/// Writes `manifest.json`: versions, and for each stage the hash of its inputs, its files and its time.
pub fn end(study: &Study, run: &RunDirectory) -> Result<(), Stop> {
    // Of a resumed run the text is that of the copy in the directory, which is not what ran.
    let written = study_hash(run.root()).unwrap_or_else(|| files::hash(study.text.as_bytes()));
    let resolved = files::hash_file(&run.root().join(RESOLVED))?;
    let manifest = json!({
        "schema": 1,
        "study": study.name,
        "study_sha256": written,
        "resolved_sha256": resolved,
        "lacuna": env!("CARGO_PKG_VERSION"),
        "seed": study.about.seed,
        "plugins": study.libraries.all().map(described).collect::<Vec<_>>(),
        "stages": run.records(),
    });
    files::write_json(&run.root().join("manifest.json"), &manifest)
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
