//! `gap`: where data and model disagree, what is missing, and the study that has it.

use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::path::Path;

use lacuna::gap::account::{Account, Addition};
use lacuna::gap::name::Word;
use lacuna::gap::power::Amount;
use lacuna::report::findings::{Findings, GapFindings};
use lacuna::report::{gap_text, power_text};
use lacuna::run::{RunDirectory, Stop};
use lacuna::stage;
use lacuna::stage::gap::add::{Begun, add};

use crate::progress::Terminal;
use crate::study::{Settings, Trust, folder, load, print_summary};
use crate::{Failure, print};

/// What is done with what was found.
#[derive(clap::Args)]
pub struct Manner {
    /// Report what is missing, and write and run nothing.
    #[arg(long, conflicts_with = "interactive")]
    dry_run: bool,
    /// Ask before an effect is added.
    #[arg(long)]
    interactive: bool,
}

/// `lacuna gap STUDY`
pub fn gap(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    manner: &Manner,
    trust: Trust,
) -> Result<(), Failure> {
    if manner.interactive && !std::io::stdin().is_terminal() {
        let text = "error: `--interactive` asks at a terminal, and there is none; `--dry-run` only reports";
        return Err(Failure::wrong(text));
    }
    let study = load(path, settings)?;
    let root = folder(&study, out);
    let mut run = RunDirectory::open(&root)?;
    let terminal = Terminal::new();
    let findings = stage::find_gap(&study, &mut run, &terminal)?;
    let report = |root: &Path| print(&format!("report: {}", root.join("report.html").display()));
    let gap = found(&findings)?;
    print("");
    print(&format!("before anything is added: {}", findings.assessment.line()));
    print("");
    print(gap_text(&findings).trim_end());
    print("");
    let wanted = wanted(&gap.account, manner)?;
    if wanted.additions.is_empty() {
        report(&root);
        return trust.demand(&findings.assessment);
    }
    let gap = GapFindings { account: wanted, ..gap.clone() };
    let set = settings.set();
    let begun =
        Begun { study: &study, path, folder: out, settings: &set, findings: &findings, gap: &gap };
    let (added, with) = add(&begun, &run, &terminal)?;
    // The report of the study tells what became of it.
    let findings = stage::find_gap(&study, &mut run, &terminal)?;
    print("");
    print_summary(&with);
    print("");
    print(gap_text(&findings).trim_end());
    print("");
    print(&format!("study with what was missing: {}", added.study.display()));
    report(&added.run);
    report(&root);
    trust.demand(&with.assessment)
}

/// `lacuna power STUDY`
pub fn power(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    quick: bool,
) -> Result<(), Failure> {
    let study = load(path, settings)?;
    let mut run = RunDirectory::open(&folder(&study, out))?;
    let (amount, simulations) =
        if quick { (Amount::quick(), Some(QUICK)) } else { (Amount::thorough(), None) };
    let rates = stage::power::power(&study, &amount, simulations, &mut run, &Terminal::new())?;
    print("");
    print(power_text(&rates).trim_end());
    Ok(())
}

/// Simulations of the nulls in a quick look.
const QUICK: usize = 99;

fn found(findings: &Findings) -> Result<&GapFindings, Stop> {
    findings.gap.as_ref().ok_or_else(|| Stop::new("the search found nothing to report"))
}

/// The account with the effects that are to be added; none where they are no name.
fn wanted(account: &Account, manner: &Manner) -> Result<Account, Failure> {
    let mut wanted = account.clone();
    if manner.dry_run || !matches!(account.verdict.word, Word::Named | Word::Class) {
        wanted.additions.clear();
    }
    if manner.interactive {
        let mut kept = Vec::new();
        for addition in wanted.additions {
            if is_wanted(&addition)? {
                kept.push(addition);
            } else if addition.model {
                // What was found with it was found with no other.
                break;
            }
        }
        wanted.additions = kept;
    }
    Ok(wanted)
}

fn is_wanted(addition: &Addition) -> Result<bool, Failure> {
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
