//! Command `campaign`: the runs of a run directory.

use std::path::{Path, PathBuf};

use lacuna::plugin::Reader;
use lacuna::plugin::registry::from_text;
use lacuna::run::Stop;
use lacuna_engine::campaign;
use lacuna_engine::study::Study;
use lacuna_engine::study::resolve::Use;
use lacuna_run::RunDirectory;

use crate::interrupt::{self, Next};
use crate::study::kept_study_for;
use crate::{misuse, print, progress, show};

/// Operation on the runs.
#[derive(clap::Subcommand)]
pub enum Campaign {
    /// Show the state of each run, with reasons
    Status {
        /// The run directory.
        run: PathBuf,
        /// Include the runs that are done
        #[arg(long)]
        all: bool,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Repeat the runs that failed or are missing, and nothing else
    Retry {
        /// The run directory.
        run: PathBuf,
    },
    /// Cancel all jobs that run or are queued on the cluster
    Cancel {
        /// The run directory.
        run: PathBuf,
    },
    /// Add runs to the design; existing points are kept
    Extend {
        /// The run directory.
        run: PathBuf,
        /// Number of runs to add
        #[arg(long, value_name = "N")]
        runs: std::num::NonZeroUsize,
    },
    /// Import finished runs that were made by hand
    Import {
        /// The run directory.
        run: PathBuf,
        /// CSV file with the columns `run`, `file` and one per parameter
        table: PathBuf,
        /// Reader of the files (default: that of the study's `[simulations]`)
        #[arg(long, value_name = "NAME")]
        reader: Option<String>,
        /// Option of the reader, such as `variable="strain_{sensor}"`; may be repeated
        #[arg(long = "option", value_name = "KEY=VALUE", requires = "reader")]
        options: Vec<String>,
    },
}

/// Runs `lacuna campaign …`.
pub fn campaign(what: &Campaign) -> anyhow::Result<()> {
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

/// The study of a run directory; `None` if only cases of one were computed there, as by `lacuna coverage`.
fn study_of(folder: &Path) -> anyhow::Result<Option<Study>> {
    if !folder.join("resolved.toml").exists() && campaign::has_runs(folder) {
        return Ok(None);
    }
    kept_study_for(folder, Use::Look).map(Some)
}

fn status(folder: &Path, all: bool, json: bool) -> anyhow::Result<()> {
    let study = study_of(folder)?;
    let status = campaign::status(study.as_ref(), folder, RunDirectory::is_busy(folder))?;
    if json {
        let text = serde_json::to_string_pretty(&status)
            .map_err(|error| Stop::new(format!("the table cannot be written: {error}")))?;
        print(&text);
    } else {
        show(campaign::text(&status, all).trim_end());
    }
    Ok(())
}

fn retry(folder: &Path) -> anyhow::Result<()> {
    let study = kept_study_for(folder, Use::Run)?;
    let mut run = RunDirectory::open(folder)?;
    interrupt::explain(folder, Next::Again);
    let failed = campaign::retry(&study, &mut run, &*progress::observer())?;
    if failed > 0 {
        let plural = if failed == 1 { "run has" } else { "runs have" };
        let stop = Stop::new(format!("{failed} {plural} failed again"));
        let help = format!("`lacuna campaign status {}` shows why", folder.display());
        return Err(stop.help(help).into());
    }
    print(&format!("all runs are done; `lacuna resume {}` continues with them", folder.display()));
    Ok(())
}

fn cancel(folder: &Path) -> anyhow::Result<()> {
    let study = study_of(folder)?;
    let stopped = campaign::cancel(study.as_ref(), folder)?;
    if stopped == 0 {
        print("no job of this campaign is running or queued");
        return Ok(());
    }
    let help = if RunDirectory::is_busy(folder) {
        "the waiting process will report them as cancelled".to_owned()
    } else {
        match study {
            Some(_) => format!("`lacuna resume {}` submits runs again", folder.display()),
            None => "the command that asked for them submits them again".to_owned(),
        }
    };
    print(&format!("{stopped} runs cancelled; {help}"));
    Ok(())
}

fn extend(folder: &Path, runs: usize) -> anyhow::Result<()> {
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
) -> anyhow::Result<()> {
    let study = kept_study_for(folder, Use::Look)?;
    let run = RunDirectory::open(folder)?;
    let reader = reader.map(|name| from_text::<dyn Reader>(name, &options.join("\n")));
    let reader = reader.transpose().map_err(misuse)?;
    let plugin = reader.as_ref().map(|built| &*built.plugin);
    let taken = campaign::import(&study, &run, table, plugin)?;
    print(&format!(
        "{} runs imported into {}; `lacuna resume {}` uses them",
        taken.runs.len(),
        taken.folder.display(),
        folder.display()
    ));
    Ok(())
}
