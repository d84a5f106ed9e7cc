//! The `lacuna` command: arguments and printing, no numerics.

mod campaign;
mod coverage;
mod gap;
mod inspect;
mod new;
mod plugins;
mod progress;
mod serve;
mod study;
#[cfg(test)]
mod tests;
mod work;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
// The plugins register themselves; naming their crate links it.
use lacuna_plugins as _;

/// Lacuna closes the gap between simulation and measurement.
///
/// A study is one TOML file that names a model, a design, a surrogate, a discrepancy and a sampler. Lacuna
/// trains the surrogate on simulation runs, infers the model's parameters with their uncertainty,
/// validates, and writes a report.
#[derive(Parser)]
#[command(version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
    /// Number of threads; all cores when left out. It changes the time and nothing else.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<std::num::NonZeroUsize>,
}

#[derive(Subcommand)]
enum Verb {
    /// Run all stages of a study and write its report.
    Run {
        /// The study file.
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// The run directory; `runs/<study name>` when left out.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Check a study and list every problem at once, with line and caret.
    Check {
        /// The study file.
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
    },
    /// Find what a study's model misses, write the study that has it, and show whether the gap shrank.
    Gap {
        /// The study file.
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// The run directory; `runs/<study name>` when left out. The study with the effects runs beside it.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        manner: gap::Manner,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Plant every effect in a study's own noise: what `lacuna gap` would find there, how small, and how often it errs.
    Power {
        /// The study file.
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// The run directory; `runs/<study name>` when left out.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Fewer cases and simulations, for a first look.
        #[arg(long)]
        quick: bool,
    },
    /// Count how often a study's intervals hold the truth: truths from the prior, data made of them, each calibrated.
    Coverage {
        /// The study file.
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// The run directory; `runs/<study name>` when left out.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        manner: coverage::Manner,
    },
    /// Go on with a run that was interrupted, from its directory.
    Resume {
        /// The run directory.
        run: PathBuf,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Write the report of a finished run again.
    Report {
        /// The run directory.
        run: PathBuf,
        #[command(flatten)]
        trust: study::Trust,
    },
    /// Put finished runs side by side: posteriors, errors, evidences, predictions.
    Compare {
        /// The run directories, two or more.
        #[arg(required = true, num_args = 2.., value_name = "RUN")]
        runs: Vec<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// List the plugins that a study can name, with their options, defaults and references.
    Plugins {
        /// A kind, such as `surrogate`, or one plugin, such as `surrogate.polynomial_chaos`.
        name: Option<String>,
        /// Print Markdown.
        #[arg(long)]
        markdown: bool,
        #[command(flatten)]
        libraries: study::Libraries,
    },
    /// Print the JSON Schema of the study language, for editors.
    Schema {
        #[command(flatten)]
        libraries: study::Libraries,
    },
    /// Show what a reader sees in a file: variables, axes, units, steps.
    Inspect {
        /// The file.
        file: PathBuf,
        /// Show this variable alone; with `--csv`, write its signals.
        #[arg(long, value_name = "NAME")]
        variable: Option<String>,
        /// Write the variable's signals as CSV to this file, or to the terminal with `-`.
        #[arg(long, value_name = "OUT", requires = "variable")]
        csv: Option<PathBuf>,
        /// The reader to use; the first that recognises the file when left out.
        #[arg(long, value_name = "NAME")]
        reader: Option<String>,
        #[command(flatten)]
        libraries: study::Libraries,
    },
    /// Serve a study's model, emulator and posterior over UM-Bridge, until Ctrl-C.
    Serve {
        /// The study file.
        study: PathBuf,
        #[command(flatten)]
        settings: study::Settings,
        /// The run directory; `runs/<study name>` when left out. Emulator and posterior are those of its finished run.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        place: serve::Place,
    },
    /// The simulation runs of a run directory: where they are, those that failed again, more of them.
    Campaign {
        #[command(subcommand)]
        what: campaign::Campaign,
    },
    /// Make runs of an order: what executors start in other processes and on other machines.
    #[command(hide = true)]
    Work(work::Work),
    /// Write the skeleton of something new.
    New {
        #[command(subcommand)]
        what: new::What,
    },
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Some(threads) = arguments.threads {
        // Only this line ever builds the pool, so that it cannot be there already.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global();
    }
    let result = match arguments.verb {
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
        Verb::Coverage { study, settings, out, manner } => {
            coverage::coverage(&study, &settings, out.as_deref(), &manner)
        }
        Verb::Resume { run, trust } => study::resume(&run, trust),
        Verb::Report { run, trust } => study::report(&run, trust),
        Verb::Compare { runs, json } => study::compare(&runs, json),
        Verb::Plugins { name, markdown, libraries } => {
            plugins::list(name.as_deref(), markdown, &libraries)
        }
        Verb::Schema { libraries } => plugins::schema(&libraries),
        Verb::Inspect { file, variable, csv, reader, libraries } => {
            let (reader, variable) = (reader.as_deref(), variable.as_deref());
            inspect::inspect(&file, reader, variable, csv.as_deref(), &libraries)
        }
        Verb::Serve { study, settings, out, place } => {
            serve::serve(&study, &settings, out.as_deref(), &place)
        }
        Verb::Campaign { what } => campaign::campaign(&what),
        Verb::Work(asked) => work::run(&asked),
        Verb::New { what } => new::write(&what),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{}", failure.text.trim_end());
            ExitCode::from(failure.code)
        }
    }
}

/// A command that did not do what it was asked.
struct Failure {
    text: String,
    /// 1: a run stopped; 2: the study or the arguments are wrong; 3: the result is not trusted, under `--strict`.
    code: u8,
}

impl From<lacuna::run::Stop> for Failure {
    fn from(stop: lacuna::run::Stop) -> Self {
        Self { text: format!("error: {stop}"), code: 1 }
    }
}

impl Failure {
    fn wrong(text: impl Into<String>) -> Self {
        Self { text: text.into(), code: 2 }
    }
}

/// Prints a line; a reader that stopped reading (a closed pipe) is no error.
fn print(text: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stdout(), "{text}");
}
