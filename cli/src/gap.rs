//! Commands `gap`, `power` and `next`: where data and model disagree, which physics is missing, and the study that includes it.

use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::path::Path;

use lacuna::run::Stop;
use lacuna_engine::augment::{Begun, add};
use lacuna_engine::gap::next::Wanted;
use lacuna_engine::gap::power::PowerDesign;
use lacuna_engine::gap::result::{AddedEffect, GapResult};
use lacuna_engine::pipeline;
use lacuna_engine::report::findings::{Findings, GapFindings};
use lacuna_engine::report::{gap_text, next_text, power_text};
use lacuna_run::RunDirectory;

use crate::interrupt::{self, Next};
use crate::study::{Settings, Trust, folder, load, print_summary, report_of};
use crate::{misuse, print, progress, show};

/// Treatment of the effects that were found.
#[derive(clap::Args)]
pub struct Manner {
    /// Report what is missing without writing or running anything
    #[arg(long, conflicts_with = "interactive")]
    dry_run: bool,
    /// Ask before each effect is added
    #[arg(long)]
    interactive: bool,
}

/// Runs `lacuna gap STUDY`.
pub fn gap(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    manner: &Manner,
    trust: Trust,
) -> anyhow::Result<()> {
    if manner.interactive && !std::io::stdin().is_terminal() {
        let text = "error: `--interactive` asks at a terminal, and there is none; `--dry-run` only reports";
        return Err(misuse(text));
    }
    let study = load(path, settings)?;
    let root = folder(&study, out);
    let mut run = RunDirectory::open(&root)?;
    interrupt::explain(&root, Next::Again);
    let observer = progress::observer();
    let findings = pipeline::find_gap(&study, &mut run, &*observer)?;
    let gap = found(&findings)?;
    print("");
    print(&format!("before anything is added: {}", findings.assessment.line()));
    print("");
    show(gap_text(&findings).trim_end());
    print("");
    let wanted = wanted(&gap.result, manner)?;
    if wanted.additions.is_empty() {
        report_of(&root);
        return trust.demand(&findings.assessment);
    }
    let gap = GapFindings { result: wanted, ..gap.clone() };
    let set = settings.set();
    let begun =
        Begun { study: &study, path, folder: out, settings: &set, findings: &findings, gap: &gap };
    let (added, with) = add(&begun, &run, &*observer)?;
    // The gap stage is repeated because the report of the study shows whether the added effects helped.
    let findings = pipeline::find_gap(&study, &mut run, &*observer)?;
    print("");
    print_summary(&with);
    print("");
    show(gap_text(&findings).trim_end());
    print("");
    print(&format!("study with the added effects: {}", added.study.display()));
    report_of(&added.run);
    report_of(&root);
    trust.demand(&with.assessment)
}

/// Runs `lacuna power STUDY`.
pub fn power(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    quick: bool,
) -> anyhow::Result<()> {
    let study = load(path, settings)?;
    let root = folder(&study, out);
    let mut run = RunDirectory::open(&root)?;
    interrupt::explain(&root, Next::Again);
    let (design, simulations) =
        if quick { (PowerDesign::quick(), Some(QUICK)) } else { (PowerDesign::thorough(), None) };
    let rates = pipeline::power(&study, &design, simulations, &mut run, &*progress::observer())?;
    print("");
    show(power_text(&rates).trim_end());
    Ok(())
}

/// Purpose of the next data.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub enum By {
    /// The name of what is missing
    Name,
    /// The parameters of the model
    Parameters,
    /// The quantity of `[gap.quantity]`
    Quantity,
}

impl By {
    fn wanted(self) -> Wanted {
        match self {
            Self::Name => Wanted::Name,
            Self::Parameters => Wanted::Parameters,
            Self::Quantity => Wanted::Quantity,
        }
    }
}

/// Runs `lacuna next STUDY`.
pub fn next(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    by: Option<By>,
) -> anyhow::Result<()> {
    let study = load(path, settings)?;
    let root = folder(&study, out);
    let mut run = RunDirectory::open(&root)?;
    interrupt::explain(&root, Next::Again);
    let findings = pipeline::find_gap(&study, &mut run, &*progress::observer())?;
    found(&findings)?;
    let stop = || Stop::new("the information of further data has no finite value");
    let text = next_text(&findings, by.map(By::wanted)).ok_or_else(stop)??;
    print("");
    show(text.trim_end());
    Ok(())
}

/// Number of simulations of each null distribution in a quick look.
const QUICK: usize = 99;

fn found(findings: &Findings) -> Result<&GapFindings, Stop> {
    findings.gap.as_ref().ok_or_else(|| Stop::new("the search found nothing to report"))
}

/// The result with the effects to be added; none if they have no name.
fn wanted(result: &GapResult, manner: &Manner) -> anyhow::Result<GapResult> {
    let mut wanted = result.clone();
    wanted.additions = if manner.dry_run { Vec::new() } else { result.worth_adding() };
    if manner.interactive {
        let mut kept = Vec::new();
        for addition in wanted.additions {
            if is_wanted(&addition)? {
                kept.push(addition);
            } else if addition.model {
                // Later effects were found in the presence of this one and have no support without it.
                break;
            }
        }
        wanted.additions = kept;
    }
    Ok(wanted)
}

fn is_wanted(addition: &AddedEffect) -> anyhow::Result<bool> {
    let places: Vec<String> = addition.on.values().map(|labels| labels.join(", ")).collect();
    let on = if places.is_empty() { String::new() } else { format!(" on {}", places.join("; ")) };
    let mut out = std::io::stderr();
    let _ = if addition.model {
        write!(out, "put {}? [y/N] ", addition.title)
    } else {
        write!(out, "add `{}`{on} ({})? [y/N] ", addition.name, addition.title)
    };
    let _ = out.flush();
    let mut answer = String::new();
    std::io::stdin()
        .lock()
        .read_line(&mut answer)
        .map_err(|error| Stop::new(format!("no answer could be read: {error}")))?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}
