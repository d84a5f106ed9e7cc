//! The whole study language, every installed plugin included: as JSON Schema, and as a manual of the
//! engine's own keys.

use lacuna::plugin::manual::Manual;
use lacuna::plugin::registry::NoKeys;
use lacuna::plugin::{Effect, Model, Reader, Surrogate, Term};
use serde_json::{Value, json};

use super::gap::companion::CompanionKeys;
use super::gap::{CandidateKeys, RunsKeys, SwapKeys, SwitchSection, TermKeys};
use super::noise::NoiseSection;
use super::schema::{Language, page};
use super::table;

/// The schema, for editors that complete and check a study (`lacuna schema`).
pub fn schema() -> Value {
    let mut language = Language::new();
    table::describe(&mut language);
    language
        .required("study")
        .required_without("parameter", "field")
        .required_without("response", "target")
        .section_in::<dyn Surrogate, NoKeys>("numerical_error", "surrogate")
        .section_in::<dyn Reader, NoKeys>("low_fidelity", "simulations")
        .section_in::<dyn Surrogate, NoKeys>("low_fidelity", "surrogate")
        .sections_in::<dyn Effect, CandidateKeys>("gap", "candidate")
        .tables_in::<SwitchSection>("gap", "switch")
        .sections_in::<dyn Term, TermKeys>("gap", "term")
        .sections_in::<dyn Model, SwapKeys>("gap", "model")
        .sections_in::<dyn Reader, RunsKeys>("gap", "runs")
        .section_in::<dyn Model, CompanionKeys>("gap", "companion");
    language.finish()
}

/// The schema as a file: a section or a definition a line.
pub fn schema_text() -> String {
    let schema = schema();
    let entries = |value: &Value| {
        let all = value.as_object().into_iter().flatten();
        let lines: Vec<String> =
            all.map(|(key, value)| format!("{}: {value}", json!(key))).collect();
        format!("{{\n{}\n}}", lines.join(",\n"))
    };
    let parts = schema.as_object().into_iter().flatten().map(|(key, value)| {
        let value = match key.as_str() {
            "properties" | "$defs" => entries(value),
            _ => value.to_string(),
        };
        format!("{}: {value}", json!(key))
    });
    format!("{{\n{}\n}}\n", parts.collect::<Vec<_>>().join(",\n"))
}

/// The engine's own sections, and its keys in sections that choose a plugin, in the order of a study.
pub fn manual() -> Vec<Manual> {
    let mut pages = table::manual();
    pages.extend([
        page::<NoiseSection>("[[measurements.noise]]"),
        page::<CandidateKeys>("[[gap.candidate]]"),
        page::<SwitchSection>("[[gap.switch]]"),
        page::<TermKeys>("[[gap.term]]"),
        page::<SwapKeys>("[[gap.model]]"),
        page::<RunsKeys>("[[gap.runs]]"),
        page::<CompanionKeys>("[gap.companion]"),
    ]);
    pages
}
