use super::fixture::{bare, findings};
use crate::report::{summary, summary_json, summary_text};

/// The keys of section 5 of the design are there by these names.
#[test]
fn the_documented_keys_are_there() {
    let value = summary(&findings());
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
fn parts_that_were_not_made_are_absent_and_the_text_is_json() {
    let text = summary_json(&bare());
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(value.get("surrogate").is_none() && value.get("parameters").is_none());
    assert!(text.ends_with("}\n"));
}

#[test]
fn numbers_that_are_not_finite_are_null() {
    let mut findings = findings();
    findings.calibration.as_mut().unwrap().coordinates[1].r_hat = f64::NAN;
    let value: serde_json::Value = serde_json::from_str(&summary_json(&findings)).unwrap();
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
