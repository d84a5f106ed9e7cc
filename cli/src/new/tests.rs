//! Names of skeletons and the places they are written to.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use lacuna::plugin::registry;

use super::language::{IN_C, IN_CPP};
use super::skeleton::{ALL, Skeleton, kinds, type_name};
use super::{library, tree};

#[test]
fn there_is_a_skeleton_of_every_kind() {
    let registered: Vec<&str> = registry::kinds().iter().map(|kind| kind.name).collect();
    assert_eq!(kinds(), registered);
}

#[test]
fn names_are_those_of_modules_and_types() {
    let sampler = Skeleton::of("sampler").unwrap();
    for (name, expected) in [
        ("walk", "Walk"),
        ("difference_walk", "DifferenceWalk"),
        ("walk_2", "Walk2"),
        ("skeleton", "Skeleton"),
    ] {
        assert_eq!(sampler.fault(name), None);
        assert_eq!(type_name(name), expected);
    }
    for name in ["", "Walk", "2walk", "a__b", "_a", "a_", "a-b", "a b", "wörter", "a/b", ".."] {
        let (text, _) = sampler.fault(name).unwrap();
        assert_eq!(text, format!("`{name}` is no name of a plugin"));
    }
    for (name, expected) in [
        ("loop", "`loop` is a keyword of Rust"),
        ("state", "the type of `state` would be called `State`"),
        ("option", "the type of `option` would be called `Option`"),
    ] {
        let (text, _) = sampler.fault(name).unwrap();
        assert!(text.starts_with(expected), "{text}");
    }
}

#[test]
fn a_named_skeleton_is_registered_under_its_name_alone() {
    for skeleton in &ALL {
        let text = skeleton.named("long_name");
        let line = format!("lacuna::register!({}, \"long_name\", LongName);", skeleton.kind_trait);
        assert_eq!(text.matches(&line).count(), 1, "{}", skeleton.kind);
        assert!(!text.to_lowercase().contains("skeleton"), "{}", skeleton.kind);
    }
}

#[test]
fn modules_stand_in_order() {
    let text = "//! Samplers.\n\nmod b;\n#[cfg(test)]\nmod d;\npub mod f;\n\n#[cfg(test)]\nmod a;\n\nfn z() {}\n";
    for (name, before) in
        [("a", "mod b;"), ("c", "#[cfg(test)]\nmod d;"), ("e", "pub mod f;"), ("g", "\n#[cfg")]
    {
        // Another block of the file may declare a module of this name, which is rejected.
        if name == "a" {
            assert_eq!(tree::with_module(text, name), None);
            continue;
        }
        let longer = tree::with_module(text, name).unwrap();
        assert!(longer.contains(&format!("pub mod {name};\n{before}")), "{longer}");
        assert_eq!(longer.replace(&format!("pub mod {name};\n"), ""), text);
    }
    assert_eq!(tree::with_module("//! Nothing.\n", "a"), None);
}

#[test]
fn a_library_has_the_plugin_the_sdk_and_the_crates_of_the_workspace() {
    for skeleton in ALL.iter().filter(|skeleton| skeleton.in_libraries) {
        let kind = skeleton.kind_trait;
        let text = library::source(skeleton, "long_name");
        let end = format!("lacuna_plugin::export! {{\n    {kind} \"long_name\" LongName,\n}}\n");
        assert!(text.contains(&end) && !text.contains("register!"), "{text}");
        assert!(text.contains("use lacuna_plugin::lacuna;\n"), "{text}");
        let manifest = library::manifest("long_name", &text, Path::new("/source/sdk"));
        assert!(manifest.contains("lacuna-plugin = { path = \"/source/sdk\" }"), "{manifest}");
        assert_eq!(manifest.contains("\nserde_json"), text.contains("serde_json::"));
    }
    let workspace = concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml");
    let workspace = std::fs::read_to_string(workspace).unwrap();
    let version = |text: &str| text.split('"').nth(1).unwrap().to_owned();
    for (name, written) in library::CRATES {
        let line = workspace.lines().find(|line| line.starts_with(&format!("{name} = "))).unwrap();
        assert_eq!(version(line), version(written), "{name}");
    }
}

/// A name stands in the texts of a skeleton alone, so that it may be a word of the language.
#[test]
fn a_skeleton_that_is_compiled_has_its_name_in_texts_alone() {
    let in_libraries: Vec<&str> =
        ALL.iter().filter(|skeleton| skeleton.in_libraries).map(|skeleton| skeleton.kind).collect();
    for skeletons in [IN_C, IN_CPP] {
        let kinds: Vec<&str> = skeletons.iter().map(|(kind, _)| *kind).collect();
        assert_eq!(kinds, in_libraries);
        for (kind, text) in skeletons {
            assert!(text.starts_with("/* `skeleton`: "), "{kind}");
            for line in text.lines().skip(1).filter(|line| line.contains("skeleton")) {
                let words = line.matches("\"skeleton\"").count();
                assert_eq!(line.matches("skeleton").count(), words, "{kind}: {line}");
            }
        }
    }
}
