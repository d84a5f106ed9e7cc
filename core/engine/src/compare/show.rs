//! A comparison as tables, and as text for a terminal.

use serde_json::Value;

use super::{Comparison, Entry, Mixed, Spread};
use crate::page::number::{percent, significant};
use crate::page::table::Table;

/// Tables of a comparison with their titles, with one column per run; empty ones are left out.
pub fn tables(comparison: &Comparison) -> Vec<(&'static str, Table)> {
    let names = &names(comparison);
    let all = [
        ("posterior: mean ± standard deviation", posterior(comparison, names)),
        ("standard deviation of a new replicate by origin", spread(comparison, names)),
        ("surrogate and fit", errors(comparison, names)),
        ("evidence and prediction", weights(comparison, names)),
        ("quantities predicted by the mixture of the studies", mixed(comparison)),
        ("time", times(comparison, names)),
    ];
    all.into_iter().filter(|(_, table)| !table.is_empty()).collect()
}

/// Tables of a comparison as text, below the names of their columns.
pub fn text(comparison: &Comparison) -> String {
    let mut parts = vec![legend(comparison, &names(comparison))];
    let tables = tables(comparison).into_iter();
    parts.extend(tables.map(|(title, table)| format!("{title}\n{}", table.text())));
    parts.extend(comparison.notes.iter().map(|note| format!("note: {note}\n")));
    parts.join("\n")
}

/// Heads of the columns of the runs.
pub fn names(comparison: &Comparison) -> Vec<String> {
    (1..=comparison.runs.len()).map(|i| format!("({i})")).collect()
}

fn legend(comparison: &Comparison, names: &[String]) -> String {
    let line = |(name, run): (&String, &Entry)| {
        let state = if run.converged { "" } else { "   NOT CONVERGED" };
        let components: Vec<String> = run
            .components
            .as_object()
            .into_iter()
            .flatten()
            .filter(|(kind, _)| ["surrogate", "discrepancy", "sampler"].contains(&kind.as_str()))
            .filter_map(|(_, plugin)| plugin.as_str().map(str::to_owned))
            .collect();
        format!("{name} {}: {}   [{}]{state}\n", run.directory, run.study, components.join(", "))
    };
    names.iter().zip(&comparison.runs).map(line).collect()
}

fn table(first: &str, names: &[String]) -> Table {
    let heads: Vec<&str> = names.iter().map(String::as_str).collect();
    Table::new(&[first, "unit"], &heads)
}

/// Keys of a part of all runs, in the order of their first appearance.
fn keys<'a>(runs: &'a [Entry], part: impl Fn(&'a Entry) -> &'a Value) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for name in runs.iter().filter_map(|run| part(run).as_object()).flat_map(|map| map.keys()) {
        if !found.contains(&name.as_str()) {
            found.push(name);
        }
    }
    found
}

fn row(
    table: &mut Table,
    name: &str,
    unit: &str,
    runs: &[Entry],
    cell: impl Fn(&Entry) -> Option<String>,
) {
    let cells: Vec<String> = runs.iter().map(|run| cell(run).unwrap_or_default()).collect();
    if cells.iter().any(|cell| !cell.is_empty()) {
        table.row([name.to_owned(), unit.to_owned()].into_iter().chain(cells));
    }
}

fn with_error(value: f64, error: f64) -> String {
    if error > 0.0 && error.is_finite() {
        let digits = (value.abs() / error).log10().floor().max(0.0) as usize + 2;
        return format!("{} ± {}", significant(value, digits), significant(error, 2));
    }
    significant(value, 6)
}

fn posterior(comparison: &Comparison, names: &[String]) -> Table {
    let runs = &comparison.runs;
    let mut table = table("parameter", names);
    for name in keys(runs, |run| &run.parameters) {
        let number = |run: &Entry, key: &str| run.parameters.get(name)?.get(key)?.as_f64();
        let unit = runs
            .iter()
            .find_map(|run| run.parameters.get(name)?.get("unit")?.as_str())
            .unwrap_or_default();
        row(&mut table, name, unit, runs, |run| {
            Some(with_error(number(run, "mean")?, number(run, "sd")?))
        });
    }
    table
}

fn spread(comparison: &Comparison, names: &[String]) -> Table {
    let runs = &comparison.runs;
    let mut table = table("origin", names);
    let unit = unit(runs);
    for origin in keys(runs, |run| &run.spread) {
        row(&mut table, origin, unit, runs, |run| {
            Some(significant(run.spread.get(origin)?.as_f64()?, 3))
        });
    }
    table
}

fn unit(runs: &[Entry]) -> &str {
    let of = |run: &'_ Entry| run.surrogate.get("unit").and_then(Value::as_str).map(str::to_owned);
    let first = runs.iter().position(|run| of(run).is_some());
    first.and_then(|i| runs[i].surrogate.get("unit")?.as_str()).unwrap_or_default()
}

fn errors(comparison: &Comparison, names: &[String]) -> Table {
    let runs = &comparison.runs;
    let mut table = table("error", names);
    let unit = unit(runs);
    for (name, key, unit) in [
        ("surrogate, root mean square at validation runs", "rmse", unit),
        ("surrogate, leave-one-out", "loo", ""),
        ("surrogate at posterior draws", "near_posterior", unit),
    ] {
        row(&mut table, name, unit, runs, |run| {
            Some(significant(run.surrogate.get(key)?.as_f64()?, 3))
        });
    }
    row(&mut table, "accuracy at the MAP", "", runs, |run| run.accuracy.map(percent));
    table
}

fn weights(comparison: &Comparison, names: &[String]) -> Table {
    let runs = &comparison.runs;
    let mut table = table("measure", names);
    let pair = |pair: Option<[f64; 2]>| pair.map(|[value, error]| with_error(value, error));
    row(&mut table, "log evidence", "", runs, |run| pair(run.evidence));
    row(&mut table, "below the best (log Bayes factor)", "", runs, |run| pair(run.evidence_behind));
    row(&mut table, "probability (equal priors)", "", runs, |run| run.probability.map(percent));
    row(&mut table, "elpd_loo (PSIS-LOO)", "", runs, |run| pair(run.loo));
    row(&mut table, "below the best", "", runs, |run| pair(run.loo_behind));
    row(&mut table, "data with unreliable k-hat", "", runs, |run| {
        run.loo_unreliable.map(|count| format!("{count}"))
    });
    row(&mut table, "weight by stacking", "", runs, |run| run.stacking.map(percent));
    row(&mut table, "weight by pseudo-BMA+", "", runs, |run| run.pseudo_bma.map(percent));
    if runs.iter().any(|run| run.curves.is_some()) {
        row(&mut table, "elpd_loo of whole curves", "", runs, |run| pair(run.curves));
        row(&mut table, "below the best", "", runs, |run| pair(run.curves_behind));
        row(&mut table, "curves with unreliable k-hat", "", runs, |run| {
            run.curves_unreliable.map(|count| format!("{count}"))
        });
    }
    table
}

/// Quantities of the mixture: mean and 95 % interval with each kind of weights.
fn mixed(comparison: &Comparison) -> Table {
    type Of = fn(&Mixed) -> Option<Spread>;
    let kinds: [(&str, Of); 3] = [
        ("by stacking", |mixed| mixed.stacking),
        ("by pseudo-BMA+", |mixed| mixed.pseudo_bma),
        ("by probability", |mixed| mixed.probability),
    ];
    let there =
        kinds.into_iter().filter(|(_, of)| comparison.mixed.iter().any(|m| of(m).is_some()));
    let (heads, of): (Vec<&str>, Vec<Of>) = there.unzip();
    let mut table = Table::new(&["quantity", "unit"], &heads);
    for quantity in &comparison.mixed {
        let cell = |of: &Of| of(quantity).as_ref().map_or_else(String::new, interval);
        let start = [quantity.name.clone(), quantity.unit.clone()];
        table.row(start.into_iter().chain(of.iter().map(cell)));
    }
    table
}

fn interval(spread: &Spread) -> String {
    let size = (spread.q975 - spread.q025).abs();
    let digits = |value: f64| (value.abs() / size).log10().floor().max(0.0) as usize + 3;
    let [mean, low, high] =
        [spread.mean, spread.q025, spread.q975].map(|x| significant(x, digits(x)));
    format!("{mean} ({low} to {high})")
}

/// Times of the stages that a choice of components changes.
fn times(comparison: &Comparison, names: &[String]) -> Table {
    let mut table = table("stage", names);
    for stage in ["surrogate", "calibrate", "evidence"] {
        row(&mut table, stage, "s", &comparison.runs, |run| {
            Some(significant(run.seconds.get(stage)?.as_f64()?, 2))
        });
    }
    table
}
