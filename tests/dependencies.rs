//! Licences, sources and versions of the crates that Lacuna is built with, as `deny.toml` allows them, and the Rust that they need.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::process::Command;

use serde_json::Value;

use crate::quick::root;

/// All packages of the lock file, as described by cargo.
fn packages() -> Vec<Value> {
    described(&[])
}

/// The packages of the lock file that cargo describes with these arguments.
fn described(arguments: &[&str]) -> Vec<Value> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut cargo = Command::new(cargo);
    cargo.args(["metadata", "--format-version", "1", "--locked"]).args(arguments);
    cargo.current_dir(root());
    let output = cargo.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// A list in `deny.toml`; for tables, the values of their key `crate`.
fn listed(section: &str, key: &str) -> BTreeSet<String> {
    let table: toml::Table = fs::read_to_string(root().join("deny.toml")).unwrap().parse().unwrap();
    let name = |item: &toml::Value| {
        item.as_str().or_else(|| item.get("crate")?.as_str()).unwrap().to_owned()
    };
    table[section][key].as_array().unwrap().iter().map(name).collect()
}

/// Returns true if an SPDX expression is satisfied by these licences: `AND` binds tighter than `OR`; the slash of old
/// manifests means `OR`.
fn is_met(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let text = expression.replace('/', " OR ");
    let one = |name: &str| allowed.contains(name.trim().trim_matches(['(', ')']));
    if let Some((inside, rest)) = text.strip_prefix('(').and_then(|text| text.split_once(')')) {
        return match rest.trim().strip_prefix("AND ") {
            Some(rest) => is_met(inside, allowed) && is_met(rest, allowed),
            None => is_met(inside, allowed) || rest.split(" OR ").any(one),
        };
    }
    text.split(" OR ").any(|all| all.split(" AND ").all(one))
}

#[test]
fn licences_are_allowed_and_sources_known() {
    let allowed = listed("licenses", "allow");
    let mut wrong = Vec::new();
    for package in packages().iter().filter(|package| !package["source"].is_null()) {
        let word = |key: &str| package[key].as_str().unwrap_or_default();
        if !is_met(word("license"), &allowed) {
            wrong.push(format!("{} has the licence `{}`", word("name"), word("license")));
        }
        if !word("source").starts_with("registry+") {
            wrong.push(format!("{} comes from {}", word("name"), word("source")));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn crates_of_several_versions_are_those_that_are_listed() {
    let mut versions: BTreeMap<String, u32> = BTreeMap::new();
    for package in packages() {
        *versions.entry(package["name"].as_str().unwrap().to_owned()).or_default() += 1;
    }
    let several = versions.into_iter().filter(|(_, count)| *count > 1).map(|(name, _)| name);
    assert_eq!(several.collect::<BTreeSet<_>>(), listed("bans", "skip"));
}

#[test]
fn no_crate_needs_a_newer_rust_than_the_one_that_is_stated() {
    let version = |package: &Value| -> Option<(u32, u32)> {
        let mut numbers = package["rust_version"].as_str()?.split('.').map(|n| n.parse().unwrap());
        Some((numbers.next()?, numbers.next()?))
    };
    let platform = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let packages = described(&["--filter-platform", &platform]);
    let ours = packages.iter().find(|package| package["name"] == "lacuna-cli").unwrap();
    let stated = version(ours).unwrap();
    let newer: Vec<_> = packages
        .iter()
        .filter(|package| version(package).is_some_and(|needed| needed > stated))
        .map(|package| (&package["name"], &package["rust_version"]))
        .collect();
    assert!(newer.is_empty(), "{newer:?}");
}

#[test]
fn expressions_are_read_as_spdx_has_them() {
    let allowed = BTreeSet::from(["MIT".to_owned(), "Zlib".to_owned()]);
    for (expression, met) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("GPL-3.0 OR MIT", true),
        ("Apache-2.0/MIT", true),
        ("MIT AND GPL-3.0", false),
        ("MIT AND Zlib", true),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", false),
        ("(MIT OR Apache-2.0) AND Zlib", true),
        ("", false),
    ] {
        assert_eq!(is_met(expression, &allowed), met, "{expression}");
    }
}
