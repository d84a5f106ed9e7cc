//! Air drag, missing in free fall, on measured drops of balls from a bridge. The files are those of de Silva, Higdon,
//! Brunton and Kutz, Frontiers in AI 3 (2020) 25.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use lacuna::run::Silent;
use lacuna_engine::gap::result::GapResult;
use lacuna_engine::gap::search::VerdictKind;
use lacuna_engine::study::resolve::load_text;
use lacuna_run::RunDirectory;

/// A heavy ball, two sports balls, a hollow one with holes: 2.3 to 0.03 kg.
const BALLS: [&str; 4] = ["bowling_ball", "golf_ball", "tennis_ball", "whiffle_ball_1"];

/// Frames of the camera per second.
const FRAMES: f64 = 15.0;

const STUDY: &str = r#"
[study]
title = "Balls dropped from a bridge"
seed = 1590

[[parameter]]
name = "gravity"
unit = "m/s2"
prior = { normal = [9.81, 0.01] }

[[parameter]]
name = "height"
unit = "m"
scenario = "each"
prior = { normal = [47.0, 5.0] }

[[parameter]]
name = "velocity"
unit = "m/s"
scenario = "each"
prior = { normal = [0.0, 3.0] }

[response]
name = "place"
unit = "m"
axes = { time = { measured = true, unit = "s" } }

[model]
use = "equations"
state = { y = "height", v = "velocity" }
rate = { y = "v", v = "-gravity" }
observe = "y"

[measurements]
use = "csv"
path = "{scenario}.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "no_u_turn"
metric = "dense"
warm_up = 40
steps = 60

# Drag grows with the width of a ball (creeping flow) or with its section (turbulent flow), and its mass resists.
[[gap.term]]
use = "linear_friction"
state = "v"
of = "v * diameter / mass"

[[gap.term]]
use = "quadratic_friction"
state = "v"
of = "v * diameter / sqrt(mass)"

[gap]
candidates = ["gain", "delay", "drift"]
simulations = 59
hold_out = { along = [[0.7, 1.0], [1.7, 2.0]] }
"#;

/// Rows of a table by their first two cells.
type Rows = BTreeMap<(String, String), Vec<[f64; 2]>>;

fn rows(text: &str) -> Rows {
    let mut rows = Rows::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let key = (cells[0].to_owned(), cells[1].to_owned());
        rows.entry(key).or_default().push([cells[2].parse().unwrap(), cells[3].parse().unwrap()]);
    }
    rows
}

/// Height at a time, linearly interpolated between frames.
fn height(drop: &[[f64; 2]], time: f64) -> f64 {
    let pair = drop.windows(2).find(|pair| time <= pair[1][0] + 1e-9);
    pair.map_or(drop[drop.len() - 1][1], |pair| {
        let ([a, y], [b, z]) = (pair[0], pair[1]);
        y + (z - y) * (time - a) / (b - a)
    })
}

/// The search in a study of the drops, each as its own record or both of a ball as replicates, with a key `noise`.
fn search(drops: &Rows, balls: &str, together: bool, noise: &str) -> GapResult {
    let folder = tempfile::tempdir().unwrap();
    let path = "path = \"{scenario}.csv\"\n";
    let mut text = STUDY.replace(path, &format!("{path}{noise}"));
    for line in balls.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        if !BALLS.contains(&cells[0]) {
            continue;
        }
        let own = ["1", "2"].map(|drop| &drops[&(cells[0].to_owned(), drop.to_owned())]);
        let last = own.iter().map(|drop| drop[drop.len() - 1][0]).fold(f64::INFINITY, f64::min);
        let own = if together { &own[..] } else { &own[..1] };
        let mut csv = "replicate,time [s],place [m]\n".to_owned();
        for (r, drop) in own.iter().enumerate() {
            let times = (0..).map(|i| f64::from(i) / FRAMES).take_while(|time| *time < last);
            for time in times {
                writeln!(csv, "{r},{time},{}", height(drop, time)).unwrap();
            }
        }
        fs::write(folder.path().join(format!("{}.csv", cells[0])), csv).unwrap();
        write!(
            text,
            "[[scenario]]\nname = \"{}\"\n[scenario.values]\nmass = {{ value = {}, unit = \"kg\" }}\n\
             diameter = {{ value = {}, unit = \"m\" }}\n",
            cells[0], cells[1], cells[2]
        )
        .unwrap();
    }
    let checked = load_text(&folder.path().join("study.toml"), &text, &[]);
    let complaints = checked.complaints();
    let study = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    findings.gap.unwrap().result
}

/// The tables, if they are available.
fn tables() -> Option<(Rows, String)> {
    let folder = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/reference/effect_data/falling_balls"
    ));
    let read = |name: &str| fs::read_to_string(folder.join(name)).ok();
    let both = read("ball_drops.csv").zip(read("balls.csv"));
    if both.is_none() {
        eprintln!("skipped: {} is not there", folder.display());
    }
    both.map(|(drops, balls)| (rows(&drops), balls))
}

fn kinds(result: &GapResult) -> Vec<&str> {
    result.additions.iter().map(|addition| addition.kind.as_str()).collect()
}

const DRAG: [&str; 2] = ["linear_friction", "quadratic_friction"];

/// Two drops of a ball show the variation between drops: the model lacks drag, whatever its law.
#[test]
fn the_drag_of_the_air_is_missing_in_free_fall() {
    let Some((drops, balls)) = tables() else { return };
    let result = search(&drops, &balls, true, "");
    let verdict = &result.verdict;
    assert!(matches!(verdict.word, VerdictKind::Named | VerdictKind::Class), "{verdict:?}");
    let kinds = kinds(&result);
    assert!(kinds.len() == 1 && DRAG.contains(&kinds[0]), "{kinds:?} {verdict:?}");
    assert!(!result.noise_assumed);
    let proof = &result.held_out[0].proof;
    assert!(proof.all.closed > 0.8, "{proof:?}");
}

/// One drop of each ball has no replicates: the noise is estimated from the residual about the slow part of a record,
/// which is smoother than drops are repeatable. Then no law of drag fits, and none may be named with confidence.
#[test]
fn drops_without_replicates_name_no_law_with_confidence() {
    let Some((drops, balls)) = tables() else { return };
    let result = search(&drops, &balls, false, "");
    let verdict = &result.verdict;
    assert!(result.noise_assumed);
    assert_eq!(verdict.word, VerdictKind::Unlisted, "{verdict:?}");
    assert!(kinds(&result).iter().any(|kind| DRAG.contains(kind)), "{verdict:?}");
    assert!(verdict.reasons.iter().any(|reason| reason.contains("noise assumed")), "{verdict:?}");
}

/// A frame shows a ball to about a decimetre, which the study states: drag explains the records nearly, and first.
#[test]
fn drops_with_the_camera_s_noise_lack_drag() {
    let Some((drops, balls)) = tables() else { return };
    let result = search(&drops, &balls, false, "noise = { sd = { value = 10, unit = \"cm\" } }\n");
    let verdict = &result.verdict;
    let kinds = kinds(&result);
    assert!(kinds.first().is_some_and(|kind| DRAG.contains(kind)), "{kinds:?} {verdict:?}");
    let assumed =
        |reason: &String| reason.contains("noise assumed in part") && reason.contains("0.10 m");
    assert!(verdict.reasons.iter().any(assumed), "{verdict:?}");
    let proof = &result.held_out[0].proof;
    assert!(proof.all.closed > 0.8, "{proof:?}");
}
