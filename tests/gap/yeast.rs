//! A worked study of a published record, as its page describes it: the growth of yeast (`examples/known_records/yeast`).

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::{python, quick};

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

    the_picture_of_the_page_is_that_of_the_run(&out);

    let lines = String::from_utf8(output.stdout).unwrap();
    let events = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let search = events.filter(|event| event["event"] == "progress" && event["stage"] == "gap");
    let told: Vec<Value> = search.collect();
    let estimated = told.iter().filter(|event| event["about"] == true);
    assert!(estimated.clone().count() > 0, "{told:?}");
    assert!(estimated.into_iter().all(|event| event["total"].as_u64() > Some(0)), "{told:?}");
}

/// `record.svg` is what `figure.py` draws of the run: the same words, and all points within 2 of 460. `LACUNA_BLESS=1` writes it.
fn the_picture_of_the_page_is_that_of_the_run(run: &Path) {
    let Some(interpreter) = python::interpreter("numpy and matplotlib") else { return };
    let folder = quick::root().join("examples/known_records");
    let (shown, drawn) = (folder.join("yeast/record.svg"), run.join("record.svg"));
    let mut command = Command::new(interpreter);
    let done = command.arg(folder.join("figure.py")).args([run, &drawn]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    if std::env::var_os("LACUNA_BLESS").is_some_and(|value| value == "1") {
        fs::copy(&drawn, &shown).unwrap();
    }
    let [shown, drawn] = [shown, drawn].map(|path| fs::read_to_string(path).unwrap());
    let words = |svg: &str| -> Vec<String> {
        let texts = svg.split("<text").skip(1);
        texts.map(|text| text.split(['>', '<']).nth(1).unwrap().to_owned()).collect()
    };
    assert_eq!(words(&shown), words(&drawn));
    let points = |svg: &str| -> Vec<f64> {
        let paths = svg.split(" d=\"").skip(1).map(|path| path.split('"').next().unwrap());
        let numbers = paths.flat_map(|path| path.split_whitespace().map(str::to_owned));
        numbers.filter_map(|number| number.parse().ok()).collect()
    };
    let (shown, drawn) = (points(&shown), points(&drawn));
    assert_eq!(shown.len(), drawn.len());
    let apart = shown.iter().zip(&drawn).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 2.0, "points of the picture are up to {apart} apart");
}
