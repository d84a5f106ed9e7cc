//! The complete workflow on `configs/hidden_effect`: the search, the study that it writes, its run, and the contents of
//! the report and `summary.json`. The answer is taken from the generator, in the last assertions only.

use std::fs;
use std::path::{Path, PathBuf};

use generator::{Kind, PARAMETERS};
use lacuna::run::Silent;
use lacuna_engine::augment::{Begun, add};
use lacuna_engine::pipeline;
use lacuna_engine::study::resolve;
use lacuna_run::RunDirectory;

use crate::quick::described::summary_of;

/// As in `examples/hidden_effect.rs`.
const SEED: u64 = 1846;

fn copied(folder: &Path) -> PathBuf {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hidden_effect");
    for file in ["study.toml", "knock.csv", "sweep.csv"] {
        fs::copy(from.join(file), folder.join(file)).unwrap();
    }
    folder.join("study.toml")
}

#[test]
fn a_hidden_effect_is_found_added_and_shown_to_close_the_gap() {
    let folder = tempfile::tempdir().unwrap();
    let path = copied(folder.path());
    let checked = resolve::load(&path, &["sampler.steps=120".to_owned()]);
    let complaints = checked.complaints();
    let study = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    let mut run = RunDirectory::open(&folder.path().join("runs/base")).unwrap();
    let findings = pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let gap = findings.gap.as_ref().unwrap();
    let settings = ["sampler.steps=120".to_owned()];
    let begun = Begun {
        study: &study,
        path: &path,
        folder: None,
        settings: &settings,
        findings: &findings,
        gap,
    };
    let (added, _) = add(&begun, &run, &Silent).unwrap();

    // The old study unchanged except for its name, and a block that states why it was added.
    let text = fs::read_to_string(&added.study).unwrap();
    let old = fs::read_to_string(&path).unwrap();
    let name = added.study.file_stem().unwrap().to_string_lossy().replace("study", "hidden_effect");
    let renamed = old.replace("name = \"hidden_effect\"", &format!("name = \"{name}\""));
    assert!(text.contains(renamed.trim_end()), "{text}");
    assert!(text.contains("[[effect]]") && text.contains("# found:"), "{text}");
    // Nothing was simulated or emulated twice.
    for stage in ["2-simulate", "4-surrogate"] {
        let file = |root: &Path| fs::read(root.join(stage).join("stage.json")).unwrap();
        assert_eq!(file(run.root()), file(&added.run), "{stage}");
    }

    // The study with the effect, calibrated with the same data, agrees with the search, because its emulator is the
    // same.
    let [searched, shown] = [&gap.result.held_out[0], &added.held_out[0]];
    assert_eq!(searched.names, shown.names);
    let [searched, shown] = [searched, shown].map(|part| part.proof.all.closed);
    assert!((searched - shown).abs() < 1e-3, "{searched} {shown}");

    // Without a new search the report shows the outcome, and a second run of the study keeps it.
    let again = pipeline::run(&study, &mut run, &Silent).unwrap();
    assert_eq!(again.gap.as_ref().unwrap().added.as_ref(), Some(&added));
    let summary = summary_of(&again);
    let told = &summary["gap"];
    assert_eq!(told["effects"][0]["parameters"].as_object().unwrap().len(), 1, "{told:#}");
    assert!(told["held_out"]["lower"].as_f64().unwrap() > 0.0, "{told:#}");
    assert!(told["held_out"]["closed"].as_f64().unwrap() > 0.8, "{told:#}");
    assert_eq!(told["held_out"]["count"], 6);
    assert_eq!(told["study"].as_str().unwrap(), added.study.to_str().unwrap());
    let page = fs::read_to_string(run.root().join("report.html")).unwrap();
    assert!(page.contains("What the model misses"));
    // The calibration without the effect is not trusted, nor shown as if it were.
    let missing = again.assessment.of_code("missing_effect").next().unwrap();
    assert!(missing.message.starts_with("The model misses `saturation`"), "{missing:?}");
    assert_ne!(summary["assessment"]["level"], "trusted");

    let hidden = generator::case(SEED, &[(Kind::Saturation, vec![2])], 1.0, 12);
    assert_eq!(told["verdict"], "named", "{told:#}");
    assert_eq!(told["effects"][0]["type"], "saturation");
    assert_eq!(told["effects"][0]["sensors"][0], "v1");
    for (name, truth) in PARAMETERS.iter().zip(hidden.truth) {
        let moved = added.parameters.iter().find(|moved| moved.name == *name).unwrap();
        let away = (moved.mean[1] - truth) / moved.sd[1];
        assert!(away.abs() < 4.0, "{name}: {moved:?}, true {truth}");
    }
}
