//! Sections of the page of a run on what is on disk before it ends.

use maud::{Markup, html};

use super::{ago, facts};
use crate::campaign::{Row, State};
use crate::page::chart::{Key, traces};
use crate::page::number::{count, duration, fixed, significant};
use crate::page::table::Table;
use crate::page::{drawn, legend, paragraph};
use crate::view::campaign::CampaignTable;
use crate::view::gap::{GapProgress, GapState};
use crate::view::sampling::Sampling;
use crate::view::watched::StageRow;

/// Largest number of runs that are listed one by one.
const MOST_RUNS: usize = 50;

/// The chains so far.
pub fn sampling(found: &Sampling) -> Markup {
    let diagnosed = found.coordinates.iter().any(|c| c.r_hat.is_finite());
    let about = [
        ("chains", count(found.chains)),
        ("steps of each", format!("{} of {}", count(found.steps), count(found.planned))),
        ("burn-in so far", count(found.burn_in)),
        ("evaluations of the density", count(found.evaluations as usize)),
    ];
    let keys = [
        Key::line("s-walker", "chain"),
        Key::area("burn-in", "burn-in"),
        Key::line("s-density", "density of the draws so far"),
    ];
    let drawings =
        traces(&found.traces, found.steps.saturating_sub(1), "traces of the draws so far");
    html! {
        section #sampling {
            h2 { "Sampling" }
            (facts(&about))
            @if diagnosed {
                p.verdict.good[found.meets] {
                    b { @if found.meets { "The thresholds are met." } @else { "The thresholds are not met yet." } }
                    " R-hat should be at most " (found.criteria.r_hat) " and the effective sample sizes at least "
                    (found.criteria.ess) "."
                }
                (diagnosis(found).html())
                @if found.every > 1 {
                    p.note {
                        "One step in " (found.every) " is read. The effective sample sizes are those of these steps; those of "
                        "all steps are larger."
                    }
                }
            } @else if found.steps_are_draws {
                p { "There are too few steps after the burn-in for a diagnosis." }
            } @else {
                p { "The steps of this sampler are no draws: the draws are made at its end." }
            }
            @if found.steps > 0 {
                figure.drawn {
                    (legend(&keys))
                    (drawn(&drawings))
                    figcaption { "Chains up to the last checkpoint, which is written every two seconds." }
                }
            }
        }
    }
}

fn diagnosis(found: &Sampling) -> Table {
    let heads = ["mean", "sd", "R-hat", "ESS bulk", "ESS tail"];
    let mut table = Table::new(&["unknown", "unit"], &heads);
    for c in &found.coordinates {
        let digits = (c.mean.abs() / c.sd).log10().floor().clamp(0.0, 12.0) as usize + 3;
        let figures = [significant(c.mean, digits), significant(c.sd, 3), fixed(c.r_hat, 3)];
        let sizes = [fixed(c.ess_bulk, 0), fixed(c.ess_tail, 0)];
        let words = [c.name.clone(), c.unit.to_string()];
        table.row(words.into_iter().chain(figures).chain(sizes));
    }
    table
}

/// The simulation runs.
pub fn campaign(found: &CampaignTable) -> Markup {
    let heads: Vec<&str> =
        ["runs"].into_iter().chain(State::ALL.map(State::name)).chain(["mean time"]).collect();
    let mut table = Table::new(&["stage", "scenario"], &heads);
    for group in &found.counts {
        let numbers = [group.runs].into_iter().chain(group.states).map(count);
        let mean = group.mean_seconds.map(duration).unwrap_or_default();
        let words = [group.stage.clone(), group.scenario.clone()];
        table.row(words.into_iter().chain(numbers).chain([mean]));
    }
    let mut open = Table::new(&["run", "stage", "scenario", "state", "reason"], &[]);
    for row in found.open.iter().take(MOST_RUNS) {
        let Row { stage, scenario, run, state, note, .. } = row;
        let note = note.replace('\n', "; ");
        open.row([run.clone(), stage.clone(), scenario.clone(), state.name().to_owned(), note]);
    }
    html! {
        section #campaign {
            h2 { "Simulation runs" }
            @for text in &found.warnings { p { (paragraph(text)) } }
            (table.html())
            @if !open.is_empty() {
                details #open-runs {
                    summary { (count(found.open.len())) " runs are not done" }
                    @if found.open.len() > MOST_RUNS { p.note { "The first " (MOST_RUNS) " of them." } }
                    (open.html())
                }
            }
        }
    }
}

/// The gap search.
pub fn gap(found: &GapProgress) -> Markup {
    let words = match (found.state, &found.verdict) {
        (_, Some(verdict)) => verdict.clone(),
        (GapState::Searching, None) => {
            format!("The search goes on; it began {}.", ago(found.begun))
        }
        (_, None) => "The search was interrupted.".to_owned(),
    };
    html! {
        section #gap {
            h2 { "Missing physics" }
            p { (paragraph(&words)) }
            @if !found.reasons.is_empty() { ul { @for text in &found.reasons { li { (paragraph(text)) } } } }
            @if !found.parts.is_empty() {
                ul { @for (folder, finished) in &found.parts {
                    li { code { (folder) } @if *finished { ": finished" } @else { ": not finished" } }
                } }
            }
        }
    }
}

/// The stages.
pub fn stages(stages: &[StageRow]) -> Markup {
    let mut table = Table::new(&["stage", "state", "made by"], &["time"]);
    for stage in stages {
        let state = if stage.finished { "finished" } else { "not finished" };
        let time = stage.seconds.map(duration).unwrap_or_default();
        let by = stage.lacuna.as_ref().map(|version| format!("lacuna {version}"));
        table.row([stage.folder.clone(), state.to_owned(), by.unwrap_or_default(), time]);
    }
    html! {
        section #stages {
            h2 { "Stages" }
            @if table.is_empty() { p { "No stage has begun." } } @else { (table.html()) }
        }
    }
}
