//! The figures of a missing rate: over time, and over the quantity of its law.

use maud::{Markup, html};

use super::View;
use crate::gap::result::GapResult;
use crate::gap::result::law::{Force, ForceCurve, Law};
use crate::page::chart::{Axis, Band, Curve, Key, Panel, small_multiples};
use crate::page::curves::axis_unit;
use crate::page::scale::{ShownUnit, extent, padded};
use crate::page::{Caption, Numbers};

/// The largest number of conditions that are shown.
const MOST: usize = 12;

/// The normal quantile of a 95 % band.
const HALF: f64 = 1.96;

/// The force over time, and over the quantity of the law if there is one.
pub fn figures(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    let Some(law) = &result.law else { return html! {} };
    html! {
        (over_time(view, law, numbers))
        @if let Some(of) = &law.force.of { (over_argument(law, of, numbers)) }
    }
}

fn shown_unit(force: &Force) -> ShownUnit {
    let values = force.curves.iter().flat_map(|curve| curve.mean.iter().copied());
    ShownUnit::for_values(&force.unit, values)
}

/// A line through the values of a curve at places along it.
fn line(class: &'static str, name: &str, at: &[f64], values: &[f64]) -> Curve {
    let points = at.iter().copied().zip(values.iter().copied()).collect();
    Curve { class, name: name.to_owned(), points }
}

fn over_time(view: &View<'_>, law: &Law, numbers: &mut Numbers) -> Markup {
    let (force, time) = (&law.force, axis_unit(view.layouts));
    let unit = shown_unit(force);
    let name = view.layouts.blocks[0].abscissa().map_or("", |(name, ..)| name);
    let panel = |curve: &ForceCurve| {
        let at: Vec<f64> = curve.at.iter().map(|t| time.show(*t)).collect();
        let shown = |values: &[f64]| values.iter().map(|u| unit.show(*u)).collect::<Vec<f64>>();
        let edges = at.iter().zip(curve.mean.iter().zip(&curve.sd));
        let edges = edges
            .map(|(t, (mean, sd))| (*t, unit.show(mean - HALF * sd), unit.show(mean + HALF * sd)));
        let mut curves = vec![line("s-mean", "free force", &at, &shown(&curve.mean))];
        if !curve.law.is_empty() {
            curves.push(line("s-map", "law", &at, &shown(&curve.law)));
        }
        Panel {
            title: curve.scenario.clone().unwrap_or_default(),
            remark: String::new(),
            bands: vec![Band { class: "s-band", edges: edges.collect() }],
            curves,
        }
    };
    let panels: Vec<Panel> = force.curves.iter().take(MOST).map(panel).collect();
    let places = panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points).map(|p| p.0);
    let x = Axis::new(time.label(name), extent(places).unwrap_or((0.0, 1.0))).ticks(6);
    let y = Axis::new(unit.label(&format!("rate of {}", force.state)), range(&panels)).ticks(4);
    let caption = Caption::new(
        format!(
            "What the rate of `{}` lacks over time: the force that, added to the equations, makes the response follow the data, \
             inferred together with the parameters and without any form; and the law along the same run.",
            force.state
        ),
        "the grey band is the 95 % posterior interval of the free force, given its correlation time and size.",
        "a law inside the band.",
    );
    let mut keys =
        vec![Key::line("s-mean", "free force"), Key::area("s-band", "its 95 % posterior interval")];
    if !law.terms.is_empty() {
        keys.push(Key::line("s-map", "law"));
    }
    let drawings = small_multiples(&panels, &x, &y, "the missing rate over time");
    numbers.figure("gap-force-over-time", &drawings, &keys, &caption)
}

fn over_argument(law: &Law, of: &str, numbers: &mut Numbers) -> Markup {
    let force = &law.force;
    let unit = shown_unit(force);
    let panel = |curve: &ForceCurve| {
        let shown = |values: &[f64]| values.iter().map(|u| unit.show(*u)).collect::<Vec<f64>>();
        let mut order: Vec<usize> = (0..curve.of.len()).collect();
        order.sort_by(|a, b| curve.of[*a].total_cmp(&curve.of[*b]));
        let sorted = |values: &[f64]| order.iter().map(|&i| values[i]).collect::<Vec<f64>>();
        Panel {
            title: curve.scenario.clone().unwrap_or_default(),
            remark: String::new(),
            bands: Vec::new(),
            curves: vec![
                line("s-mean", "free force", &curve.of, &shown(&curve.mean)),
                line("s-map", "law", &sorted(&curve.of), &sorted(&shown(&curve.law))),
            ],
        }
    };
    let known = force.curves.iter().filter(|curve| curve.of.len() == curve.mean.len());
    let panels: Vec<Panel> = known.take(MOST).map(panel).collect();
    let places = panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points).map(|p| p.0);
    let Some(places) = extent(places) else { return html! {} };
    let x = Axis::new(of.to_owned(), places).ticks(6);
    let y = Axis::new(unit.label(&format!("rate of {}", force.state)), range(&panels)).ticks(4);
    let caption = Caption::new(
        format!(
            "The same over `{of}`, along the run with the free force: a function of `{of}` alone is one line, a force that \
             depends on the past or on something else makes loops."
        ),
        "",
        "a free force that follows the law.",
    );
    let keys = [Key::line("s-mean", "free force"), Key::line("s-map", "law")];
    let drawings = small_multiples(&panels, &x, &y, "the missing rate over its argument");
    numbers.figure("gap-force", &drawings, &keys, &caption)
}

/// The range of all curves.
fn range(panels: &[Panel]) -> (f64, f64) {
    let values = panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points).map(|p| p.1);
    padded(extent(values).unwrap_or((-1.0, 1.0)), 0.06)
}
