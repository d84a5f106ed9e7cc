//! Diagnostics of the sampler: acceptance rates and traces.

use lacuna::plugin::Fact;
use maud::{Markup, html};

use super::{coordinate_unit, energy, fact_list, first_of, mixing, titled};
use crate::page::chart::{Axis, BarChart, BarSeries, Key, Level, Mark, Trace, traces};
use crate::page::number::{count, percent, significant};
use crate::page::scale::ShownUnit;
use crate::page::{Caption, Numbers, Section, paragraph};
use crate::report::findings::{CalibrationFindings, CoordinateFindings, Findings};

/// Approximate total number of points of all traces.
const MOST_POINTS: usize = 24_000;

/// Approximate number of chains that are drawn.
const MOST_CHAINS: usize = 100;

/// Largest number of coordinates with a trace.
const MOST_ROWS: usize = 16;

/// Approximate number of draws of a histogram or a density: more draws change no pixel.
const MOST_DRAWS: usize = 200_000;

/// The sampler; `None` without a calibration.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let calibration = findings.calibration.as_ref()?;
    let content = html! {
        p.verdict.good[calibration.converged] {
            b { @if calibration.converged { "Converged" } @else { "Not converged" } }
            @if calibration.verdict != "converged" {
                @if calibration.converged { "; note: " } @else { ": " }
                (paragraph(calibration.verdict.trim_end_matches('.')))
            }
            "."
        }
        (fact_list(&facts(calibration)))
        @if !calibration.acceptance.is_empty() { (acceptance(calibration, numbers)) }
        @if !calibration.draws.is_empty() { (walkers(calibration, numbers)) }
        (mixing::figures(calibration, numbers))
        @if let Some(energies) = &calibration.energies { (energy::figure(energies, numbers)) }
    };
    Some(Section { id: "sampling", title: "Sampling", content })
}

fn facts(calibration: &CalibrationFindings) -> Vec<Fact> {
    let kept = calibration.steps.saturating_sub(calibration.burn_in);
    let mut facts = vec![
        Fact::new("chains", count(calibration.chains)),
        Fact::new("steps of each", count(calibration.steps)),
        Fact::new("left out as burn-in", count(calibration.burn_in)),
        Fact::new("draws kept", count(kept * calibration.chains)),
        Fact::new("log density at the MAP", significant(calibration.log_density.0, 8)),
        Fact::new("log density of the best draw", significant(calibration.log_density.1, 8)),
    ];
    facts.extend(calibration.facts.iter().cloned());
    facts
}

fn acceptance(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let shares = &calibration.acceptance;
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    let highest = shares.iter().copied().filter(|v| v.is_finite()).fold(0.5, f64::max);
    let chart = BarChart {
        names: (1..=shares.len()).map(|i| i.to_string()).collect(),
        series: vec![BarSeries {
            class: "s-acceptance",
            name: String::from("chain"),
            values: shares.clone(),
        }],
        levels: vec![Level {
            class: "m-mean",
            label: format!("mean {}", percent(mean)),
            value: mean,
        }],
        x_label: String::from("chain [number]"),
        y: Axis::new("accepted moves [share]", (0.0, (1.15 * highest).min(1.0))),
        outstanding: calibration.stranded.clone(),
        numbers: false,
    };
    let mut keys = vec![Key::area("s-acceptance", "chain")];
    if !calibration.stranded.is_empty() {
        keys.push(Key::area("outstanding", "chain stranded far below the bulk of the density"));
    }
    let caption = Caption::new(
        "Share of accepted moves of every chain.",
        "none: each bar is one chain.",
        "chains that hardly move. For ensembles of walkers 0.2 to 0.5 is usual.",
    );
    numbers.figure(
        "acceptance",
        &[chart.draw("share of accepted moves of every chain")],
        &keys,
        &caption,
    )
}

fn walkers(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let chains = drawn_chains(calibration);
    let all = calibration.coordinates.len();
    let points = calibration.steps * chains.len() * all.min(MOST_ROWS);
    let stride = points.div_ceil(MOST_POINTS).max(1);
    let steps: Vec<usize> = (0..calibration.steps).step_by(stride).collect();
    let rows: Vec<Trace> =
        (0..all.min(MOST_ROWS)).map(|i| trace(calibration, i, &chains, &steps)).collect();
    let last = calibration.steps.saturating_sub(1);
    let drawing = traces(&rows, last, "traces of all chains with the density of the kept draws");
    let mut keys = vec![
        Key::line("s-walker", "chain"),
        Key::area("burn-in", "burn-in"),
        Key::line("s-density", "density of the kept draws"),
        Key::line("m-map", "MAP"),
    ];
    if calibration.coordinates.iter().any(|c| c.reference.is_some()) {
        keys.push(Key::line("m-reference", "reference"));
    }
    if !calibration.stranded.is_empty() {
        keys.insert(1, Key::line("s-stranded", "stranded chain"));
    }
    let caption = Caption::new(
        format!(
            "Chains against the step, and beside them the density of the kept draws on the same axis. \
             Drawn are {} of {} chains at one step in {stride}. The axis reaches 0.7 of the kept draws' \
             range beyond them; what starts farther out is cut off.{}",
            chains.len(),
            calibration.chains,
            first_of(all, MOST_ROWS),
        ),
        "the posterior, after the burn-in.",
        "after the burn-in a band of constant middle and width, without drift and without lonely lines.",
    );
    numbers.figure("traces", &drawing, &keys, &caption)
}

/// Evenly spaced chains, and all stranded ones.
fn drawn_chains(calibration: &CalibrationFindings) -> Vec<usize> {
    let stride = calibration.chains.div_ceil(MOST_CHAINS).max(1);
    let is_drawn = |c: &usize| c.is_multiple_of(stride) || calibration.stranded.contains(c);
    (0..calibration.chains).filter(is_drawn).collect()
}

fn trace(calibration: &CalibrationFindings, i: usize, chains: &[usize], steps: &[usize]) -> Trace {
    let coordinate = &calibration.coordinates[i];
    let unit = coordinate_unit(coordinate);
    let value =
        |chain: usize, step: usize| unit.show(calibration.draw(chain, step, i).unwrap_or(f64::NAN));
    let chain = |c: usize| steps.iter().map(|&step| value(c, step)).collect();
    Trace {
        title: titled(&coordinate.name, &coordinate.symbol),
        label: unit.label(&coordinate.name),
        chains: chains.iter().map(|&c| chain(c)).collect(),
        numbers: chains.to_vec(),
        stranded: chains.iter().map(|c| calibration.stranded.contains(c)).collect(),
        steps: steps.to_vec(),
        burn_in: calibration.burn_in,
        kept: kept_draws(calibration, i, &unit),
        effective: coordinate.ess_bulk,
        marks: marks(coordinate, &unit),
    }
}

/// Draws of one coordinate after the burn-in, in the displayed unit, chain after chain; thinned if there are very many.
pub fn kept_draws(calibration: &CalibrationFindings, i: usize, unit: &ShownUnit) -> Vec<f64> {
    let kept = calibration.steps.saturating_sub(calibration.burn_in);
    let stride = (kept * calibration.chains).div_ceil(MOST_DRAWS).max(1);
    let steps = (calibration.burn_in..calibration.steps).step_by(stride);
    (0..calibration.chains)
        .flat_map(|chain| steps.clone().map(move |step| (chain, step)))
        .filter_map(|(chain, step)| calibration.draw(chain, step, i))
        .map(|value| unit.show(value))
        .collect()
}

/// The MAP and, if the study gives one, the reference.
pub fn marks(coordinate: &CoordinateFindings, unit: &ShownUnit) -> Vec<Mark> {
    let mark = |class, label: &str, value: f64| Mark {
        class,
        label: format!("{label} {}", unit.text(value, 4)),
        value: unit.show(value),
    };
    let map = Some(mark("m-map", "MAP", coordinate.map));
    let reference = coordinate.reference.map(|r| mark("m-reference", "reference", r));
    map.into_iter().chain(reference).collect()
}

impl CalibrationFindings {
    /// One draw of one coordinate; `None` if an index is out of range.
    pub fn draw(&self, chain: usize, step: usize, coordinate: usize) -> Option<f64> {
        let width = self.coordinates.len();
        self.draws.get((chain * self.steps + step) * width + coordinate).copied()
    }
}
