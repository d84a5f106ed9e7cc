//! Commands `run`, `check`, `resume`, `report`, `compare`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use lacuna::text::emit;
use lacuna_engine::assess::{Assessment, Level};
use lacuna_engine::compare::{self, Finished};
use lacuna_engine::pipeline;
use lacuna_engine::report::findings::Findings;
use lacuna_engine::report::summary_text;
use lacuna_engine::stage::manifest::RESOLVED;
use lacuna_engine::stage::{self, manifest};
use lacuna_engine::study::resolve::{self, Use};
use lacuna_engine::study::sizes::Memory;
use lacuna_engine::study::{Checked, Study};
use lacuna_run::RunDirectory;

use crate::interrupt::{self, Next};
use crate::plugins::Libraries;
use crate::terminal::{clean, print_styled, tell};
use crate::{Untrusted, events, misuse, plugins, print, progress, show};

/// Keys set on the command line.
#[derive(Default, clap::Args)]
pub struct Settings {
    /// Set a key of the study, such as `sampler.steps=200`; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    libraries: Libraries,
}

impl Settings {
    /// Settings of the command line, with the libraries as those of `[plugins]`.
    pub fn set(&self) -> Vec<String> {
        let absolute = |file: &PathBuf| std::path::absolute(file).unwrap_or_else(|_| file.clone());
        let load = |file: &PathBuf| {
            format!("plugins.load+={}", emit::string(&absolute(file).to_string_lossy()))
        };
        self.set.iter().cloned().chain(self.libraries.files.iter().map(load)).collect()
    }
}

/// Reaction to the verdict on a result.
#[derive(Clone, Copy, clap::Args)]
pub struct Trust {
    /// Exit with code 3 unless the result is trusted without reservations
    #[arg(long)]
    strict: bool,
}

impl Trust {
    /// Checks the verdict.
    ///
    /// # Errors
    /// Under `--strict`, if the result is not trusted.
    pub fn demand(self, assessment: &Assessment) -> anyhow::Result<()> {
        if !self.strict || assessment.level == Level::Trusted {
            return Ok(());
        }
        Err(Untrusted(format!("{} (`--strict`)", assessment.line())).into())
    }
}

/// Runs `lacuna run STUDY`.
pub fn run(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    trust: Trust,
) -> anyhow::Result<()> {
    let study = load(path, settings)?;
    execute(&study, &folder(&study, out), false, trust)
}

/// The run directory of a study: the requested one, otherwise `runs/<study name>`.
///
/// A study without a name takes that of its file or of the study that it extends, which is not unique, as for
/// `a/study.toml` and `b/study.toml`. If that directory belongs to another file that still exists, the directory is
/// named after the file, after folder and file, or with a number appended.
pub fn folder(study: &Study, out: Option<&Path>) -> PathBuf {
    if let Some(out) = out {
        return out.to_owned();
    }
    let runs = Path::new("runs");
    if study.named {
        return runs.join(&study.name);
    }
    let file = std::path::absolute(&study.file).unwrap_or_else(|_| study.file.clone());
    let text =
        |name: Option<&std::ffi::OsStr>| name.unwrap_or_default().to_string_lossy().into_owned();
    let stem = text(file.file_stem());
    let long = match text(file.parent().and_then(Path::file_name)) {
        folder if folder.is_empty() => stem.clone(),
        folder => format!("{folder}-{stem}"),
    };
    let numbered = (2..1000).map(|n| format!("{long}-{n}"));
    let names: Vec<String> =
        [study.name.clone(), stem, long.clone()].into_iter().chain(numbered).collect();
    let folders = || names.iter().map(|name| runs.join(name));
    let of = |folder: &Path| manifest::origin(folder);
    let is_own = |folder: &PathBuf| of(folder).is_some_and(|other| other == file);
    let is_free = |folder: &PathBuf| of(folder).is_none_or(|other| !other.exists());
    folders().find(is_own).or_else(|| folders().find(is_free)).unwrap_or_else(|| runs.join(long))
}

/// Memory above which `lacuna check` tells what a study needs, in bytes.
const TOLD: f64 = 1e8;

/// Runs `lacuna check STUDY`.
pub fn check(path: &Path, settings: &Settings) -> anyhow::Result<()> {
    // What the command line names is trusted: its options are checked too.
    plugins::load(&settings.libraries)?;
    let checked = resolve::load_for(path, &settings.set(), Use::Check);
    for library in &checked.libraries {
        print(&plugins::would_load(library));
    }
    let study = sound(checked, path)?;
    let measured = stage::contents::check(&study).map_err(|wrong| {
        let texts: Vec<String> = wrong.iter().map(ToString::to_string).collect();
        let plural = if wrong.len() == 1 { "" } else { "s" };
        let (count, files) = (wrong.len(), path.display());
        let text = texts.join("\n\n");
        misuse(format!("{text}\n\n{count} problem{plural} in the files of {files}"))
    })?;
    let memory = Memory::of(&study, measured);
    if let Some(memory) = &memory {
        memory.fits().map_err(misuse)?;
    }
    let response = match &study.target {
        Some(_) => String::new(),
        None => format!(", {} values a response", study.layouts.len()),
    };
    let parameters = study.parameters.len();
    print(&format!("{}: no problems; {parameters} parameters{response}", path.display()));
    if let Some(memory) = memory.filter(|memory| memory.bytes > TOLD) {
        print(&memory.to_string());
    }
    if let Some(runs) = stage::quantities::runs(&study) {
        print(&if study.intervals().is_empty() {
            format!("the priors are propagated with {runs} runs of the model (`forward.draws`)")
        } else {
            format!(
                "priors and intervals are propagated with at most {runs} runs of the model (`forward.draws`, \
                 `forward.intervals`)"
            )
        });
    }
    Ok(())
}

/// Runs `lacuna resume RUN`.
pub fn resume(folder: &Path, trust: Trust) -> anyhow::Result<()> {
    execute(&kept_study(folder)?, folder, is_finished(folder), trust)
}

/// Runs `lacuna report RUN`.
pub fn report(folder: &Path, trust: Trust) -> anyhow::Result<()> {
    let study = kept_study(folder)?;
    if !is_finished(folder) {
        let stop = Stop::new(format!("the run in {} is not finished", folder.display()));
        return Err(stop
            .help(format!("`lacuna resume {}` goes on with it", folder.display()))
            .into());
    }
    execute(&study, folder, true, trust)
}

/// Prints a comparison of finished runs.
pub fn compare(folders: &[PathBuf], json: bool) -> anyhow::Result<()> {
    let runs: Result<Vec<Finished>, Stop> = folders.iter().map(|f| Finished::read(f)).collect();
    let comparison = compare::compare(&runs?);
    if json {
        let text = serde_json::to_string_pretty(&comparison)
            .map_err(|error| Stop::new(format!("the comparison cannot be written: {error}")))?;
        print(&text);
    } else {
        show(&compare::text(&comparison));
    }
    Ok(())
}

/// Loads the study in a file.
///
/// # Errors
/// If it has problems: all of them.
pub fn load(path: &Path, settings: &Settings) -> anyhow::Result<Study> {
    load_for(path, settings, Use::Run)
}

/// Like [`load`], for the given purpose.
pub fn load_for(path: &Path, settings: &Settings, purpose: Use) -> anyhow::Result<Study> {
    sound(resolve::load_for(path, &settings.set(), purpose), path)
}

/// The study, if it has no problems.
fn sound(checked: Checked, path: &Path) -> anyhow::Result<Study> {
    let complaints = checked.complaints();
    checked.study.ok_or_else(|| {
        let count = checked.problems.sorted().len();
        let plural = if count == 1 { "" } else { "s" };
        misuse(format!("{complaints}\n{count} problem{plural} in {}", path.display()))
    })
}

/// The study of a run directory as it was resolved, so that `--set` arguments are included.
fn kept_study(folder: &Path) -> anyhow::Result<Study> {
    let purpose = if is_finished(folder) { Use::Look } else { Use::Run };
    kept_study_for(folder, purpose)
}

/// Like [`kept_study`], for the given purpose.
pub fn kept_study_for(folder: &Path, purpose: Use) -> anyhow::Result<Study> {
    let resolved = folder.join(RESOLVED);
    if !resolved.exists() {
        let text =
            format!("error: {} is no run directory: it has no resolved.toml", folder.display());
        return Err(misuse(text));
    }
    let mut study = sound(resolve::load_for(&resolved, &[], purpose), &resolved)?;
    let written: PathBuf = folder.join("study.toml");
    study.text = String::from_utf8_lossy(&files::read(&written)?).into_owned();
    let edited = |hash: String| hash != files::hash(study.text.as_bytes());
    if manifest::study_hash(folder).is_some_and(edited) {
        let (file, resolved) = (written.display(), resolved.display());
        tell(&format!(
            "warning: {file} has been changed since the run began. It is a copy and is not read: the run goes on as {resolved} says. \
             To change a study, edit its own file and run that"
        ));
    }
    if manifest::resolved_is_edited(folder) {
        let (file, folder) = (resolved.display(), folder.display());
        tell(&format!(
            "warning: {file} has been changed since Lacuna wrote it. It is read as it is now, and results in {folder} may be those of \
             the study before the change; `lacuna resume {folder}` makes again what the change concerns"
        ));
    }
    Ok(study)
}

fn is_finished(folder: &Path) -> bool {
    folder.join("manifest.json").exists()
}

/// Tells where the report of a run is.
pub fn report_of(folder: &Path) {
    if events::are_on() {
        return events::result(folder);
    }
    print(&format!("report: {}", folder.join("report.html").display()));
}

/// Prints the closing summary; on a colour terminal its first line has the colour of the verdict.
pub fn print_summary(findings: &Findings) {
    let text = summary_text(findings);
    let (first, rest) = text.trim_end().split_once('\n').unwrap_or((text.trim_end(), ""));
    if events::are_on() {
        print(first);
    } else {
        print_styled(&coloured(&clean(first), findings.assessment.level));
    }
    show(rest);
}

fn coloured(line: &str, level: Level) -> String {
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    if plain || !std::io::stdout().is_terminal() {
        return line.to_owned();
    }
    let colour = match level {
        Level::Trusted => "32",
        Level::TrustedWithReservations => "33",
        Level::NotTrusted => "31",
    };
    format!("\u{1b}[1;{colour}m{line}\u{1b}[0m")
}

/// Runs all stages; with `look`, results are reused whatever version made them.
fn execute(study: &Study, folder: &Path, look: bool, trust: Trust) -> anyhow::Result<()> {
    let mut run = RunDirectory::open(folder)?;
    interrupt::explain(folder, Next::Resume);
    if look {
        if study.libraries.absent.is_empty() { run.look() } else { run.look_as_recorded() }
    }
    let observer = progress::observer();
    let findings = pipeline::run(study, &mut run, &*observer)?;
    print("");
    print_summary(&findings);
    print("");
    report_of(folder);
    trust.demand(&findings.assessment)
}
