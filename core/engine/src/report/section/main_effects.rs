//! Main effects of the parameters on the response.

use lacuna::data::Coordinates;
use maud::{Markup, html};

use super::{response_label, response_unit, titled};
use crate::page::chart::{Axis, Band, Curve, Key, Panel, multiples};
use crate::page::number::count;
use crate::page::scale::{ShownUnit, extent, padded};
use crate::page::{Caption, Numbers};
use crate::report::findings::{Findings, MainEffect, SurrogateFindings};

/// Largest number of parameters with a panel.
const MOST_SHOWN: usize = 12;

/// The main effects, each where it is largest; empty if they are not known.
pub fn figure(findings: &Findings, surrogate: &SurrogateFindings, numbers: &mut Numbers) -> Markup {
    let all = &surrogate.main_effects;
    let shown = &all[..all.len().min(MOST_SHOWN)];
    let panels: Vec<(Panel, Axis)> = shown.iter().map(|effect| panel(findings, effect)).collect();
    let ends = panels.iter().flat_map(|(panel, _)| &panel.bands).flat_map(|band| &band.edges);
    let Some(range) = extent(ends.flat_map(|&(_, low, high)| [low, high])) else {
        return html! {};
    };
    let y = Axis::new(response_label(findings), padded(range, 0.06)).ticks(5);
    let keys = [
        Key::line("s-map", "mean over the other parameters"),
        Key::area("s-band", "90 % of the responses as the others vary"),
    ];
    let further = match all.len() - shown.len() {
        0 => String::new(),
        n => format!(" {} parameters with smaller effects are not drawn.", count(n)),
    };
    let caption = Caption::new(
        format!(
            "Main effects: the emulated response against each parameter, averaged over the others, at the place where this \
             parameter moves the average most.{further}"
        ),
        "the design of the runs (the region of the emulator), not the posterior.",
        "a flat line in a wide band: the parameter acts only together with others. A bend or a step: one straight line, or \
         one degree, does not describe it.",
    );
    let each: Vec<(&Panel, &Axis)> = panels.iter().map(|(panel, x)| (panel, x)).collect();
    let drawings = multiples(&each, &y, "main effect");
    numbers.figure("main-effects", &drawings, &keys, &caption)
}

fn panel(findings: &Findings, effect: &MainEffect) -> (Panel, Axis) {
    let response = response_unit(findings);
    let parameter = &effect.parameter;
    let unit = ShownUnit::for_values(&parameter.unit, effect.values.iter().copied());
    let values: Vec<f64> = effect.values.iter().map(|&v| unit.show(v)).collect();
    let edges = values.iter().zip(&effect.interval);
    let band = Band {
        class: "s-band",
        edges: edges.map(|(&x, e)| (x, response.show(e.0), response.show(e.1))).collect(),
    };
    let means = values.iter().zip(&effect.mean);
    let curve = Curve {
        class: "s-map",
        name: "mean".to_owned(),
        points: means.map(|(&x, &y)| (x, response.show(y))).collect(),
    };
    let panel = Panel {
        title: titled(&parameter.name, &parameter.symbol),
        remark: place(findings, effect.output),
        bands: vec![band],
        curves: vec![curve],
    };
    let domain = extent(values.iter().copied()).unwrap_or((0.0, 1.0));
    let domain = if domain.1 > domain.0 { domain } else { padded(domain, 0.05) };
    (panel, Axis::new(unit.label(&parameter.name), domain).ticks(4))
}

/// Labels and coordinates of an output, such as `D, 0.35 ms`; empty for a single output.
fn place(findings: &Findings, output: usize) -> String {
    if findings.layouts.len() == 1 {
        return String::new();
    }
    let (block, own) = findings.layouts.block(output);
    let words = block.axes.iter().zip(block.place(own)).map(|(axis, i)| match &axis.coordinates {
        Coordinates::Labels(labels) => labels[i].clone(),
        Coordinates::Grid { values, unit } => {
            let unit = ShownUnit::for_values(unit, values.iter().copied());
            format!("{} {}", axis.name, unit.text(values[i], 3))
        }
    });
    words.collect::<Vec<_>>().join(", ")
}
