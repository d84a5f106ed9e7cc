//! `campaign`: the runs of a run directory.

use std::path::{Path, PathBuf};

use lacuna::campaign;
use lacuna::plugin::Reader;
use lacuna::plugin::registry::from_text;
use lacuna::run::{RunDirectory, Stop};
use lacuna::study::resolve::Use;

use crate::progress::Terminal;
use crate::study::kept_study_for;
use crate::{Failure, print};

/// What is done with the runs.
#[derive(clap::Subcommand)]
pub enum Campaign {
    /// Show where each run is, with reasons.
    Status {
        /// The run directory.
        run: PathBuf,
        /// Show the runs that are done too.
        #[arg(long)]
        all: bool,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Make the runs that failed or are missing, and nothing else.
    Retry {
        /// The run directory.
        run: PathBuf,
    },
    /// End all jobs that run or wait on the cluster.
    Cancel {
        /// The run directory.
        run: PathBuf,
    },
    /// Add runs to the design without moving those that are there.
    Extend {
        /// The run directory.
        run: PathBuf,
        /// How many runs are added.
        #[arg(long, value_name = "N")]
        runs: std::num::NonZeroUsize,
    },
    /// Take in finished runs that were made by hand.
    Import {
        /// The run directory.
        run: PathBuf,
        /// CSV with the columns `run`, `file` and one a parameter.
        table: PathBuf,
        /// The reader of the files; when left out, that of the study's `[simulations]`.
        #[arg(long, value_name = "NAME")]
        reader: Option<String>,
        /// An option of the reader, such as `variable="strain_{sensor}"`; may be given more than once.
        #[arg(long = "option", value_name = "KEY=VALUE", requires = "reader")]
        options: Vec<String>,
    },
}

/// `lacuna campaign …`
pub fn campaign(what: &Campaign) -> Result<(), Failure> {
    match what {
        Campaign::Status { run, all, json } => status(run, *all, *json),
        Campaign::Retry { run } => retry(run),
        Campaign::Cancel { run } => cancel(run),
        Campaign::Extend { run, runs } => extend(run, runs.get()),
        Campaign::Import { run, table, reader, options } => {
            import(run, table, reader.as_deref(), options)
        }
    }
}

fn status(folder: &Path, all: bool, json: bool) -> Result<(), Failure> {
    let study = kept_study_for(folder, Use::Look)?;
    let executor = study.executor.as_ref().map(|section| &*section.built.plugin);
    let status = campaign::status(folder, executor, RunDirectory::is_busy(folder))?;
    if json {
        let text = serde_json::to_string_pretty(&status)
            .map_err(|error| Stop::new(format!("the table cannot be written: {error}")))?;
        print(&text);
    } else {
        print(campaign::text(&status, all).trim_end());
    }
    Ok(())
}

fn retry(folder: &Path) -> Result<(), Failure> {
    let study = kept_study_for(folder, Use::Run)?;
    let mut run = RunDirectory::open(folder)?;
    let failed = campaign::retry(&study, &mut run, &Terminal::new())?;
    if failed > 0 {
        let plural = if failed == 1 { "run has" } else { "runs have" };
        let stop = Stop::new(format!("{failed} {plural} failed again"));
        let help = format!("`lacuna campaign status {}` says why", folder.display());
        return Err(stop.help(help).into());
    }
    print(&format!("all runs are done; `lacuna resume {}` goes on with them", folder.display()));
    Ok(())
}

fn cancel(folder: &Path) -> Result<(), Failure> {
    let study = kept_study_for(folder, Use::Look)?;
    let executor = study.executor.as_ref().ok_or_else(|| Stop::new("the study has no executor"))?;
    let stopped = campaign::cancel(folder, &*executor.built.plugin)?;
    if stopped == 0 {
        print("no job of this campaign runs or waits");
        return Ok(());
    }
    let help = if RunDirectory::is_busy(folder) {
        "the process that waits for them will say that they were cancelled".to_owned()
    } else {
        format!("`lacuna resume {}` submits them again", folder.display())
    };
    print(&format!("{stopped} runs cancelled; {help}"));
    Ok(())
}

fn extend(folder: &Path, runs: usize) -> Result<(), Failure> {
    let run = RunDirectory::open(folder)?;
    let grown = campaign::extend(&run, runs)?;
    let folder = folder.display();
    print(&format!(
        "{} runs in all; `lacuna resume {folder}` makes the new ones\n\
         to have them in your study file too, write in [design]: {}",
        grown.runs, grown.line
    ));
    Ok(())
}

fn import(
    folder: &Path,
    table: &Path,
    reader: Option<&str>,
    options: &[String],
) -> Result<(), Failure> {
    let study = kept_study_for(folder, Use::Look)?;
    let run = RunDirectory::open(folder)?;
    let reader = reader.map(|name| from_text::<dyn Reader>(name, &options.join("\n")));
    let reader = reader.transpose().map_err(Failure::wrong)?;
    let plugin = reader.as_ref().map(|built| &*built.plugin);
    let taken = campaign::import(&study, &run, table, plugin)?;
    print(&format!(
        "{} runs taken into {}; `lacuna resume {}` uses them",
        taken.runs.len(),
        taken.folder.display(),
        folder.display()
    ));
    Ok(())
}
