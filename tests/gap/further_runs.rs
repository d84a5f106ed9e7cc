//! A further table of runs, whose simulator has the suspected physics.

use std::fmt::Write as _;
use std::fs;

use generator::noise::Source;
use lacuna::run::Silent;
use lacuna_engine::gap::search::VerdictKind;
use lacuna_engine::gap::stage::study_file;
use lacuna_engine::study::resolve;
use lacuna_run::RunDirectory;
use tempfile::TempDir;

use super::inside::loaded;
use super::two_masses::{DRAG, STUDY, curves, folder, rows, searched};

const TABLE: &str = r#"
[[gap.runs]]
name = "drag"
use = "csv"
parameters = "runs_with_drag.csv"
responses = "responses_with_drag.csv"
"#;

/// Keys of a table that varies the drag.
const VARIED: &str = "size = \"coefficient\"\nprior = { uniform = [0.0, 0.5] }\n";

/// Keys of a table in which the drag has one size.
const FIXED: &str = "prior = { uniform = [0.0, 2.0] }\n";

/// The size of the drag in a table in which it does not vary.
const SIZE: f64 = 0.2;

/// Writes the second table, of runs with drag; `varied` draws its size.
fn write_runs_with_drag(folder: &TempDir, varied: bool) {
    let mut random = Source::new(5);
    let column = if varied { ",coefficient" } else { "" };
    let mut runs = format!("run,k1,k2,c{column}\n");
    let mut responses = "run,sensor,time,y\n".to_owned();
    for run in 0..100 {
        let [k1, k2, c, size] = [[3.2, 4.8], [1.6, 2.4], [0.3, 0.5], [0.0, 0.5]]
            .map(|[low, high]| random.uniform(low, high));
        let (size, value) = if varied { (size, format!(",{size}")) } else { (SIZE, String::new()) };
        writeln!(runs, "{run},{k1},{k2},{c}{value}").unwrap();
        rows(&mut responses, &run.to_string(), &curves([k1, k2, c, 1.0], size));
    }
    for (name, text) in [("runs_with_drag.csv", runs), ("responses_with_drag.csv", responses)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
}

/// The drag is named, sized and proven; the study that is written has its size among the unknowns.
fn is_found(keys: &str, varied: bool, size: f64, error: f64) {
    let folder = folder(DRAG);
    write_runs_with_drag(&folder, varied);
    let text = [STUDY, TABLE, keys].concat();
    let result = searched(&folder, &text);
    let verdict = &result.verdict;
    let word = verdict.word;
    assert!(matches!(word, VerdictKind::Named | VerdictKind::Approximate), "{verdict:?}");
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    assert_eq!(kinds, ["drag"], "{verdict:?}");
    let found = &result.additions[0].unknowns[0];
    assert!((found.value - size).abs() < 4.0 * found.sd + error, "{found:?}");
    assert!(found.sd < 0.2 * size, "{found:?}");
    assert!(result.held_out[0].proof.all.closed > 0.8, "{:?}", result.held_out[0].proof.all);

    let path = folder.path().join("study.toml");
    fs::write(&path, &text).unwrap();
    let written = study_file::write(&loaded(&folder, &text), &path, None, &result).unwrap();
    let checked = resolve::load(&written, &[]);
    let complaints = checked.complaints();
    let with = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    assert!(with.has_effects());
    let mut run = RunDirectory::open(&folder.path().join("with")).unwrap();
    let (_, calibrated) =
        lacuna_engine::pipeline::calibrate_emulated(&with, &mut run, &Silent).unwrap();
    let outcome = calibrated.unwrap().value.outcome;
    let mut all = outcome.coordinates.iter().zip(&outcome.map);
    let own = all.find(|(coordinate, _)| coordinate.name == found.name);
    let (_, value) = own.unwrap_or_else(|| panic!("{:?}", outcome.coordinates));
    assert!((value - size).abs() < 4.0 * found.sd + error, "{value} {found:?}");
}

#[test]
fn a_table_that_varies_the_drag_names_and_sizes_it() {
    is_found(VARIED, true, DRAG, 0.0);
}

/// The size is a share of the drag of the table. Drag is not proportional to its coefficient: two tables of the generator
/// tell by how much the share differs from the quotient of the coefficients.
#[test]
fn a_table_with_one_drag_names_its_share() {
    let point = [4.1, 1.95, 0.41, 1.0];
    let [without, table, truth] = [0.0, SIZE, DRAG].map(|size| curves(point, size).concat());
    let product = |a: &[f64], b: &[f64]| -> f64 {
        let change = |y: &[f64], i: usize| y[i] - without[i];
        (0..without.len()).map(|i| change(a, i) * change(b, i)).sum()
    };
    let share = product(&truth, &table) / product(&table, &table);
    assert!((share - DRAG / SIZE).abs() < 0.1, "{share}");
    is_found(FIXED, false, share, 0.02);
}

/// Physics that is not in the data is not found.
#[test]
fn a_table_of_other_physics_names_nothing() {
    let folder = folder(0.0);
    write_runs_with_drag(&folder, true);
    let result = searched(&folder, &[STUDY, TABLE, VARIED].concat());
    assert!(result.additions.is_empty(), "{:?}", result.verdict);
}

#[test]
fn a_name_without_a_table_is_refused() {
    let folder = folder(0.0);
    write_runs_with_drag(&folder, true);
    let text = [&STUDY.replace("[gap]", "[gap]\nadd = [\"helium\"]"), TABLE, VARIED].concat();
    let checked = resolve::load_text(&folder.path().join("study.toml"), &text, &[]);
    let complaints = checked.complaints();
    assert!(
        complaints.contains("there is no table `helium` of `[[gap.runs]]` to add"),
        "{complaints}"
    );
}
