//! Coverage of a study's intervals: text for the terminal, and a page.

mod drawing;
mod page;

use lacuna::diagnose::coverage::{Coverage, EDGE, LEVELS, Noise, Rate, Row, Side, Source, Tally};

use crate::page::number::{fixed, percent};
use crate::page::table::Table;

pub use page::coverage_page;

/// The counts for the terminal, the verdict first.
pub fn coverage_text(found: &Coverage) -> String {
    let mut parts = vec![format!("{}\n", verdict(found))];
    parts.push(format!("{}\n", said(found).join("\n")));
    parts.push(intervals(&found.tally).text());
    parts.push(places(&found.tally).text());
    parts.push(shapes(&found.tally).text());
    parts.join("\n")
}

/// The verdict as a line.
fn verdict(found: &Coverage) -> String {
    format!("Coverage: {}.", found.tally.verdict.text)
}

/// Sentences on how the counts were made and on their limits.
fn said(found: &Coverage) -> Vec<String> {
    let tally = &found.tally;
    let source = match found.source {
        Source::Model => "drawn from the prior, responses of the model",
        Source::FinerModel => {
            "drawn from the prior, responses of the finer model, extrapolated as `[numerical_error]` says"
        }
        Source::HeldBack => "simulation runs that were held back from the emulator",
    };
    let noise = match found.noise {
        Noise::Replicates => "noise: residuals of the study's replicates, each with a random sign",
        Noise::Posterior => "noise: the discrepancy at draws of the study's own posterior",
        Noise::Prior => "noise: the discrepancy with unknowns drawn from their priors",
    };
    let mut all = vec![format!("{} truths, {source}; {noise}.", tally.truths)];
    all.push(format!("{} calibrated, {} of them converged.", tally.calibrated, tally.converged));
    let times = |(reason, count): &(String, usize)| format!("{count} times: {reason}");
    if !tally.failed.is_empty() {
        let reasons: Vec<String> = tally.failed.iter().map(times).collect();
        all.push(format!("Calibrations that failed and are in no count: {}.", reasons.join("; ")));
    }
    if !tally.without_data.is_empty() {
        let reasons: Vec<String> = tally.without_data.iter().map(times).collect();
        all.push(format!("Truths without data: {}.", reasons.join("; ")));
    }
    if let Some(ratio) = found.noise_ratio.filter(|ratio| !(0.67..1.5).contains(ratio)) {
        all.push(format!(
            "Replicates scatter by {} of what they do in the study's own data: the coverage is that of the noise which the study states, not of the one which it has.",
            fixed(ratio, 2)
        ));
    }
    if let Some(row) = &tally.overall_converged {
        let shares: Vec<String> = row.levels.iter().map(level).collect();
        all.push(format!("Of the converged calibrations alone: {}.", shares.join(", ")));
    }
    let correlated = tally.rows.iter().map(|row| row.correlated).max().unwrap_or(0);
    if correlated > 0 {
        all.push(format!(
            "In {correlated} cases the draws are worth fewer than the 99 independent ones that a rank needs."
        ));
    }
    all.extend(found.notes.iter().map(|note| {
        let mut letters = note.chars();
        let first = letters.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
        format!("{first}{}.", letters.as_str())
    }));
    all
}

fn level(rate: &Rate) -> String {
    format!("{} of the {:.0} % intervals", percent(rate.share), 100.0 * rate.nominal)
}

fn rows(tally: &Tally) -> impl Iterator<Item = (&Row, bool)> {
    tally.rows.iter().map(|row| (row, false)).chain(tally.overall.iter().map(|row| (row, true)))
}

fn name(row: &Row) -> String {
    let not = if row.of_prior { "" } else { " (not of its prior)" };
    format!("{}{not}", row.name)
}

fn share(rate: &Rate) -> String {
    if rate.of == 0 {
        return "none".to_owned();
    }
    let mark = match rate.side {
        Side::Below => " low",
        Side::Above => " high",
        Side::Within => "",
    };
    let [low, high] = rate.interval.map(|end| fixed(100.0 * end, 1));
    format!("{} ({low} to {high}){mark}", fixed(100.0 * rate.share, 1))
}

/// Table of the shares of intervals that contain the truth, in percent.
fn intervals(tally: &Tally) -> Table {
    let heads = LEVELS.map(|level| format!("{:.0} % holds, in %", 100.0 * level));
    let mut table = Table::new(&["unknown"], &heads.iter().map(String::as_str).collect::<Vec<_>>());
    for (row, all) in rows(tally) {
        let judged = |rate: &Rate| {
            let text = share(rate);
            // Truths that are not drawn from the prior have no nominal coverage, so the share is not marked as low or
            // high.
            if row.of_prior {
                text
            } else {
                text.trim_end_matches(" low").trim_end_matches(" high").to_owned()
            }
        };
        let cells =
            std::iter::once(name(row)).chain(row.levels.iter().map(judged)).collect::<Vec<_>>();
        if all { table.emphasised(cells) } else { table.row(cells) }
    }
    table
}

/// Table of the coverage of 95 % intervals for truths near the edge of the prior and elsewhere.
fn places(tally: &Tally) -> Table {
    let heads = ["95 % at an edge", "expected", "of", "95 % elsewhere", "expected ", "of "];
    let mut table = Table::new(&["unknown"], &heads);
    for (row, all) in rows(tally).filter(|(row, _)| row.of_prior) {
        let of = |rate: &Rate| {
            let expected =
                if rate.of > 0 { fixed(100.0 * rate.expected, 1) } else { String::new() };
            [share(rate), expected, rate.of.to_string()]
        };
        let last = LEVELS.len() - 1;
        let cells = [of(&row.edge[last]), of(&row.centre[last])].concat();
        let cells = std::iter::once(name(row)).chain(cells).collect::<Vec<_>>();
        if all { table.emphasised(cells) } else { table.row(cells) }
    }
    table
}

/// Table of interval widths, errors and ranks.
fn shapes(tally: &Tally) -> Table {
    let heads = ["posterior sd / prior sd", "(5 to 95 %)", "mean z", "sd of z", "largest z"];
    let mut table = Table::new(&["unknown", "ranks"], &heads);
    for (row, all) in rows(tally) {
        let uniform = match row.uniform {
            Some(true) => "uniform",
            Some(false) => "not uniform",
            None => "",
        };
        let [low, middle, high] = row.shrinkage.map(|s| fixed(s, 3));
        let [mean, sd, largest] = row.z.map(|z| fixed(z, 2));
        let range = format!("{low} to {high}");
        let cells = [name(row), uniform.to_owned(), middle, range, mean, sd, largest];
        if all { table.emphasised(cells) } else { table.row(cells) }
    }
    table
}

/// The definition of an edge, in a sentence.
fn edge() -> String {
    format!(
        "A truth is at an edge where the prior gives less than {} to what is below it, or above it: for a uniform prior, within a tenth of its width of a bound",
        percent(EDGE)
    )
}
