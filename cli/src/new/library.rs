//! Skeleton of a plugin as a library of its own.

use std::path::Path;

use lacuna::text::emit;

use super::skeleton::{Skeleton, type_name};

/// Crates that skeletons use besides the SDK, each with its entry in a manifest.
pub const CRATES: [(&str, &str); 4] = [
    ("schemars", "\"1\""),
    ("serde", "{ version = \"1\", features = [\"derive\"] }"),
    ("serde_json", "{ version = \"1\", features = [\"float_roundtrip\"] }"),
    ("toml", "\"1.2\""),
];

/// Crates of Lacuna that skeletons use besides the SDK, each with its folder relative to Lacuna's source: for the
/// plugin, and for its tests.
const LINALG: (&str, &str) = ("lacuna-linalg", "core/linalg");
const CONTRACT: (&str, &str) = ("lacuna-contract", "core/contract");

/// Manifest of a library with this source, with the SDK in the folder `sdk`.
pub fn manifest(name: &str, source: &str, sdk: &Path) -> String {
    let string = |path: &Path| emit::string(&path.display().to_string());
    let lacuna = sdk.parent().unwrap_or(sdk);
    let of_lacuna = |(krate, folder): (&str, &str)| {
        let used = source.contains(&format!("{}::", krate.replace('-', "_")));
        let line = || format!("{krate} = {{ path = {} }}\n", string(&lacuna.join(folder)));
        used.then(line).unwrap_or_default()
    };
    let (linalg, contract) = (of_lacuna(LINALG), of_lacuna(CONTRACT));
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
{linalg}{crates}
[dev-dependencies]
{contract}
# As in Lacuna's own workspace: without optimisation its numerical parts are slow.
[profile.dev]
opt-level = 1
",
        sdk = string(sdk)
    )
}

/// The plugin as the root of a library: the same file, with the crate `lacuna` from the SDK, and exported.
pub fn source(skeleton: &Skeleton, name: &str) -> String {
    let (kind, of_code) = (skeleton.kind_trait, type_name(name));
    let registered = format!("lacuna::register!({kind}, \"{name}\", {of_code});");
    let exported = format!("lacuna_plugin::export! {{\n    {kind} \"{name}\" {of_code},\n}}");
    let sdk = "use lacuna_plugin::lacuna;\nuse schemars::JsonSchema;";
    // `export!` finds the kind by itself.
    let import = format!("use lacuna::plugin::{kind};\n");
    let text = skeleton.named(name).replace(&import, "").replace(&registered, &exported);
    text.replacen("use schemars::JsonSchema;", sdk, 1)
}
