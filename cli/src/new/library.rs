//! A plugin as a library of its own.

use std::path::Path;

use lacuna::study::emit;

use super::skeleton::{Skeleton, type_name};

/// The crates that skeletons use, beside the SDK, each with what a manifest says of it.
pub const CRATES: [(&str, &str); 4] = [
    ("schemars", "\"1\""),
    ("serde", "{ version = \"1\", features = [\"derive\"] }"),
    ("serde_json", "{ version = \"1\", features = [\"float_roundtrip\"] }"),
    ("toml", "\"1.2\""),
];

/// The manifest of a library with this source, which uses the SDK in that folder.
pub fn manifest(name: &str, source: &str, sdk: &Path) -> String {
    let sdk = emit::string(&sdk.display().to_string());
    let used = CRATES.iter().filter(|(name, _)| source.contains(&format!("{name}::")));
    let crates: String = used.map(|(name, version)| format!("{name} = {version}\n")).collect();
    format!(
        "[package]
name = \"{name}\"
description = \"A plugin for Lacuna\"
version = \"0.1.0\"
edition = \"2024\"
publish = false

# A workspace of its own: a plugin is built without Lacuna's.
[workspace]

[lib]
crate-type = [\"cdylib\"]

[dependencies]
lacuna-plugin = {{ path = {sdk} }}
{crates}
# As in Lacuna's own workspace: without optimisation its numerical parts are slow.
[profile.dev]
opt-level = 1
"
    )
}

/// The plugin as the root of a library: the same file, with the crate `lacuna` from the SDK, and exported.
pub fn source(skeleton: &Skeleton, name: &str) -> String {
    let (kind, of_code) = (skeleton.kind_trait, type_name(name));
    let registered = format!("lacuna::register!({kind}, \"{name}\", {of_code});");
    let exported = format!("lacuna_plugin::export! {{\n    {kind} \"{name}\" {of_code},\n}}");
    let sdk = "use lacuna_plugin::lacuna;\nuse schemars::JsonSchema;";
    skeleton.named(name).replace(&registered, &exported).replacen(
        "use schemars::JsonSchema;",
        sdk,
        1,
    )
}
