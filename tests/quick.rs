//! Studies small enough for tests, and inspection of their run directories.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, OnceLock};

use generator::noise;
use lacuna::run::{Observer, Stop, files};
use lacuna_engine::pipeline;
use lacuna_engine::report::findings::Findings;
use lacuna_engine::study::{Study, resolve};
use lacuna_run::RunDirectory;
// Without this line the linker leaves the plugins out.
use lacuna_plugins as _;
use tempfile::TempDir;

#[path = "quick/described.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
pub mod described;

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A folder with the study in which the stand-in model is simulated on a coarse mesh: 40 runs, three sensors, twenty
/// times, and the founding study's measurements for them.
pub fn simulated() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("quick/study.toml");
    fs::copy(here, folder.path().join("study.toml")).unwrap();
    let table = root().join("configs/sns/strain.csv");
    write_early(&table, folder.path(), |sensor| ["B", "C", "U"].contains(&sensor));
    folder
}

/// Writes the first fifth of a millisecond of a table of strain, of the sensors that are wanted, as `strain.csv`.
pub fn write_early(table: &Path, folder: &Path, wanted: impl Fn(&str) -> bool) {
    let all = fs::read_to_string(table).unwrap();
    let is_early = |line: &&str| {
        let cells: Vec<&str> = line.split(',').collect();
        let time: f64 = cells[2].parse().unwrap_or(0.0);
        (cells[1] == "sensor" || wanted(cells[1])) && time < 2.05e-4
    };
    let some: Vec<&str> =
        all.lines().filter(|line| !line.starts_with('#')).filter(is_early).collect();
    fs::write(folder.join("strain.csv"), some.join("\n") + "\n").unwrap();
}

/// A folder with the study that `lacuna new study` writes: runs and measurements in tables.
pub fn tables() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in ["study.toml", "runs.csv", "responses.csv", "measured.csv"] {
        let from = root().join("cli/src/new").join(file);
        fs::copy(from, folder.path().join(file)).unwrap();
    }
    folder
}

/// Writes a study of one parameter with measurements of `curve` at `points` times up to `length`, with noise of standard
/// deviation 0.1. The sections `[[parameter]]`, `[model]` and `[sampler]` are given.
pub fn oscillation(
    folder: &Path,
    [parameter, model, sampler]: [&str; 3],
    (points, length): (usize, f64),
    curve: impl Fn(f64) -> f64,
) {
    let mut random = noise::Source::new(8);
    let mut table = "t [s],x [m]\n".to_owned();
    for i in 1..=points {
        let t = length * i as f64 / points as f64;
        writeln!(table, "{t},{}", curve(t) + 0.1 * random.normal()).unwrap();
    }
    fs::write(folder.join("data.csv"), table).unwrap();
    let study = format!(
        "[study]\ntitle = \"an oscillation\"\nseed = 3\n\n[[parameter]]\n{parameter}\n\n\
         [response]\nname = \"x\"\nunit = \"m\"\naxes = {{ t = {{ measured = true, unit = \"s\" }} }}\n\n\
         [model]\nuse = \"equations\"\n{model}\n\n[measurements]\nuse = \"csv\"\npath = \"data.csv\"\n\n\
         [discrepancy]\nuse = \"gaussian\"\nvariance = {{ half_normal = 1.0 }}\n\n[sampler]\n{sampler}\n"
    );
    fs::write(folder.join("study.toml"), study).unwrap();
}

/// Replaces a text that must be present in a file of a study.
pub fn replace(path: &Path, old: &str, new: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(old), "{} has no `{old}`", path.display());
    fs::write(path, text.replace(old, new)).unwrap();
}

pub fn load(path: &Path, settings: &[&str]) -> Study {
    let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    let checked = resolve::load(path, &settings);
    let complaints = checked.complaints();
    checked.study.unwrap_or_else(|| panic!("{complaints}"))
}

/// Records which stages begin and what is reported to the user.
#[derive(Default)]
pub struct Watch {
    pub warnings: Mutex<Vec<String>>,
    pub notes: Mutex<Vec<String>>,
}

impl Observer for Watch {
    fn begin(&self, _: &str, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn end(&self, _: &str, _: &str) {}
    fn warn(&self, text: &str) {
        self.warnings.lock().unwrap().push(text.to_owned());
    }
    fn note(&self, text: &str) {
        self.notes.lock().unwrap().push(text.to_owned());
    }
}

/// Outcome of a run through the library.
pub struct Ran {
    pub findings: Findings,
    /// Stages that were made and not reused.
    pub made: Vec<String>,
    pub warnings: Vec<String>,
    /// Messages about results of other versions.
    pub notes: Vec<String>,
}

/// Runs a study through the library.
pub fn run(path: &Path, settings: &[&str], out: &Path) -> Result<Ran, Stop> {
    run_as(env!("CARGO_PKG_VERSION"), path, settings, out)
}

/// Like [`run`], as another version of the program.
pub fn run_as(version: &str, path: &Path, settings: &[&str], out: &Path) -> Result<Ran, Stop> {
    let study = load(path, settings);
    let before = finished(out);
    let watch = Watch::default();
    let mut directory = RunDirectory::open(out)?;
    directory.pretend(version);
    let findings = pipeline::run(&study, &mut directory, &watch)?;
    let made = directory
        .records()
        .iter()
        .filter(|r| !before.contains(&(r.stage.clone(), r.inputs.clone(), r.seconds.to_bits())));
    let made = made.map(|r| r.stage.clone()).collect();
    let [warnings, notes] = [watch.warnings, watch.notes].map(|said| said.into_inner().unwrap());
    Ok(Ran { findings, made, warnings, notes })
}

/// Every record of a finished stage in a run directory, in place or moved aside.
fn finished(out: &Path) -> Vec<(String, String, u64)> {
    let mut found = Vec::new();
    for folder in [out.to_owned(), out.join(".kept")] {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let record = entry.unwrap().path().join("stage.json");
            let Ok(text) = fs::read_to_string(record) else { continue };
            let record: serde_json::Value = serde_json::from_str(&text).unwrap();
            let word = |key: &str| record[key].as_str().unwrap().to_owned();
            let seconds = record["seconds"].as_f64().unwrap().to_bits();
            found.push((word("stage"), word("inputs"), seconds));
        }
    }
    found
}

/// Hashes of the result files, by path from the run directory; times, which differ from run to run, are removed.
pub fn results(out: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(out).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        if !folder.is_dir()
            || name.starts_with('.')
            || name.ends_with("report")
            || name == "figures"
        {
            continue;
        }
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            // Notes that executors keep for themselves, and the folders in which commands ran.
            if path.is_dir() {
                continue;
            }
            let file = path.file_name().unwrap().to_string_lossy().into_owned();
            // Checkpoints and records are not results: calls of a model are noted in the order in which they end.
            let skipped = ["stage.json", "seconds.csv", "seconds", "state.json"];
            let is_log = path.extension().is_some_and(|extension| extension == "jsonl");
            if !skipped.contains(&file.as_str()) && !is_log {
                found.insert(format!("{name}/{file}"), files::hash_file(&path).unwrap());
            }
        }
    }
    if out.join("posterior.nc").exists() {
        let hash = files::hash_file(&out.join("posterior.nc")).unwrap();
        found.insert("posterior.nc".to_owned(), hash);
    }
    let mut summary = summary(out);
    summary.as_object_mut().unwrap().remove("seconds");
    // The executor does not affect the results.
    summary["components"].as_object_mut().unwrap().remove("executor");
    found.insert("summary.json".to_owned(), summary.to_string());
    found
}

/// The summary of a run, every key of which is in the schema.
pub fn summary(out: &Path) -> serde_json::Value {
    described::described(files::read_json(&out.join("summary.json")).unwrap())
}

/// A program of the workspace, built with the tests' profile as part of the workspace: alone, its package would need
/// other features of its dependencies, and rebuild everything.
pub fn program(name: &str) -> PathBuf {
    // The path of the test is `target/<profile>/deps/all-…`.
    let test = std::env::current_exe().unwrap();
    let profile = test.parent().unwrap().parent().unwrap();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut build = Command::new(cargo);
    build.args(["build", "--quiet", "--workspace", "--bin", name, "--target-dir"]);
    build.arg(profile.parent().unwrap()).current_dir(root());
    if profile.ends_with("release") {
        build.arg("--release");
    }
    assert!(build.status().unwrap().success(), "the program `{name}` is not built");
    profile.join(name)
}

/// The command `lacuna`, built once for this test run.
pub fn command() -> Command {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let mut command = Command::new(BUILT.get_or_init(|| program("lacuna")));
    command.stdin(Stdio::null());
    command
}

/// Exit code and standard error of a finished command.
pub fn said(command: &mut Command) -> (Option<i32>, String) {
    let output = command.output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}
