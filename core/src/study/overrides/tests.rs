#![allow(clippy::unwrap_used)]

use std::path::Path;

use serde_json::{Value as Json, json};

use super::*;

const STUDY: &str = "\
[[parameter]]
name = 'density'
prior = { uniform = [0, 1] }
[sampler]
use = 'ensemble'
draws = 7
walkers = 120
";

fn common(section: &str) -> &'static [&'static str] {
    if section == "sampler" { &["draws"] } else { &[] }
}

fn applied(arguments: &[&str]) -> Result<Json, String> {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let id = sources.add_file(Path::new("s.toml"), STUDY.to_owned());
    let mut node = crate::study::read::read(id, &sources, &mut problems).unwrap();
    let arguments: Vec<String> = arguments.iter().map(|&text| text.to_owned()).collect();
    apply(&mut node, &arguments, &common, &mut sources, &mut problems);
    if problems.is_empty() {
        Ok(serde_json::to_value(node).unwrap())
    } else {
        Err(problems.render(&sources))
    }
}

#[test]
fn keys_are_set_by_path_and_name() {
    let set = applied(&[
        "sampler.walkers=200",
        "parameter.density.prior={uniform=[1,2]}",
        "measurements.path=data/strain.csv",
        "study.title = \"a = b\"",
        "sampler.step.size=1e-3",
        "study.\"odd.key\"=true",
    ])
    .unwrap();
    assert_eq!(set["sampler"]["walkers"], 200);
    assert_eq!(set["parameter"][0]["prior"], json!({ "uniform": [1, 2] }));
    assert_eq!(set["measurements"]["path"], "data/strain.csv");
    assert_eq!(set["study"], json!({ "title": "a = b", "odd.key": true }));
    assert_eq!(set["sampler"]["step"]["size"], 1e-3);
}

#[test]
fn values_are_added_to_lists() {
    let set = applied(&["plugins.load+=\"./a.so\"", "plugins.load += ./b.so"]).unwrap();
    assert_eq!(set["plugins"]["load"], json!(["./a.so", "./b.so"]));
    let said = applied(&["sampler.walkers+=3"]).unwrap_err();
    assert!(said.contains("`walkers` is no list to which something could be added"), "{said}");
    assert!(said.contains("found 120"), "{said}");
}

#[test]
fn a_new_plugin_drops_options_whatever_the_order() {
    let expected = json!({ "use": "nuts", "draws": 7, "depth": 5 });
    assert_eq!(applied(&["sampler.use=nuts", "sampler.depth=5"]).unwrap()["sampler"], expected);
    assert_eq!(applied(&["sampler.depth=5", "sampler.use=nuts"]).unwrap()["sampler"], expected);
    assert_eq!(applied(&["sampler.use=ensemble"]).unwrap()["sampler"]["walkers"], 120);
}

#[test]
fn errors_name_the_argument() {
    let expected = "\
--set: there is no `parameter` with the name `densty`
  |
  | parameter.densty.reference=1
  |           ^^^^^^
  = expected `density`
  = help: did you mean `density`?

--set: an argument of `--set` has no `=`
  |
  | sampler.walkers
  | ^^^^^^^^^^^^^^^
  = expected `path=value`, such as `sampler.steps=200`

--set: `sampler.walkers` has no keys to set
  |
  | sampler.walkers.x=1
  |                 ^
  = found 120
";
    let shown =
        applied(&["parameter.densty.reference=1", "sampler.walkers", "sampler.walkers.x=1"]);
    assert_eq!(shown.unwrap_err(), expected);
    assert!(applied(&["sampler.walkers=[1"]).unwrap_err().starts_with("--set: "));
    assert!(applied(&["sampler..x=1"]).unwrap_err().contains("has an empty step"));
    assert!(applied(&["=1"]).unwrap_err().contains("has an empty step"));
}
