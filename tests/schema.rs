//! The JSON Schema for editors: an independent validator accepts every study that is shipped, and names the key that is
//! wrong in one that is not.
//!
//! The validator is Python's `jsonschema`; see `python` for what is needed.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use lacuna_engine::study::language;
use serde_json::{Value, json};

use crate::docs::markdown::Page;
use crate::{python, quick};

/// One line a fault: the number of the study, the path, the message.
const VALIDATE: &str = r"
import json, sys
from jsonschema.exceptions import best_match
from jsonschema.validators import validator_for
asked = json.load(open(sys.argv[1]))
validator = validator_for(asked['schema'])
validator.check_schema(asked['schema'])
found = [[['.'.join(map(str, fault.absolute_path)), fault.message] for fault in validator(asked['schema']).iter_errors(study)]
    for study in asked['studies']]
print(json.dumps({'validator': validator.__name__, 'found': found}))
";

/// Faults that the validator finds in each study: path and message. `None` if there is no Python.
fn faults(schema: &Value, studies: &[Value]) -> Option<Vec<Vec<(String, String)>>> {
    let python = python::interpreter("jsonschema")?;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("asked.json");
    fs::write(&path, json!({ "schema": schema, "studies": studies }).to_string()).unwrap();
    let output =
        Command::new(python).args([OsStr::new("-c"), VALIDATE.as_ref()]).arg(&path).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(said["validator"], "Draft7Validator");
    Some(serde_json::from_value(said["found"].clone()).unwrap())
}

fn parsed(text: &str) -> Value {
    let table: toml::Table = text.parse().unwrap_or_else(|error| panic!("{error}\n{text}"));
    // `inf` becomes null, as in editors.
    serde_json::to_value(table).unwrap()
}

/// The studies below a folder.
fn below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            below(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "toml")
            && path.file_name().is_some_and(|name| name != "Cargo.toml")
        {
            found.push(path);
        }
    }
}

/// All studies that are shipped or tested, those in the documentation too, with their names.
fn shipped() -> Vec<(String, Value)> {
    let root = quick::root();
    let mut paths = vec![root.join("cli/src/new/study.toml")];
    for folder in ["configs", "examples"] {
        below(&root.join(folder), &mut paths);
    }
    for name in
        ["assess/oscillator", "coverage/study", "effects/study", "gate/study", "quick/study"]
    {
        paths.push(root.join("tests").join(format!("{name}.toml")));
    }
    paths.sort();
    let mut studies = Vec::new();
    for path in paths {
        let study = parsed(&fs::read_to_string(&path).unwrap());
        // The plugins of a library are in a schema of their own: `dynamic` looks at these.
        if study.get("plugins").is_none() {
            studies.push((path.display().to_string(), study));
        }
    }
    for page in Page::all(&root) {
        for block in page.blocks("toml") {
            let part = !block.text.contains("[study]") && !block.text.contains("extends =");
            let extends = if part { "extends = \"study.toml\"\n" } else { "" };
            let name = format!("{}:{}", page.path.display(), block.line);
            studies.push((name, parsed(&format!("{extends}{}", block.text))));
        }
    }
    studies
}

#[test]
fn every_shipped_study_is_accepted() {
    let (names, studies): (Vec<String>, Vec<Value>) = shipped().into_iter().unzip();
    assert!(studies.len() >= 90, "{} studies", studies.len());
    let Some(found) = faults(&language::schema(), &studies) else { return };
    let refused: Vec<_> =
        names.iter().zip(&found).filter(|(_, faults)| !faults.is_empty()).collect();
    assert!(refused.is_empty(), "{refused:#?}");
}

/// A change of the study that `lacuna new study` writes: what is replaced, by what, the path of the fault, and words of what
/// is said.
const WRONG: &[[&str; 4]] = &[
    ["steps = 4000", "step = 4000", "sampler", "'step' was unexpected"],
    ["steps = 4000", "chains = 4", "sampler", "'chains' was unexpected"],
    ["walkers = 40", "walkers = \"40\"", "sampler.walkers", "'40' is not of type 'integer'"],
    ["walkers = 40", "burn_in = 2", "sampler.burn_in", "2 is greater than"],
    ["[sampler]", "[samplr]", "", "'samplr' was unexpected"],
    ["use = \"gaussian\"", "use = \"gauss\"", "discrepancy.use", "'gauss' is not one of"],
    ["use = \"gaussian\"", "by = \"time\"", "discrepancy", "'use' is a required property"],
    ["variance =", "varianc =", "discrepancy", "'varianc' was unexpected"],
    ["variance =", "varianc =", "discrepancy", "'variance' is a required property"],
    ["half_normal", "half_norm", "discrepancy.variance", "'half_norm' was unexpected"],
    ["{ max = 12 }", "{ maks = 12 }", "surrogate.degree", "'maks' was unexpected"],
    ["validation = 16", "valdation = 16", "surrogate", "'valdation' was unexpected"],
    ["unit = \"mm\"", "units = \"mm\"", "response", "'units' was unexpected"],
    ["count = 20, unit", "number = 20, unit", "response.axes.time", "'number' was unexpected"],
    ["\"reference\"", "\"referenz\"", "validate.against", "'referenz' is not one of"],
    ["title =", "titel =", "study", "'title' is a required property"],
    ["title =", "titel =", "study", "'titel' was unexpected"],
];

/// Text added to a study that extends another, path of the fault, and a part of the expected message.
const WRONG_PARTS: &[[&str; 3]] = &[
    ["[sampler]\nstep = 1", "sampler", "'step' was unexpected"],
    ["sampler = true", "sampler", "True should not be valid"],
    ["sampler = 3", "sampler", "3 is not of type 'object', 'boolean'"],
    ["[surrogate.refine]\nround = 1", "surrogate.refine", "'round' was unexpected"],
    [
        "[[gap.candidate]]\nuse = \"damping\"\nrates = 1",
        "gap.candidate.0",
        "'rates' was unexpected",
    ],
    ["[[gap.candidate]]\nuse = \"dampin\"", "gap.candidate.0.use", "'dampin' is not one of"],
    ["[gap]\nfalse_alarms = 0.1", "gap", "'false_alarms' was unexpected"],
    [
        "[[effect]]\nuse = \"damping\"\non = { sensor = \"B\" }",
        "effect.0.on.sensor",
        "is not of type 'array'",
    ],
    ["[executor]\nuse = \"local\"\npartition = \"x\"", "executor", "'partition' was unexpected"],
    [
        "[low_fidelity.surrogate]\nuse = \"krigin\"",
        "low_fidelity.surrogate.use",
        "'krigin' is not one of",
    ],
    [
        "[[parameter]]\nname = \"a\"\nprior = { uniform = 3 }",
        "parameter.0.prior.uniform",
        "is not of type 'array'",
    ],
];

#[test]
fn the_wrong_key_is_named() {
    let right = fs::read_to_string(quick::root().join("cli/src/new/study.toml")).unwrap();
    let mut cases: Vec<(String, &str, &str)> = Vec::new();
    for [old, new, path, words] in WRONG {
        assert!(right.contains(old), "{old}");
        cases.push((right.replacen(old, new, 1), path, words));
    }
    for [part, path, words] in WRONG_PARTS {
        cases.push((format!("extends = \"study.toml\"\n{part}\n"), path, words));
    }
    let studies: Vec<Value> = cases.iter().map(|(text, ..)| parsed(text)).collect();
    let Some(found) = faults(&language::schema(), &studies) else { return };
    for ((text, path, words), faults) in cases.iter().zip(found) {
        let named = faults.iter().any(|(at, said)| at == path && said.contains(words));
        let vague = faults.iter().any(|(_, said)| said.contains("any of the given schemas"));
        assert!(named && !vague, "{path}: {words}\n{faults:#?}\n{text}");
    }
}

#[test]
fn options_are_written_once() {
    let schema = language::schema();
    let cases = |list: &str| schema.pointer(list).and_then(Value::as_array).unwrap();
    let effects = cases("/properties/effect/items/anyOf");
    assert_eq!(effects, cases("/$defs/GapSection/properties/candidate/items/anyOf"));
    let installed = lacuna::plugin::registry::entries::<dyn lacuna::plugin::Effect>();
    let definitions = installed.iter().map(|effect| format!("#/$defs/effect.{}", effect.name));
    let mut expected: Vec<Value> = definitions.map(|name| json!({ "$ref": name })).collect();
    expected.push(json!(true));
    assert_eq!(*effects, expected);
    let size = language::schema_text().len();
    assert!(size < 370_000, "{size} bytes");
}
