//! `lacuna coverage`: nominal for a correct posterior, and not for a wrong one.

use std::fs;
use std::path::Path;

use generator::{line, noise};
use lacuna::diagnose::coverage::{Coverage, Noise, Source, Word};
use lacuna::run::{Silent, Stop};
use lacuna_engine::coverage::{Asked, coverage};

use lacuna_run::{RunDirectory, Stage};
use tempfile::TempDir;

use crate::quick::{load, replace, root};

/// The line with eight replicates of noise of standard deviation `sd`.
pub fn study(sd: f64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let from = root().join("tests/coverage/study.toml");
    fs::copy(from, folder.path().join("study.toml")).unwrap();
    let data = line::replicates([0.4, -0.3], sd, 8, &mut noise::Source::new(5));
    fs::write(folder.path().join("line.csv"), line::table(&data)).unwrap();
    folder
}

pub fn asked(count: usize, noise: Option<Noise>) -> Asked {
    Asked { count, quick: false, noise, from_runs: false }
}

pub fn count(
    folder: &Path,
    out: &Path,
    settings: &[&str],
    asked: &Asked,
) -> Result<Coverage, Stop> {
    let study = load(&folder.join("study.toml"), settings);
    coverage(&study, asked, &mut RunDirectory::open(out).unwrap(), &Silent)
}

fn cases(out: &Path) -> String {
    fs::read_to_string(out.join(Stage::Coverage.folder().name()).join("cases.json")).unwrap()
}

/// Half as many steps as in the study: a few hundred effective draws.
pub const SHORT: [&str; 1] = ["sampler.steps=1500"];

/// Closed form: intervals have their nominal coverage, ranks are uniform, and the width of the posterior is known.
#[test]
fn a_posterior_in_closed_form_is_nominal() {
    let folder = study(0.5);
    let out = folder.path().join("out");
    let found = count(folder.path(), &out, &SHORT, &asked(200, Some(Noise::Prior))).unwrap();
    assert_eq!(found.tally.verdict.word, Word::Nominal, "{}", found.tally.verdict.text);
    assert_eq!((found.tally.calibrated, found.source), (200, Source::Model));
    let exact = line::posterior(&vec![vec![0.0; 6]; 8], 0.5);
    for (j, row) in found.tally.rows.iter().enumerate() {
        assert_eq!(row.uniform, Some(true), "{row:?}");
        let expected = exact.covariance[j][j].sqrt() / line::PRIOR[j];
        // The median over 200 chains of some hundred effective draws each; the relative error of one standard deviation
        // is 5 %.
        let error = 4.0 * 0.05 * 1.25 / 200.0_f64.sqrt();
        assert!((row.shrinkage[1] / expected - 1.0).abs() < error, "{row:?} {expected}");
        assert!((row.z[1] - 1.0).abs() < 4.0 * 0.5_f64.sqrt() / 200.0_f64.sqrt(), "{row:?}");
    }
    for file in ["coverage.json", "coverage.html"] {
        assert!(out.join(Stage::Coverage.folder().name()).join(file).exists(), "{file}");
    }
    assert!(!out.join(Stage::Coverage.folder().name()).join("cases/00001").exists());
}

/// Noise three times as large as the study states. With the noise of the replicates the error is detected; with the
/// stated noise the coverage is nominal for data that nobody measured, and the difference is reported.
#[test]
fn noise_that_is_stated_too_small_is_found_in_the_replicates() {
    let folder = study(1.5);
    let out = folder.path().join("out");
    let found = count(folder.path(), &out, &SHORT, &asked(100, Some(Noise::Replicates))).unwrap();
    assert_eq!(found.tally.verdict.word, Word::TooNarrow, "{}", found.tally.verdict.text);
    // 2 Phi(1.96 / 3) - 1, within four standard errors, with the two unknowns counted as one.
    let share = found.tally.overall.as_ref().unwrap().levels[2].share;
    assert!((share - 0.486).abs() < 4.0 * (0.25_f64 / 100.0).sqrt(), "{share}");
    assert!((found.noise_ratio.unwrap() - 1.0).abs() < 0.15, "{found:?}");
    let stated = count(folder.path(), &out, &SHORT, &asked(40, None)).unwrap();
    // Eight replicates are too few to serve as the noise unless requested.
    assert_eq!(stated.noise, Noise::Posterior);
    assert_ne!(stated.tally.verdict.word, Word::TooNarrow);
    assert!((stated.noise_ratio.unwrap() - 1.0 / 3.0).abs() < 0.05, "{stated:?}");
    let text = lacuna_engine::report::coverage_text(&stated);
    assert!(text.contains("Replicates scatter by 0.3"), "{text}");
}

/// One thread or two, interrupted or not, in one run or in two: the same bits.
#[test]
fn the_cases_do_not_depend_on_threads_or_interruptions() {
    let folder = study(0.5);
    let short = ["sampler.steps=200"];
    let with = |threads: usize, name: &str, n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let out = folder.path().join(name);
        pool.install(|| count(folder.path(), &out, &short, &asked(n, None))).unwrap();
        cases(&out)
    };
    let whole = with(1, "one", 12);
    assert_eq!(whole, with(2, "two", 12));
    // Fewer truths first: existing ones are reused.
    with(2, "three", 5);
    let log = folder.path().join("three").join(Stage::Coverage.folder().name()).join("cases.jsonl");
    let before = fs::read_to_string(&log).unwrap();
    assert_eq!(whole, with(2, "three", 12));
    assert!(fs::read_to_string(&log).unwrap().starts_with(&before));
    // Killed while writing a line: no stage record, half of a case.
    let killed = folder.path().join("two").join(Stage::Coverage.folder().name());
    let text = fs::read_to_string(killed.join("cases.jsonl")).unwrap();
    fs::write(killed.join("cases.jsonl"), &text[..text.len() / 2]).unwrap();
    for file in ["stage.json", "cases.json"] {
        fs::remove_file(killed.join(file)).unwrap();
    }
    assert_eq!(whole, with(1, "two", 12));
}

/// Without a model the truths are runs held out from the emulator of each case.
#[test]
fn runs_that_are_held_back_are_truths() {
    let folder = crate::quick::tables();
    let out = folder.path().join("out");
    let asked = asked(20, Some(Noise::Prior));
    let found = count(folder.path(), &out, &["sampler.steps=300"], &asked).unwrap();
    assert_eq!((found.source, found.tally.truths), (Source::HeldBack, 20));
    assert!(found.notes.iter().any(|note| note.contains("held out")), "{:?}", found.notes);
    let runs = fs::read_to_string(folder.path().join("runs.csv")).unwrap();
    let kept: serde_json::Value = serde_json::from_str(&cases(&out)).unwrap();
    let truth =
        kept["cases"][0]["case"]["ended"]["calibrated"]["unknowns"][0]["truth"].as_f64().unwrap();
    let is_there = runs.lines().skip(1).any(|line| {
        line.split(',')
            .filter_map(|cell| cell.parse::<f64>().ok())
            .any(|x| (x - truth).abs() <= 1e-12 * x.abs())
    });
    assert!(is_there, "{truth}");
    // Several fits, none with all runs.
    assert!(out.join("7-coverage-surrogate-2").exists());
}

#[test]
fn what_cannot_be_counted_is_refused() {
    let folder = study(0.5);
    let stop = |settings: &[&str], asked: &Asked| {
        let out = folder.path().join("refused");
        count(folder.path(), &out, settings, asked).unwrap_err().to_string()
    };
    let few = asked(4, None);
    let eight = root().join("configs/target/eight_schools.toml");
    let target = load(&eight, &[]);
    let mut run = RunDirectory::open(&folder.path().join("target")).unwrap();
    let error = coverage(&target, &few, &mut run, &Silent).unwrap_err().to_string();
    assert!(error.contains("`[target]`"), "{error}");
    let text = fs::read_to_string(folder.path().join("study.toml")).unwrap();
    let (before, _) = text.split_once("[discrepancy]").unwrap();
    let (first, rest) = before.split_once("[measurements]").unwrap();
    let (_, surrogate) = rest.split_once("[surrogate]").unwrap();
    let path = folder.path().join("study.toml");
    fs::write(&path, format!("{first}[surrogate]{surrogate}")).unwrap();
    let error = stop(&[], &few);
    assert!(error.contains("no `[measurements]`"), "{error}");
    fs::write(&path, &text).unwrap();
    let error = stop(&[], &asked(10_000_000_000_000, None));
    assert!(error.starts_with("10000000000000 truths with their responses need"), "{error}");
    // One replicate has no residuals.
    let data = line::replicates([0.4, -0.3], 0.5, 1, &mut noise::Source::new(5));
    fs::write(folder.path().join("line.csv"), line::table(&data)).unwrap();
    let error = stop(&["sampler.steps=200"], &asked(3, Some(Noise::Replicates)));
    assert!(error.contains("has 1 replicate, but reusing residuals needs at least 3"), "{error}");
    assert!(error.contains("the value at t 1 s"), "{error}");
}

/// A model that can be evaluated on one side of the prior only: truths without a response are reported and not counted.
#[test]
fn truths_at_which_the_model_fails_are_told() {
    let folder = study(0.5);
    let path = folder.path().join("study.toml");
    // The logarithm of a negative number is NaN.
    let observe = "observe = \"level * exp(0 * log((level0 + 0.5 {m}) / (1 {m})))\"";
    replace(&path, "observe = \"level\"", observe);
    // The emulator is trained on tables in which no run failed.
    let design = "[design]\nuse = \"latin_hypercube\"\nruns = 40\n";
    let tables =
        "[simulations]\nuse = \"csv\"\nparameters = \"runs.csv\"\nresponses = \"responses.csv\"\n";
    replace(&path, design, tables);
    let names = ["runs.csv", "responses.csv"];
    for (name, text) in names.iter().zip(line::runs(40, &mut noise::Source::new(6))) {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let out = folder.path().join("out");
    let found = count(folder.path(), &out, &["sampler.steps=200"], &asked(12, None)).unwrap();
    let lost: usize = found.tally.without_data.iter().map(|(_, count)| count).sum();
    assert!((1..12).contains(&lost), "{:?}", found.tally.without_data);
    assert_eq!(found.tally.calibrated + lost, 12);
    let text = lacuna_engine::report::coverage_text(&found);
    assert!(text.contains("Truths without data"), "{text}");
}
