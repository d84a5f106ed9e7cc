//! The table of effects in `docs/effects.md`, from the effects themselves.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

use lacuna::data::{Axis, Layout, Unit};
use lacuna::plugin::{Effect, registry};

use super::{compare, root};

/// Curves over time, which name the unknowns.
fn layout() -> Layout {
    let times = Axis::grid("time", vec![0.0, 1.0, 2.0], Unit::dimensionless());
    Layout { axes: vec![times], ..Layout::number("y") }
}

/// Names in backticks that a documentation gives after the words "confused with".
fn confused(prose: &str, all: &[&str]) -> Vec<String> {
    let after = prose.split("confused with").skip(1).filter_map(|rest| rest.split("\n\n").next());
    let quoted = after.flat_map(|rest| rest.split('`').skip(1).step_by(2));
    let mut found: Vec<String> = Vec::new();
    for name in quoted.filter(|name| all.contains(name)) {
        let name = format!("`{name}`");
        if !found.contains(&name) {
            found.push(name);
        }
    }
    found
}

/// A row a registered effect, in the order of their names.
fn table() -> String {
    let mut table = String::from(
        "| effect | title | formula | unknowns, the size first | easily confused with |\n|---|---|---|---|---|\n",
    );
    let kind = registry::kinds().into_iter().find(|kind| kind.name == "effect").unwrap();
    let plugins = kind.plugins();
    let all: Vec<&str> = plugins.iter().map(|plugin| plugin.name).collect();
    for plugin in &plugins {
        let name = plugin.name;
        let effect = registry::from_text::<dyn Effect>(name, "").unwrap().plugin;
        let words = effect.describe();
        let unknowns =
            effect.parameters(&layout()).into_iter().map(|own| format!("`{}`", own.name));
        let unknowns = unknowns.collect::<Vec<_>>().join(", ");
        let unlike = confused(&plugin.manual().unwrap().prose, &all).join(", ");
        let (title, formula) = (words.title, words.formula);
        writeln!(
            table,
            "| [`{name}`](reference/effect.{name}.md) | {title} | `{formula}` | {unknowns} | {unlike} |"
        )
        .unwrap();
    }
    table
}

#[test]
fn the_table_of_effects_is_that_of_the_plugins() {
    let page = fs::read_to_string(root().join("docs/effects.md")).unwrap();
    let mark = "<!-- effects: written by tests/docs/effects.rs from plugins/effects -->\n\n";
    let (before, rest) = page.split_once(mark).expect("the mark of the table");
    let (_, after) = rest.split_once("\n\n").expect("the end of the table");
    let whole = format!("{before}{mark}{}\n{after}", table());
    compare(&BTreeMap::from([("docs/effects.md".to_owned(), whole)]));
}

#[test]
fn the_effect_of_the_guide_is_the_one_that_is_compiled() {
    let page = fs::read_to_string(root().join("docs/effects.md")).unwrap();
    let source = fs::read_to_string(root().join("plugins/effects/gain.rs")).unwrap();
    let (_, rest) = page.split_once("```rust\n").expect("a block of Rust");
    let (block, _) = rest.split_once("```\n").expect("the end of the block");
    assert!(
        source.contains(block),
        "docs/effects.md shows another `gain` than plugins/effects/gain.rs"
    );
}
