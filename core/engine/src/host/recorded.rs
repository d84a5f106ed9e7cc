//! Libraries of a finished run, as its manifest describes them.

use std::path::Path;

use lacuna::plugin::Library;
use serde_json::Value;

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
