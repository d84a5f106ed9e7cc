use super::fixture::{bare, findings};
use schemars::JsonSchema;
use serde_json::Value;

use crate::report::findings::Findings;
use crate::report::{keys, schema, schema_of, summary, summary_text};

fn written(findings: &Findings) -> Value {
    serde_json::to_value(summary(findings)).unwrap()
}

/// The keys of section 5 of the design exist under these names.
#[test]
fn the_documented_keys_are_there() {
    let value = written(&findings());
    for pointer in [
        "/schema",
        "/study",
        "/surrogate/mae",
        "/surrogate/rmse",
        "/surrogate/loo",
        "/surrogate/unit",
        "/parameters/density/mean",
        "/parameters/density/sd",
        "/parameters/density/q025",
        "/parameters/density/q975",
        "/parameters/density/map",
        "/parameters/density/r_hat",
        "/parameters/density/ess_bulk",
        "/parameters/density/ess_tail",
        "/parameters/density/unit",
        "/parameters/variance/mean",
        "/correlation/names",
        "/correlation/matrix",
        "/acceptance/mean",
        "/acceptance/min",
        "/acceptance/max",
        "/converged",
        "/accuracy/map/B",
        "/accuracy/map/average",
        "/accuracy/reference/average",
        "/seconds/surrogate",
    ] {
        assert!(value.pointer(pointer).is_some_and(|v| !v.is_null()), "{pointer}");
    }
    assert_eq!(value["schema"], 1);
    assert_eq!(value["parameters"]["density"]["mean"], 12_111.8);
    assert_eq!(value["correlation"]["matrix"][1][2], -0.84);
    assert_eq!(value["chains"]["stranded"][0], 17);
    assert!(value.get("gap").is_none());
}

#[test]
fn parts_that_were_not_made_are_absent() {
    let value = written(&bare());
    let absent = ["runs", "data", "surrogate", "parameters", "converged", "loo", "accuracy", "gap"];
    assert!(absent.iter().all(|key| value.get(key).is_none()), "{value}");
}

#[test]
fn numbers_that_are_not_finite_are_null() {
    let mut findings = findings();
    findings.calibration.as_mut().unwrap().coordinates[1].r_hat = f64::NAN;
    let value = written(&findings);
    assert!(value["parameters"]["density"]["r_hat"].is_null());
}

#[test]
fn the_terminal_gets_warnings_then_tables_aligned() {
    let text = summary_text(&findings());
    assert!(text.starts_with("trusted\n\nwarning: 2 of 120 chains are stranded"));
    let header = text.lines().find(|line| line.starts_with("parameter")).unwrap();
    let row = text.lines().find(|line| line.starts_with("density")).unwrap();
    assert_eq!(header.chars().count(), row.chars().count(), "{text}");
    // The standard error of the mean is 0.36 kg/m3: one decimal is known.
    assert!(row.contains(" 12111.8 ") && row.contains(" 14.9 "), "{row}");
    assert!(text.lines().any(|line| line.starts_with("average")));
}

/// Keys without a documented meaning, and maps whose entries have no title.
fn undocumented<T: JsonSchema>() -> Vec<String> {
    let all = keys(&schema_of::<T>()).into_iter();
    let silent = all.filter(|key| key.meaning.is_empty() || key.path.contains("<>"));
    silent.map(|key| key.path).collect()
}

#[test]
fn every_key_is_documented() {
    assert_eq!(undocumented::<crate::report::Summary>(), Vec::<String>::new());
    let keys = keys(&schema());
    let paths: Vec<&str> = keys.iter().map(|key| &*key.path).collect();
    for path in
        ["study", "parameters.<name>.mean", "accuracy.<case>.<group>", "accuracy.<case>.average"]
    {
        assert!(paths.contains(&path), "{path} in {paths:#?}");
    }
    for path in ["gap.effects[].type", "gap.insight.separations.ranked[].what.kind", "gap.study"] {
        assert!(paths.contains(&path), "{path} in {paths:#?}");
    }
    let kind = |path: &str| &*keys.iter().find(|key| key.path == path).unwrap().kind;
    assert_eq!(kind("correlation.matrix"), "list of lists of numbers");
    assert_eq!(kind("gap.regions[].band"), "list of 2 numbers or `null`");
    assert_eq!(kind("loo.error_by_curve"), "number or `null`");
    assert_eq!(kind("gap.log_evidence"), "object");
}

/// Struct with undocumented keys.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is made")]
struct Careless {
    /// Documented.
    mean: f64,
    sd: f64,
    /// Documented, but not by what.
    seconds: crate::report::ByName<Part>,
}

#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is made")]
struct Part {
    whole: bool,
}

#[test]
fn a_key_without_documentation_is_found() {
    let found = undocumented::<Careless>();
    assert_eq!(found, ["sd", "seconds.<>", "seconds.<>.whole"]);
}

/// A schema that allows unknown keys would accept any document.
#[test]
fn every_object_of_the_schema_is_closed() {
    fn open(schema: &Value, path: &str, found: &mut Vec<String>) {
        if schema["type"] == "object" && schema.get("additionalProperties").is_none() {
            found.push(path.to_owned());
        }
        let parts: Vec<(String, &Value)> = match schema {
            Value::Object(object) => object.iter().map(|(k, v)| (k.clone(), v)).collect(),
            Value::Array(list) => list.iter().map(|v| (String::new(), v)).collect(),
            _ => Vec::new(),
        };
        for (name, part) in parts {
            open(part, &format!("{path}/{name}"), found);
        }
    }
    let mut found = Vec::new();
    open(&schema(), "", &mut found);
    assert_eq!(found, Vec::<String>::new());
}
