//! Priors of a study without data, propagated through the model: distribution of the response, and shares of the inputs
//! in the variance.

use maud::{Markup, html};

use super::{response_label, response_unit};
use crate::page::chart::{Axis, Band, BarChart, BarSeries, Curve, Key, Panel, small_multiples};
use crate::page::curves::{CurvePanel, Curves};
use crate::page::drawing::Drawing;
use crate::page::number::fixed;
use crate::page::scale::{extent, padded};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::{Findings, InputShare, Propagated, QuantityFindings};

/// The propagated priors; `None` in a study with data.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let found = findings.propagated.as_ref()?;
    let content = html! {
        (response(findings, found, numbers))
        @if !found.inputs.is_empty() { (indices_of_response(findings, found, numbers)) }
        @if !findings.quantities.is_empty() && !found.inputs.is_empty() {
            (shares(&findings.quantities, found, numbers))
            (bars(&findings.quantities, found, numbers))
        }
    };
    Some(Section { id: "forward", title: "Propagated priors", content })
}

/// Distributions on which the results depend.
fn given(found: &Propagated) -> &'static str {
    match (&found.bounds, found.inputs.is_empty()) {
        (None, _) => "the priors of the parameters",
        (Some(_), false) => {
            "the priors of the parameters, those known as an interval only at its middle"
        }
        (Some(_), true) => "all parameters at the middle of their intervals",
    }
}

/// Bands of the response.
fn response(findings: &Findings, found: &Propagated, numbers: &mut Numbers) -> Markup {
    let outlines = Curves::of(&findings.layouts);
    let own = response_unit(findings);
    let bands = &found.bands;
    let shown = |values: &[f64], i: usize| own.show(values[i]);
    let panel = |outline: &CurvePanel| Panel {
        title: outline.title.clone(),
        remark: String::new(),
        bands: vec![Band {
            class: "s-band",
            edges: outline.band(|i| Some((shown(&bands.q025, i), shown(&bands.q975, i)))),
        }],
        curves: vec![
            Curve {
                class: "s-reference",
                name: "median".to_owned(),
                points: outline.curve(|i| shown(&bands.median, i)),
            },
            Curve {
                class: "s-mean",
                name: "mean".to_owned(),
                points: outline.curve(|i| shown(&bands.mean, i)),
            },
        ],
    };
    let panels: Vec<Panel> = outlines.panels.iter().map(panel).collect();
    let ends = bands.q025.iter().chain(&bands.q975).chain(&bands.mean);
    let range = padded(extent(ends.map(|&y| own.show(y))).unwrap_or((0.0, 1.0)), 0.06);
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let y = Axis::new(response_label(findings), range).ticks(4);
    let keys = [
        Key::line("s-mean", "mean"),
        Key::line("s-reference", "median"),
        Key::area("s-band", "95 % of the draws"),
    ];
    let caption = Caption::new(
        format!("Response of the model under the priors.{}", outlines.left_out_sentence()),
        format!("{}, with the errors of emulator and numerics.", given(found)),
        "a mean outside the band, or far from the median: the distribution is skewed there.",
    );
    let drawings = small_multiples(&panels, &x, &y, "response under the priors");
    numbers.figure("prior-response", &drawings, &keys, &caption)
}

/// Classes of the lines of inputs, in the order of their importance; further inputs are in the file alone.
pub const LINES: [&str; 6] = ["i-first", "i-second", "i-third", "i-fourth", "i-fifth", "i-sixth"];

/// Indices of the inputs that are drawn: those with the largest total index, averaged over the outputs that vary.
fn drawn(found: &Propagated) -> Vec<usize> {
    let weight = |i: usize| -> f64 {
        let total = &found.response.total;
        (0..total.rows()).map(|j| total[(j, i)]).filter(|s| s.is_finite()).sum()
    };
    let mut order: Vec<usize> = (0..found.inputs.len()).collect();
    order.sort_by(|&a, &b| weight(b).total_cmp(&weight(a)).then(a.cmp(&b)));
    order.truncate(LINES.len());
    order
}

/// First-order and total indices along the curves.
fn indices_of_response(findings: &Findings, found: &Propagated, numbers: &mut Numbers) -> Markup {
    let outlines = Curves::of(&findings.layouts);
    let inputs = drawn(found);
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let y = Axis::new("Sobol index [share of variance]", (-0.05, 1.05)).ticks(4);
    let panels = |word: &str, of: &lacuna_linalg::Matrix| -> Vec<Panel> {
        let panel = |outline: &CurvePanel| Panel {
            title: outline.title.clone(),
            remark: word.to_owned(),
            bands: Vec::new(),
            curves: inputs
                .iter()
                .zip(LINES)
                .map(|(&input, class)| Curve {
                    class,
                    name: found.inputs[input].clone(),
                    points: outline.curve(|j| of[(j, input)]),
                })
                .collect(),
        };
        outlines.panels.iter().map(panel).collect()
    };
    // The panels of a curve stand side by side.
    let first = panels("first order", &found.response.first);
    let total = panels("total", &found.response.total);
    let both: Vec<Panel> = first.into_iter().zip(total).flat_map(|(a, b)| [a, b]).collect();
    let keys: Vec<Key> = inputs
        .iter()
        .zip(LINES)
        .map(|(&input, class)| Key::line(class, found.inputs[input].clone()))
        .collect();
    let left = found.inputs.len().saturating_sub(LINES.len());
    let more = if left > 0 {
        format!(" The {left} inputs with the smallest total indices are in `sensitivity.nc` alone.")
    } else {
        String::new()
    };
    let errors = found.response.total_error.as_slice().iter().copied();
    let error = errors.filter(|e| e.is_finite()).fold(0.0, f64::max);
    let caption = Caption::new(
        format!(
            "Sobol indices of the response at each place, from {} samples; the largest standard error of a total index is \
             {}.{more}{}",
            found.samples,
            fixed(error, 3),
            outlines.left_out_sentence()
        ),
        format!("{}, without errors of emulator and numerics.", given(found)),
        "a total index far above the first order: the input acts through others. A gap: nothing varies there.",
    );
    let drawing = small_multiples(&both, &x, &y, "Sobol indices of the response");
    numbers.figure("response-sobol", &drawing, &keys, &caption)
}

/// Table of the shares of every input in the variance of every quantity.
pub fn share_table(all: &[QuantityFindings]) -> Option<Table> {
    let heads = ["first order", "s.e.", "total", "s.e.", "Shapley", "s.e."];
    let mut table = Table::new(&["quantity", "input"], &heads);
    for found in all {
        for (k, share) in found.shares.iter().enumerate() {
            let name = if k == 0 { found.name.clone() } else { String::new() };
            let mut cells = vec![name, share.name.clone()];
            for (value, error) in [share.first, share.total, share.shapley] {
                cells.extend([fixed(value, 3), fixed(error, 3)]);
            }
            table.row(cells);
        }
    }
    (!table.is_empty()).then_some(table)
}

fn shares(all: &[QuantityFindings], found: &Propagated, numbers: &mut Numbers) -> Markup {
    let Some(table) = share_table(all) else { return html! {} };
    let caption = Caption::new(
        format!(
            "Shares of the inputs in the variance of each quantity, from {} samples, with standard errors (s.e.). \
             Shapley effects add up to one.",
            found.samples
        ),
        format!("{}, without errors of emulator and numerics.", given(found)),
        "a total index within a few standard errors of zero: the quantity does not depend on that input.",
    );
    numbers.table(&table, &caption)
}

/// Bars of the Shapley effects and the total indices of each quantity.
fn bars(all: &[QuantityFindings], found: &Propagated, numbers: &mut Numbers) -> Markup {
    let chart = |quantity: &QuantityFindings| {
        let series = |class, name: &str, of: &dyn Fn(&InputShare) -> f64| BarSeries {
            class,
            name: name.to_owned(),
            values: quantity.shares.iter().map(of).collect(),
        };
        let highest = quantity.shares.iter().map(|s| s.total.0).filter(|s| s.is_finite());
        let top = highest.fold(1.0, f64::max);
        let chart = BarChart {
            names: found.inputs.clone(),
            series: vec![
                series("s-first", "first order", &|share| share.first.0),
                series("s-shapley", "Shapley", &|share| share.shapley.0),
                series("s-total", "total", &|share| share.total.0),
            ],
            levels: Vec::new(),
            x_label: format!("inputs of {}", quantity.name),
            y: Axis::new("share of variance", (0.0, 1.08 * top)),
            outstanding: Vec::new(),
            numbers: found.inputs.len() <= 8,
        };
        chart.draw(&format!("shares of the inputs in the variance of {}", quantity.name))
    };
    let shown: Vec<Drawing> = all.iter().take(MOST).map(chart).collect();
    let keys = [
        Key::area("s-first", "first order: the input alone"),
        Key::area("s-shapley", "Shapley: interactions divided equally"),
        Key::area("s-total", "total: with all its interactions"),
    ];
    let caption = Caption::new(
        format!(
            "Shares of the inputs in the variance of each quantity.{}",
            super::first_of_quantities(all.len(), MOST)
        ),
        format!("{}, without errors of emulator and numerics.", given(found)),
        "inputs whose measurement or tighter manufacture would help the prediction most.",
    );
    numbers.figure("quantity-shares", &shown, &keys, &caption)
}

/// Largest number of quantities whose bars are drawn.
const MOST: usize = 6;
