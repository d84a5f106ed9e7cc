#![allow(clippy::unwrap_used)]

use serde_json::{Value as Json, json};

use super::*;

fn common(section: &str) -> &'static [&'static str] {
    if section == "surrogate" { &["training"] } else { &[] }
}

/// Loads the first of some files; its tree or the problems as they are shown.
fn loaded(files: &[(&str, &str)]) -> Result<Json, String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let path = folder.path().join(files[0].0);
    let node = load(&path, &common, &mut sources, &mut problems);
    let shown = problems.render(&sources).replace(&format!("{}/", folder.path().display()), "");
    node.map(|node| serde_json::to_value(node).unwrap()).ok_or(shown)
}

const BASE: &str = "\
[study]
title = 'base'
seed = 1

[[parameter]]
name = 'density'
prior = { uniform = [0, 1] }
reference = 3

[[parameter]]
name = 'speed'
prior = { uniform = [0, 1] }

[surrogate]
use = 'chaos'
training = 480
degree = { max = 20, min = 1 }

[surrogate.solver]
kind = 'lars'
terms = 3
";

#[test]
fn tables_are_merged_and_values_replaced() {
    let study = "extends = 'bases/base.toml'\n[study]\ntitle = 'new'\n[[parameter]]\n\
                 name = 'speed'\nprior = { normal = 1 }\n[[parameter]]\nname = 'new'\n\
                 [surrogate]\ndegree = { max = 3 }\nsolver.terms = 5\n[gap]\nhold_out = 0.5\n";
    let merged = loaded(&[("a.toml", study), ("bases/base.toml", BASE)]).unwrap();
    assert_eq!(
        merged,
        json!({
            "study": { "title": "new", "seed": 1 },
            "parameter": [
                { "name": "density", "prior": { "uniform": [0, 1] }, "reference": 3 },
                { "name": "speed", "prior": { "normal": 1 } },
                { "name": "new" },
            ],
            "surrogate": {
                "use": "chaos", "training": 480, "degree": { "max": 3 },
                "solver": { "kind": "lars", "terms": 5 },
            },
            "gap": { "hold_out": 0.5 },
        })
    );
}

#[test]
fn a_new_plugin_drops_the_options_of_the_old_one() {
    let study = "extends = 'base.toml'\n[surrogate]\nuse = 'process'\nkernel = 'matern'\n";
    let merged = loaded(&[("a.toml", study), ("base.toml", BASE)]).unwrap();
    let expected = json!({ "use": "process", "training": 480, "kernel": "matern" });
    assert_eq!(merged["surrogate"], expected);
    let same = "extends = 'base.toml'\n[surrogate]\nuse = 'chaos'\n";
    let merged = loaded(&[("a.toml", same), ("base.toml", BASE)]).unwrap();
    assert_eq!(merged["surrogate"]["degree"]["max"], 20);
}

#[test]
fn a_chain_goes_through_and_a_cycle_does_not() {
    let files = [
        ("a.toml", "extends = 'b.toml'\nx = 1"),
        ("b.toml", "extends = 'c/c.toml'\ny = 2\nx = 2"),
        ("c/c.toml", "z = 3\ny = 3"),
    ];
    assert_eq!(loaded(&files).unwrap(), json!({ "z": 3, "y": 2, "x": 1 }));
    let cycle = [files[0], files[1], ("c/c.toml", "extends = '../a.toml'\n")];
    let expected = "\
c/c.toml:1:11: a study cannot extend itself
  |
1 | extends = '../a.toml'
  |           ^^^^^^^^^^^
  = found `a.toml` extends `b.toml` extends `c/c.toml` extends `c/../a.toml`
  = help: take out one `extends` of the chain
";
    assert_eq!(loaded(&cycle).unwrap_err(), expected);
}

#[test]
fn what_cannot_be_extended_is_shown() {
    let missing = loaded(&[("a.toml", "extends = 'b.toml'")]).unwrap_err();
    let head = "a.toml:1:11: cannot read `b.toml`: there is no such file\n";
    assert!(missing.starts_with(head), "{missing}");
    let number = loaded(&[("a.toml", "extends = 1")]).unwrap_err();
    assert!(number.contains("expected the path of a study, relative to this file, found 1"));
    let broken = loaded(&[("a.toml", "extends = 'b.toml'"), ("b.toml", "x = ")]).unwrap_err();
    assert!(broken.starts_with("b.toml:1:"), "{broken}");
    let mut problems = Problems::new();
    let mut sources = Sources::default();
    let absent = Path::new("no/such/study.toml");
    assert!(load(absent, &common, &mut sources, &mut problems).is_none());
    assert_eq!(
        problems.render(&sources),
        "cannot read `no/such/study.toml`: there is no such file\n"
    );
}

#[test]
fn places_stay_those_of_the_file_they_were_written_in() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("base.toml"), BASE).unwrap();
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let text = "extends = 'base.toml'\n[study]\ntitle = 'new'\n".to_owned();
    let path = folder.path().join("a.toml");
    let node = load_text(&path, text, &common, &mut sources, &mut problems).unwrap();
    assert_eq!(sources.text(&node.find("study.seed").unwrap().place), "1");
    assert_eq!(sources.text(&node.find("study.title").unwrap().place), "'new'");
    assert_eq!(sources.text(&node.find("parameter.speed.prior.uniform").unwrap().place), "[0, 1]");
    // Where nothing was written, the nearest parent is meant.
    assert_eq!(sources.text(&node.nearest_place("surrogate.degree.least")), "degree");
    assert_eq!(sources.text(&node.nearest_place("surrogate.steps")), "surrogate");
}
