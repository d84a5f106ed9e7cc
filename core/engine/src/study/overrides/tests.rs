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
    let mut node = lacuna::text::read::read(id, &sources, &mut problems).unwrap();
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

#[test]
fn strings_need_no_quotes() {
    let set = |text: &str| applied(&[text]).map(|study| study["sampler"]["x"].clone());
    for (written, expected) in [
        ("external", json!("external")),
        ("Foo's study # 2", json!("Foo's study # 2")),
        ("data/my file=1.csv", json!("data/my file=1.csv")),
        ("[python, run.py, 3]", json!(["python", "run.py", 3])),
        ("{ uniform = [0, 1] }", json!({ "uniform": [0, 1] })),
        (
            "{ path = a.csv, all = [[B, C], []] }",
            json!({ "path": "a.csv", "all": [["B", "C"], []] }),
        ),
        ("\"2024\"", json!("2024")),
        ("12", json!(12)),
    ] {
        assert_eq!(set(&format!("sampler.x={written}")).unwrap(), expected, "{written}");
    }
    for wrong in ["", "\"open", "[1", "{ a }"] {
        let said = set(&format!("sampler.x={wrong}")).unwrap_err();
        assert!(said.starts_with("--set: "), "{said}");
        assert!(said.contains(&format!("| sampler.x={wrong}")), "{said}");
        assert!(said.contains('^'), "{said}");
    }
}

/// A problem with a table as a whole is reported at the key that was set in it.
#[test]
fn a_table_that_is_changed_is_that_of_the_argument() {
    let path = Path::new("study.toml");
    let text = "[surrogate]\nuse = 'x'\ndegree = { max = 3 }\n[surrogate.solver]\nterms = 3\n";
    let (mut sources, mut problems) = (Sources::default(), Problems::new());
    let source = sources.add_file(path, text.to_owned());
    let mut study = lacuna::text::read::read(source, &sources, &mut problems).unwrap();
    let arguments = ["surrogate.degree.max=0".to_owned()];
    apply(&mut study, &arguments, &|_| &[], &mut sources, &mut problems);
    let written = |key: &str| sources.text(&study.find(key).unwrap().place).to_owned();
    assert_eq!(written("surrogate.degree"), "degree");
    assert_eq!(sources.get(study.find("surrogate.degree").unwrap().place.source).name, "--set");
    assert_eq!(
        sources.get(study.find("surrogate.solver").unwrap().place.source).name,
        path.display().to_string()
    );
    assert_eq!(
        sources.get(study.get("surrogate").unwrap().place.source).name,
        path.display().to_string()
    );
}
