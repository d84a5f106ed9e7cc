//! A worked study of a published record, as its page describes it: the growth of yeast (`examples/known_records/yeast`).

use std::fs;

use serde_json::Value;

use crate::quick;

#[test]
fn yeast_lacks_the_logistic_law_and_the_search_tells_how_far_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let study = quick::root().join("examples/known_records/yeast/study.toml");
    let arguments = ["gap".as_ref(), study.as_os_str(), "--out".as_ref(), out.as_os_str()];
    let output = quick::command().args(arguments).arg("--events").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = fs::read_to_string(out.join("summary.json")).unwrap();
    let gap = &serde_json::from_str::<Value>(&text).unwrap()["gap"];
    assert_eq!(
        (&gap["verdict"], &gap["class"][0]),
        (&"class".into(), &"quadratic_friction".into())
    );
    assert!(gap["held_out"]["shrank"].as_bool() == Some(true), "{}", gap["held_out"]);
    // R. Pearl, Quarterly Review of Biology 2 (1927) 532, by a fit of other weights: 665 / (1 + exp(4.1896 - 0.5355 t)).
    let published = 0.5355 / 665.0;
    let crowding = &gap["effects"][0]["parameters"]["quadratic_friction"]["mean"];
    let ratio = crowding.as_f64().unwrap() / published;
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");

    let lines = String::from_utf8(output.stdout).unwrap();
    let events = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let search = events.filter(|event| event["event"] == "progress" && event["stage"] == "gap");
    let told: Vec<Value> = search.collect();
    let estimated = told.iter().filter(|event| event["about"] == true);
    assert!(estimated.clone().count() > 0, "{told:?}");
    assert!(estimated.into_iter().all(|event| event["total"].as_u64() > Some(0)), "{told:?}");
}
