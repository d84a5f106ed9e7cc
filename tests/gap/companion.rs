//! A companion: linear equations of two masses beside a table of runs, whose simulator also has a spring that hardens.

use std::fs;

use lacuna_engine::gap::search::VerdictKind;
use lacuna_engine::gap::stage::study_file;
use lacuna_engine::study::resolve;

use super::inside::loaded;
use super::two_masses::{DRAG, STUDY, TRUTH, curves, folder, searched};

const COMPANION: &str = r#"
[gap.companion]
use = "equations"
state = { x1 = 0.0, x2 = 0.0, v1 = 0.0, v2 = 0.0 }
observe = { x1 = "x1", x2 = "x2", v1 = "v1" }
fixed = FIXED

[gap.companion.rate]
x1 = "v1"
x2 = "v2"
v1 = "gain * 4 * exp(-((time - 1) / 0.35)^2) - k1 * x1 - c * v1 + k2 * (x2 - x1)"
v2 = "-k2 * (x2 - x1) - c * v2"
"#;

const CONSTANT: &str = r#"
[[gap.companion.parameter]]
name = "gain"
prior = { log_uniform = [0.2, 5.0] }
"#;

/// Drag is named although the companion lacks the hardening spring; its constant is found from the runs; the study that is
/// written has the drag, and its response is that of the emulator with the companion's change.
#[test]
fn a_companion_names_the_drag_inside_a_table_of_runs() {
    let folder = folder(DRAG);
    let text = [STUDY, &COMPANION.replace("FIXED", "{}"), CONSTANT].concat();
    let result = searched(&folder, &text);
    let companion = result.companion.as_ref().unwrap();
    assert!(companion.admitted && companion.error > 0.005, "{companion:?}");
    assert!((companion.constants[0] - 1.0).abs() < 0.05, "{companion:?}");
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    assert!(
        matches!(result.verdict.word, VerdictKind::Named | VerdictKind::Approximate),
        "{:?}",
        result.verdict
    );
    assert_eq!(kinds, ["quadratic_friction"], "{:?}", result.verdict);
    let size = &result.additions[0].unknowns[0];
    assert!((size.value - DRAG).abs() < 4.0 * size.sd && size.sd < 0.3 * DRAG, "{size:?}");
    let proof = &result.held_out[0].proof.all;
    assert!(proof.closed > 0.8 && proof.lower > 0.0, "{proof:?}");

    let path = folder.path().join("study.toml");
    fs::write(&path, &text).unwrap();
    let study = loaded(&folder, &text);
    let written = study_file::write(&study, &path, None, &result).unwrap();
    let checked = resolve::load(&written, &[]);
    let complaints = checked.complaints();
    let with = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    let added = &with.gap.companion.as_ref().unwrap().keys;
    assert_eq!(added.add, ["quadratic_friction"]);
    assert!((added.constants["gain"] - companion.constants[0]).abs() < 1e-12, "{added:?}");
    lacuna_engine::gap::inside::companion::build_added(&with).unwrap();
    let placed = with.placed_effects();
    let nothing = vec![0.0; 300];
    let change = |size: f64| placed[0].apply(&nothing, &[size], &TRUTH[..3]);
    let (model, truth) = (curves(TRUTH, 0.0).concat(), curves(TRUTH, DRAG).concat());
    // The companion's change is that of the generator up to what hardening makes of it: a tenth of it.
    let square = |of: &dyn Fn(usize) -> f64| (0..300).map(|i| of(i).powi(2)).sum::<f64>();
    let own = change(DRAG);
    let error = square(&|i| own[i] - (truth[i] - model[i])) / square(&|i| truth[i] - model[i]);
    assert!(error.sqrt() < 0.1, "{error}");
    assert!(change(0.0).iter().all(|y| *y == 0.0));
}

/// A companion with a wrong constant that nothing identifies is not used, and the verdict says why.
#[test]
fn a_companion_that_does_not_answer_as_the_runs_is_not_used() {
    let folder = folder(DRAG);
    let result =
        searched(&folder, &[STUDY, &COMPANION.replace("FIXED", "{ gain = 0.5 }")].concat());
    let companion = result.companion.as_ref().unwrap();
    assert!(!companion.admitted && companion.error > 0.4, "{companion:?}");
    assert!(result.additions.iter().all(|addition| !addition.is_in_companion()));
    let says = |words: &str| result.verdict.reasons.iter().any(|reason| reason.contains(words));
    assert!(says("the companion is not used: its error on"), "{:?}", result.verdict.reasons);
}

/// A companion that takes whatever the study gives, as a function does, has the inputs of its candidates without being given
/// them in `fixed`: at the value of absence, and with the unit that is stated.
#[test]
fn a_companion_that_is_a_function_has_the_inputs_of_its_candidates() {
    let folder = folder(DRAG);
    fs::write(folder.path().join("masses.py"), "def simulate(**inputs): return []").unwrap();
    let text = r#"
[gap.companion]
use = "python"
file = "masses.py"

[[gap.companion.switch]]
input = "drag"
prior = { half_normal = 0.2 }

[[gap.companion.switch]]
input = "length"
unit = "mm"
absent = 3.0
prior = { normal = [3.0, 0.2] }
"#;
    let study = loaded(&folder, &[STUDY, text].concat());
    let companion = &study.gap.companion.as_ref().unwrap().study;
    let held = |name: &str| companion.held(name).unwrap();
    assert_eq!((held("drag").value, held("length").value), (0.0, 3.0));
    assert_eq!(held("length").input.unit.to_string(), "mm");
}

/// Inputs at several places are one candidate with one law; a study's own model has no such places.
#[test]
fn places_are_checked() {
    let folder = folder(DRAG);
    fs::write(folder.path().join("masses.py"), "def simulate(**inputs): return []").unwrap();
    let input = |name: &str, width: f64, at: f64| {
        format!(
            "[[gap.companion.switch]]\ninput = \"{name}\"\nprior = {{ half_normal = {width} }}\n\
             place = {{ of = \"leak\", at = {at} }}\n"
        )
    };
    let said = |switches: &[String]| {
        let companion = "\n[gap.companion]\nuse = \"python\"\nfile = \"masses.py\"\n\n";
        let text = [STUDY, companion, &switches.concat()].concat();
        resolve::load_text(&folder.path().join("study.toml"), &text, &[]).complaints()
    };
    let first = input("leak_1", 0.1, 0.25);
    assert_eq!(said(&[first.clone(), input("leak_2", 0.1, 0.5)]), "");
    let twice = said(&[first.clone(), input("leak_2", 0.1, 0.25)]);
    assert!(twice.contains("`leak_1` is `leak` at 0.25 too"), "{twice}");
    let wider = said(&[first.clone(), input("leak_2", 0.2, 0.5)]);
    assert!(wider.contains("`leak` has another law, unit or absent value at `leak_1`"), "{wider}");
    let other = "[[gap.companion.switch]]\ninput = \"leak\"\nprior = { half_normal = 0.1 }\n";
    let named = said(&[first.clone(), other.to_owned()]);
    assert!(named.contains("is also the name of an input"), "{named}");
    let own = said(&[first.replace("gap.companion.switch", "gap.switch")]);
    assert!(own.contains("places are known to `[[gap.companion.switch]]` alone"), "{own}");
}
