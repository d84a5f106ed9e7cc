//! How the chains mix: ranks of each chain among all, and autocorrelation.

use maud::{Markup, html};

use super::{first_of, titled};
use crate::page::chart::{Axis, Curve, Key, Panel, small_multiples};
use crate::page::number::significant;
use crate::page::scale::extent;
use crate::page::{Caption, Numbers};
use crate::report::findings::{CalibrationFindings, CoordinateFindings, Mixing};

/// Ranks and autocorrelation; empty if they are not known.
pub fn figures(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    if calibration.mixing.is_empty() {
        return html! {};
    }
    html! { (ranks(calibration, numbers)) (autocorrelation(calibration, numbers)) }
}

/// Each described coordinate with how its chains mix.
fn described(
    calibration: &CalibrationFindings,
) -> impl Iterator<Item = (&CoordinateFindings, &Mixing)> {
    calibration.coordinates.iter().zip(&calibration.mixing)
}

fn ranks(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let panel = |(coordinate, mixing): (&CoordinateFindings, &Mixing)| {
        let curve = |(chain, ranks): (&usize, &Vec<f64>)| {
            let last = (ranks.len().max(2) - 1) as f64;
            let stranded = calibration.stranded.contains(chain);
            Curve {
                class: if stranded { "s-stranded" } else { "s-walker" },
                name: format!("chain {}", chain + 1),
                points: ranks.iter().enumerate().map(|(k, &d)| (k as f64 / last, d)).collect(),
            }
        };
        let largest = mixing.ranks.iter().flatten().map(|d| d.abs()).fold(0.0, f64::max);
        Panel {
            title: titled(&coordinate.name, &coordinate.symbol),
            remark: format!("largest {}", significant(largest, 2)),
            bands: Vec::new(),
            curves: mixing.chains.iter().zip(&mixing.ranks).map(curve).collect(),
        }
    };
    let panels: Vec<Panel> = described(calibration).map(panel).collect();
    let values = panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points).map(|p| p.1);
    let most = extent(values).map_or(0.1, |(low, high)| low.abs().max(high.abs()).max(0.05)) * 1.1;
    let x = Axis::new("rank among all draws [share]", (0.0, 1.0)).ticks(5);
    let y = Axis::new("chain less all [share]", (-most, most)).ticks(5);
    let mut keys = vec![Key::line("s-walker", "chain")];
    if !calibration.stranded.is_empty() {
        keys.push(Key::line("s-stranded", "stranded chain"));
    }
    let shown = calibration.mixing.first().map_or(0, |mixing| mixing.chains.len());
    let caption = Caption::new(
        format!(
            "Rank plots: the distribution function of the ranks of each chain's draws among the draws of all chains, less that \
             of uniform ranks. Drawn are {shown} of {} chains.{}",
            calibration.chains,
            first_of(calibration.coordinates.len(), calibration.mixing.len())
        ),
        "the draws after the burn-in. Walkers of an ensemble are short and slow chains: they scatter more than independent draws.",
        "a chain whose curve leaves the others: it explores another part of the posterior.",
    );
    let drawings = small_multiples(&panels, &x, &y, "rank plot");
    numbers.figure("rank-plots", &drawings, &keys, &caption)
}

fn autocorrelation(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let panel = |(coordinate, mixing): (&CoordinateFindings, &Mixing)| Panel {
        title: titled(&coordinate.name, &coordinate.symbol),
        remark: format!("time {} steps", significant(coordinate.autocorrelation_time, 3)),
        bands: Vec::new(),
        curves: vec![
            Curve { class: "s-equal", name: String::new(), points: vec![(0.0, 0.0), (1e9, 0.0)] },
            Curve {
                class: "s-mean",
                name: "autocorrelation".to_owned(),
                points: mixing.autocorrelation.iter().map(|&(lag, r)| (lag as f64, r)).collect(),
            },
        ],
    };
    let panels: Vec<Panel> = described(calibration).map(panel).collect();
    let all = || calibration.mixing.iter().flat_map(|mixing| &mixing.autocorrelation);
    let Some((_, last)) = extent(all().map(|p| p.0 as f64)) else { return html! {} };
    let lowest = all().map(|p| p.1).fold(-0.1, f64::min);
    let mut panels = panels;
    for panel in &mut panels {
        panel.curves[0].points[1].0 = last;
    }
    let x = Axis::new("lag [steps]", (0.0, last)).ticks(5);
    let y = Axis::new("autocorrelation", (lowest, 1.05)).ticks(5);
    let keys = [Key::line("s-mean", "mean over the chains"), Key::line("s-equal", "zero")];
    let caption = Caption::new(
        "Autocorrelation of the chains, with the integrated autocorrelation time above each panel.",
        "the draws after the burn-in.",
        "a curve that has not come down to zero within a tenth of the chain's length: the chains are short.",
    );
    let drawings = small_multiples(&panels, &x, &y, "autocorrelation of the chains");
    numbers.figure("autocorrelation", &drawings, &keys, &caption)
}
