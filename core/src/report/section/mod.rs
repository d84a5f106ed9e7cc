//! The sections of the report, one a file; each is left out when the run has nothing for it.

mod ensemble;
pub mod evidence;
pub mod headline;
mod measurements;
mod overview;
mod posterior;
mod sampling;
mod surrogate;
mod timing;
mod validation;

pub use posterior::posterior_table;
pub use validation::accuracy_table;

use super::findings::{CoordinateFindings, Findings};
use super::page::{Numbers, Section};
use super::scale::ShownUnit;
use crate::data::{Coordinates, Layouts};
use crate::plugin::Fact;

/// All sections that have something to show, in order.
pub fn all(findings: &Findings, numbers: &mut Numbers) -> Vec<Section> {
    let sections = [
        Some(overview::section(findings, numbers)),
        ensemble::section(findings, numbers),
        measurements::section(findings, numbers),
        surrogate::section(findings, numbers),
        sampling::section(findings, numbers),
        posterior::section(findings, numbers),
        evidence::section(findings),
        validation::section(findings, numbers),
        timing::section(findings, numbers),
    ];
    sections.into_iter().flatten().collect()
}

/// The unit in which a coordinate is shown in every figure and table of the posterior.
pub fn coordinate_unit(coordinate: &CoordinateFindings) -> ShownUnit {
    ShownUnit::for_values(&coordinate.unit, [coordinate.mean, coordinate.q025, coordinate.q975])
}

/// The unit in which the response is shown everywhere.
pub fn response_unit(findings: &Findings) -> ShownUnit {
    let measured = findings.measured.iter().flat_map(|m| m.used.summaries());
    let simulated = findings.validation.iter().flat_map(|v| v.cases.iter());
    let pairs = findings.surrogate.iter().flat_map(|s| s.pairs.iter().map(|p| p.0));
    let values: Vec<f64> = measured
        .map(|summary| summary.mean)
        .chain(simulated.flat_map(|case| case.response.iter().copied()))
        .collect();
    if values.is_empty() {
        ShownUnit::for_values(findings.layouts.unit(), pairs)
    } else {
        ShownUnit::for_values(findings.layouts.unit(), values)
    }
}

/// The label of an axis that carries the response.
pub fn response_label(findings: &Findings) -> String {
    response_unit(findings).label(findings.layouts.name())
}

/// The name with the symbol behind it, where the study gives one.
pub fn titled(name: &str, symbol: &str) -> String {
    if symbol.is_empty() || symbol == name { name.to_owned() } else { format!("{name} ({symbol})") }
}

/// What the study calls the groups that figures and tables show one by one, such as `sensor`.
pub fn group_word(layouts: &Layouts) -> &str {
    let mut labels = layouts.blocks[0]
        .axes
        .iter()
        .filter(|axis| matches!(axis.coordinates, Coordinates::Labels(_)));
    match (labels.next(), labels.next()) {
        (Some(axis), None) => &axis.name,
        _ => "group",
    }
}

/// That a figure shows the first `most` of `all` coordinates, as a sentence; empty when it shows all.
pub fn first_of(all: usize, most: usize) -> String {
    if all <= most {
        return String::new();
    }
    format!(" Of {all} coordinates the first {most} are shown.")
}

/// Facts as a list of terms.
pub fn fact_list(facts: &[Fact]) -> maud::Markup {
    maud::html! {
        @if !facts.is_empty() {
            dl { @for fact in facts { div { dt { (fact.name) } dd { (fact.value) } } } }
        }
    }
}

/// The curves of a response: for each group its title and, along it, abscissas with flat indices.
pub struct Curves {
    /// The label of the horizontal axis.
    pub label: String,
    /// The interval of the horizontal axis.
    pub domain: (f64, f64),
    /// One entry a panel.
    pub panels: Vec<CurvePanel>,
    /// How many groups found no room.
    pub left_out: usize,
}

/// Where the values of one panel lie.
pub struct CurvePanel {
    /// The group's name.
    pub title: String,
    /// Abscissa and flat index of each value.
    pub places: Vec<(f64, usize)>,
    /// Whether neighbouring values belong to one curve.
    pub connected: bool,
}

/// The largest number of panels in one figure.
const MOST_PANELS: usize = 24;

impl Curves {
    /// How many groups the figure does not show, as a sentence; empty when it shows all.
    pub fn left_out_sentence(&self) -> String {
        match self.left_out {
            0 => String::new(),
            left_out => format!(" {left_out} further groups found no room."),
        }
    }

    /// The curves of the study's response; responses without a numeric axis share one panel.
    pub fn of(findings: &Findings) -> Self {
        let layouts = &findings.layouts;
        let groups = layouts.groups();
        let Some((name, _, unit)) = layouts.blocks[0].abscissa() else {
            let places = (0..layouts.len()).map(|i| (i as f64 + 1.0, i)).collect();
            let panel = CurvePanel { title: layouts.name().to_owned(), places, connected: false };
            return Self {
                label: String::from("output [number in the study's order]"),
                domain: (0.5, layouts.len() as f64 + 0.5),
                panels: vec![panel],
                left_out: 0,
            };
        };
        let grids = || layouts.blocks.iter().filter_map(|block| Some(block.abscissa()?.1));
        let shown = ShownUnit::for_values(unit, grids().flatten().copied());
        let place = |flat: usize| {
            let (block, own) = layouts.block(flat);
            let at = block.axis(name).and_then(|(position, axis)| {
                let Coordinates::Grid { values, .. } = &axis.coordinates else { return None };
                Some(values[block.place(own)[position]])
            });
            (shown.show(at.unwrap_or(f64::NAN)), flat)
        };
        let panels = groups.iter().take(MOST_PANELS).map(|group| CurvePanel {
            title: group.name.clone(),
            places: thinned(&group.indices).map(place).collect(),
            connected: true,
        });
        let first = grids().filter_map(|grid| grid.first()).copied().fold(f64::INFINITY, f64::min);
        let last =
            grids().filter_map(|grid| grid.last()).copied().fold(f64::NEG_INFINITY, f64::max);
        Self {
            label: shown.label(name),
            domain: (shown.show(first), shown.show(last)),
            panels: panels.collect(),
            left_out: groups.len().saturating_sub(MOST_PANELS),
        }
    }
}

/// The most points of one curve: more are no more than a pen's width apart.
const MOST_POINTS: usize = 2000;

/// All outputs of a group, or evenly spaced ones of a long record.
fn thinned(indices: &[usize]) -> impl Iterator<Item = usize> + '_ {
    indices.iter().copied().step_by(indices.len().div_ceil(MOST_POINTS).max(1))
}

impl CurvePanel {
    /// The points of a curve; interrupted where the abscissa starts again or a value is missing.
    pub fn curve(&self, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(self.places.len());
        let mut last = f64::NEG_INFINITY;
        for &(x, flat) in &self.places {
            if x <= last || !self.connected {
                points.push((f64::NAN, f64::NAN));
            }
            points.push((x, value(flat)));
            last = x;
        }
        points
    }

    /// The edges of a band, interrupted likewise.
    pub fn band(&self, edges: impl Fn(usize) -> Option<(f64, f64)>) -> Vec<(f64, f64, f64)> {
        let edge = |flat| edges(flat).unwrap_or((f64::NAN, f64::NAN));
        let low = self.curve(|flat| edge(flat).0);
        let high = self.curve(|flat| edge(flat).1);
        low.into_iter().zip(high).map(|((x, low), (_, high))| (x, low, high)).collect()
    }
}
