//! The `lacuna` command: arguments and printing, no numerics.

mod campaign;
mod convert;
mod coverage;
mod events;
mod gap;
mod inspect;
mod interrupt;
mod layout;
mod manual;
mod new;
mod plugins;
mod progress;
mod serve;
mod study;
mod terminal;
#[cfg(test)]
mod tests;
mod view;
mod work;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Parser, Subcommand};
use terminal::{print, show};
// The plugins register themselves; naming their crate makes the linker include it.
use lacuna_plugins as _;

/// Lacuna closes the gap between simulation and measurement.
///
/// A study is one TOML file that names a model, a design, a surrogate, a discrepancy and a sampler. Lacuna
/// trains the surrogate on simulation runs, infers the model's parameters with their uncertainty,
/// validates, and writes a report.
#[derive(Parser)]
#[command(name = "lacuna", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
    /// Number of threads (default: all cores); affects the run time, not the results
    #[arg(long, global = true, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// For programs: print JSON, one event a line (stages, progress, warnings, results, the end with its exit code)
    #[arg(long, global = true)]
    events: bool,
}

#[derive(Subcommand)]
enum Verb {
    /// Run all stages of a study and write its report
    Run {
        /// Study file
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// Run directory (default: `runs/<study name>`)
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Check a study and list all problems at once, with line and caret
    Check {
        /// Study file
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
    },
    /// Find physics that is missing in a study's model, write the study that includes it, and test whether the gap
    /// shrinks
    Gap {
        /// Study file
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// Run directory (default: `runs/<study name>`); the study with the effects runs beside it
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        manner: gap::Manner,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Estimate the power of `lacuna gap`: plant every effect in a study's own noise and count what is found, how
    /// small, and how often wrongly; `[cases]` in the study says where, if not in threads of this process
    Power {
        /// Study file
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// Run directory (default: `runs/<study name>`)
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Quick look with fewer cases and simulations
        #[arg(long)]
        quick: bool,
    },
    /// Rank further measurements and runs by the bits per cost that they are expected to give on the name of what is
    /// missing, on the parameters, or on a quantity
    Next {
        /// Study file
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// Run directory (default: `runs/<study name>`)
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Purpose to rank by (default: the name if there is a choice, or else the quantity, or else the parameters)
        #[arg(long, value_enum)]
        by: Option<gap::By>,
    },
    /// Count how often a study's intervals contain the truth, by calibrating data generated at truths from the prior;
    /// `[cases]` in the study says where, if not in threads of this process
    Coverage {
        /// Study file
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// Run directory (default: `runs/<study name>`)
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        manner: coverage::Manner,
    },
    /// Continue an interrupted run from its directory
    Resume {
        /// Run directory
        run: PathBuf,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Write the report of a finished run again
    Report {
        /// Run directory
        run: PathBuf,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Compare finished runs: posteriors, errors, evidences, predictions
    Compare {
        /// Run directories, two or more
        #[arg(required = true, num_args = 2.., value_name = "RUN")]
        runs: Vec<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// List the plugins that a study can name, with their options, defaults and references
    #[command(args_conflicts_with_subcommands = true)]
    Plugins {
        #[command(subcommand)]
        deed: Option<plugins::Deed>,
        /// A kind, such as `surrogate`, or one plugin, such as `surrogate.polynomial_chaos`
        name: Option<String>,
        /// Print Markdown
        #[arg(long)]
        markdown: bool,
        #[command(flatten)]
        libraries: plugins::Libraries,
    },
    /// Print the JSON Schema of the study language, for editors, or of `summary.json`, for scripts
    Schema {
        /// The file that the schema describes.
        #[arg(default_value = "study")]
        of: plugins::Described,
        #[command(flatten)]
        libraries: plugins::Libraries,
    },
    /// Show the contents of a file as a reader sees them: variables, axes, units, steps
    Inspect {
        /// File to inspect
        file: PathBuf,
        /// Show only this variable; with `--csv`, write its signals
        #[arg(long, value_name = "NAME")]
        variable: Option<String>,
        /// Write the variable's signals as CSV to this file, or to the terminal with `-`
        #[arg(long, value_name = "OUT", requires = "variable")]
        csv: Option<PathBuf>,
        /// Reader to use (default: the first that recognises the file)
        #[arg(long, value_name = "NAME")]
        reader: Option<String>,
        #[command(flatten)]
        libraries: plugins::Libraries,
    },
    /// Write a table, as CSV or Parquet: of a run directory the draws (chain, draw, unknowns, log density), of a study its
    /// measurements; or the emulator of a run as numbers, as netCDF
    Convert {
        /// Run directory, or study file
        source: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// Table to write, `.csv` or `.parquet`, or `-` for CSV on the terminal; `.nc` for the emulator
        out: PathBuf,
    },
    /// Serve a study's model, emulator and posterior over UM-Bridge, until Ctrl-C
    Serve {
        /// Study file
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// Run directory (default: `runs/<study name>`); emulator and posterior are those of its finished run
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        place: serve::Place,
    },
    /// Show runs in a browser on this machine, with the progress of unfinished ones, until Ctrl-C; nothing is written
    View {
        /// Run directory, or folder of run directories
        #[arg(default_value = "runs", value_name = "RUN|FOLDER")]
        folder: PathBuf,
        #[command(flatten)]
        place: view::Place,
    },
    /// Manage the simulation runs of a run directory: show their state, repeat failed ones, add more
    Campaign {
        #[command(subcommand)]
        what: campaign::Campaign,
    },
    /// Make runs or cases of an order; executors start this in other processes and on other machines
    #[command(hide = true)]
    Work(work::Work),
    /// Write the skeleton of a study or a plugin
    New {
        #[command(subcommand)]
        what: new::What,
    },
    /// Print the completions of a shell: `lacuna completions bash > ~/.local/share/bash-completion/completions/lacuna`
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page: `lacuna man | man -l -`
    Man,
}

/// Runs the command with these arguments, of which the first is its name, and returns its exit code: 0, 1 if a run stopped, 2
/// if the study or the arguments are wrong, 3 if the result is not trusted under `--strict`.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version go to standard output, with the code 0.
            terminal::note(error.print());
            let code = u8::try_from(error.exit_code()).unwrap_or(2);
            return if terminal::has_failed() { code.max(1) } else { code };
        }
    };
    if let Some(threads) = arguments.threads {
        // Only this line ever builds the pool, so it cannot fail because a pool already exists.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build_global();
    }
    if arguments.events {
        events::turn_on();
    }
    let code = match perform(arguments.verb) {
        Ok(()) if terminal::has_failed() => {
            terminal::tell("error: standard output could not be written in full");
            1
        }
        Ok(()) => 0,
        Err(error) => {
            let (text, code) = told(&error);
            let text = text.trim_end();
            if arguments.events {
                events::end(code, Some(text));
            }
            terminal::tell(text);
            return code;
        }
    };
    if arguments.events {
        events::end(code, None);
    }
    code
}

/// Executes a command.
fn perform(verb: Verb) -> anyhow::Result<()> {
    match verb {
        Verb::Run { study, settings, out, trust } => {
            study::run(&study, &settings, out.as_deref(), trust)
        }
        Verb::Check { study, settings } => study::check(&study, &settings),
        Verb::Gap { study, settings, out, manner, trust } => {
            gap::gap(&study, &settings, out.as_deref(), &manner, trust)
        }
        Verb::Power { study, settings, out, quick } => {
            gap::power(&study, &settings, out.as_deref(), quick)
        }
        Verb::Next { study, settings, out, by } => gap::next(&study, &settings, out.as_deref(), by),
        Verb::Coverage { study, settings, out, manner } => {
            coverage::coverage(&study, &settings, out.as_deref(), &manner)
        }
        Verb::Resume { run, trust } => study::resume(&run, trust),
        Verb::Report { run, trust } => study::report(&run, trust),
        Verb::Compare { runs, json } => study::compare(&runs, json),
        Verb::Plugins { deed: Some(deed), .. } => plugins::act(&deed),
        Verb::Plugins { deed: None, name, markdown, libraries } => {
            plugins::list(name.as_deref(), markdown, &libraries)
        }
        Verb::Schema { of, libraries } => plugins::schema(of, &libraries),
        Verb::Inspect { file, variable, csv, reader, libraries } => {
            let (reader, variable) = (reader.as_deref(), variable.as_deref());
            inspect::inspect(&file, reader, variable, csv.as_deref(), &libraries)
        }
        Verb::Convert { source, settings, out } => convert::convert(&source, &settings, &out),
        Verb::Serve { study, settings, out, place } => {
            serve::serve(&study, &settings, out.as_deref(), &place)
        }
        Verb::View { folder, place } => view::view(&folder, &place),
        Verb::Campaign { what } => campaign::campaign(&what),
        Verb::Work(asked) => work::run(&asked),
        Verb::New { what } => new::write(&what),
        Verb::Completions { shell } => manual::completions(shell),
        Verb::Man => manual::page(),
    }
}

/// Error: the study or the arguments are wrong; holds the complete text, as shown.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Misuse(String);

/// Error: the result is not trusted, under `--strict`.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Untrusted(String);

/// The error for a wrong study or wrong arguments.
fn misuse(text: impl Into<String>) -> anyhow::Error {
    Misuse(text.into()).into()
}

/// Text and exit code of a command that failed: 1 if a run stopped, 2 if the study or the arguments are wrong, 3 if the
/// result is not trusted.
fn told(error: &anyhow::Error) -> (String, u8) {
    if let Some(Misuse(text)) = error.downcast_ref() {
        return (text.clone(), 2);
    }
    (format!("error: {error:#}"), if error.is::<Untrusted>() { 3 } else { 1 })
}
