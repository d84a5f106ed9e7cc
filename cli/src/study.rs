//! `run`, `check`, `resume`, `report`, `compare`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use lacuna::assess::{Assessment, Level};
use lacuna::compare::{self, Finished};
use lacuna::report::findings::Findings;
use lacuna::report::summary_text;
use lacuna::run::{RunDirectory, Stop, files};
use lacuna::stage;
use lacuna::study::resolve::{self, Use};
use lacuna::study::{Checked, Study, emit};

use crate::progress::Terminal;
use crate::{Failure, plugins, print};

/// Keys set on the command line.
#[derive(clap::Args)]
pub struct Settings {
    /// Set a key of the study, such as `sampler.steps=200`; may be given more than once.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    libraries: Libraries,
}

/// Libraries of plugins named on the command line.
#[derive(clap::Args)]
pub struct Libraries {
    /// Load a library of plugins beside those of the study: its code runs; may be given more than once.
    #[arg(long = "plugin", value_name = "PATH")]
    pub files: Vec<PathBuf>,
}

impl Settings {
    /// What was set, the libraries included: they are those of `[plugins]`.
    pub fn set(&self) -> Vec<String> {
        let absolute = |file: &PathBuf| std::path::absolute(file).unwrap_or_else(|_| file.clone());
        let load = |file: &PathBuf| {
            format!("plugins.load+={}", emit::string(&absolute(file).to_string_lossy()))
        };
        self.set.iter().cloned().chain(self.libraries.files.iter().map(load)).collect()
    }
}

/// What is done about a verdict.
#[derive(Clone, Copy, clap::Args)]
pub struct Trust {
    /// Exit with code 3 unless the result is trusted without reservations.
    #[arg(long)]
    strict: bool,
}

impl Trust {
    /// A failure where the study asked for trust and there is none.
    pub fn demand(self, assessment: &Assessment) -> Result<(), Failure> {
        if !self.strict || assessment.level == Level::Trusted {
            return Ok(());
        }
        Err(Failure { text: format!("error: {} (`--strict`)", assessment.line()), code: 3 })
    }
}

/// `lacuna run STUDY`
pub fn run(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    trust: Trust,
) -> Result<(), Failure> {
    let study = load(path, settings)?;
    execute(&study, &folder(&study, out), false, trust)
}

/// The run directory of a study: the one that is asked for, else `runs/<study name>`.
///
/// A study that gives itself no name has that of its file or of the study that it extends, which others may have too, as
/// `a/study.toml` and `b/study.toml` do. Where that directory belongs to another file that is still there, it is named
/// after the file, after folder and file, or has a number behind it.
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
    let of = |folder: &Path| stage::manifest::origin(folder);
    let is_own = |folder: &PathBuf| of(folder).is_some_and(|other| other == file);
    let is_free = |folder: &PathBuf| of(folder).is_none_or(|other| !other.exists());
    folders().find(is_own).or_else(|| folders().find(is_free)).unwrap_or_else(|| runs.join(long))
}

/// `lacuna check STUDY`
pub fn check(path: &Path, settings: &Settings) -> Result<(), Failure> {
    let checked = resolve::load_for(path, &settings.set(), Use::Check);
    for library in &checked.libraries {
        print(&plugins::would_load(library));
    }
    let study = sound(checked, path)?;
    let wrong = stage::contents::check(&study);
    if !wrong.is_empty() {
        let texts: Vec<String> = wrong.iter().map(ToString::to_string).collect();
        let plural = if wrong.len() == 1 { "" } else { "s" };
        let (count, files) = (wrong.len(), path.display());
        let text = texts.join("\n\n");
        return Err(Failure::wrong(format!(
            "{text}\n\n{count} problem{plural} in the files of {files}"
        )));
    }
    let response = match &study.target {
        Some(_) => String::new(),
        None => format!(", {} values a response", study.layouts.len()),
    };
    let parameters = study.parameters.len();
    print(&format!("{}: no problems; {parameters} parameters{response}", path.display()));
    Ok(())
}

/// `lacuna resume RUN`
pub fn resume(folder: &Path, trust: Trust) -> Result<(), Failure> {
    execute(&kept_study(folder)?, folder, is_finished(folder), trust)
}

/// `lacuna report RUN`
pub fn report(folder: &Path, trust: Trust) -> Result<(), Failure> {
    let study = kept_study(folder)?;
    if !is_finished(folder) {
        let stop = Stop::new(format!("the run in {} is not finished", folder.display()));
        return Err(stop
            .help(format!("`lacuna resume {}` goes on with it", folder.display()))
            .into());
    }
    execute(&study, folder, true, trust)
}

/// Prints finished runs side by side.
pub fn compare(folders: &[PathBuf], json: bool) -> Result<(), Failure> {
    let runs: Result<Vec<Finished>, Stop> = folders.iter().map(|f| Finished::read(f)).collect();
    let comparison = compare::compare(&runs?);
    if json {
        let text = serde_json::to_string_pretty(&comparison)
            .map_err(|error| Stop::new(format!("the comparison cannot be written: {error}")))?;
        print(&text);
    } else {
        print(&compare::text(&comparison));
    }
    Ok(())
}

/// The study in a file, if nothing is wrong with it.
pub fn load(path: &Path, settings: &Settings) -> Result<Study, Failure> {
    load_for(path, settings, Use::Run)
}

/// The same for some use.
pub fn load_for(path: &Path, settings: &Settings, purpose: Use) -> Result<Study, Failure> {
    sound(resolve::load_for(path, &settings.set(), purpose), path)
}

/// The study, if nothing is wrong with it.
fn sound(checked: Checked, path: &Path) -> Result<Study, Failure> {
    let complaints = checked.complaints();
    checked.study.ok_or_else(|| {
        let count = checked.problems.sorted().len();
        let plural = if count == 1 { "" } else { "s" };
        Failure::wrong(format!("{complaints}\n{count} problem{plural} in {}", path.display()))
    })
}

/// The study of a run directory: as it was resolved, so that `--set` arguments count.
fn kept_study(folder: &Path) -> Result<Study, Failure> {
    let purpose = if is_finished(folder) { Use::Look } else { Use::Run };
    kept_study_for(folder, purpose)
}

/// The same for some use.
pub fn kept_study_for(folder: &Path, purpose: Use) -> Result<Study, Failure> {
    let resolved = folder.join("resolved.toml");
    if !resolved.exists() {
        let text =
            format!("error: {} is no run directory: it has no resolved.toml", folder.display());
        return Err(Failure::wrong(text));
    }
    let mut study = sound(resolve::load_for(&resolved, &[], purpose), &resolved)?;
    let written: PathBuf = folder.join("study.toml");
    study.text = String::from_utf8_lossy(&files::read(&written)?).into_owned();
    Ok(study)
}

fn is_finished(folder: &Path) -> bool {
    folder.join("manifest.json").exists()
}

/// The closing summary, its first line in the colour of the verdict where a terminal shows colours.
pub fn print_summary(findings: &Findings) {
    let text = summary_text(findings);
    let (first, rest) = text.trim_end().split_once('\n').unwrap_or((text.trim_end(), ""));
    print(&coloured(first, findings.assessment.level));
    print(rest);
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

/// Runs all stages; a run that is only looked at is taken whatever version made it.
fn execute(study: &Study, folder: &Path, look: bool, trust: Trust) -> Result<(), Failure> {
    let mut run = RunDirectory::open(folder)?;
    if look {
        run.look();
    }
    let terminal = Terminal::new();
    let findings = stage::run(study, &mut run, &terminal)?;
    print("");
    print_summary(&findings);
    print("");
    print(&format!("report: {}", folder.join("report.html").display()));
    trust.demand(&findings.assessment)
}
