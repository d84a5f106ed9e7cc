//! The measured data.

use lacuna::data::Replicate;
use lacuna::data::measurements::Summary;
use maud::{Markup, html};

use super::{group_word, response_label, response_unit};
use crate::page::chart::{Axis, Band, Curve, Key, Panel, small_multiples};
use crate::page::curves::{CurvePanel, Curves};
use crate::page::number::{count, significant};
use crate::page::scale::{ShownUnit, extent, padded};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::{Findings, MeasuredFindings};

/// Largest number of replicates that are drawn one by one.
const MOST_DRAWN: usize = 60;

/// The replicates; `None` if there are none.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let measured = findings.measured.as_ref()?;
    let replicates = measured.used.replicates();
    let content = html! {
        p {
            b { (count(replicates)) } @if replicates == 1 { " replicate with " } @else { " replicates with " } (count(measured.used.count()))
            " measured values; " (count(measured.data_count)) " data enter the likelihood."
            @if !measured.added_curves.is_empty() {
                " Beside the replicates the likelihood counts these curves of every group as data: "
                (measured.added_curves.join(", ")) ". They are not measurements, and the posterior is \
                narrower for them."
            }
        }
        @if replicates > 0 { (figure(findings, measured, numbers)) }
        @if !measured.flagged.is_empty() { (flagged(findings, measured, numbers)) }
    };
    Some(Section { id: "measurements", title: "Measurements", content })
}

fn figure(findings: &Findings, measured: &MeasuredFindings, numbers: &mut Numbers) -> Markup {
    let curves = Curves::of(&findings.layouts);
    let unit = response_unit(findings);
    let summaries = measured.used.summaries();
    let panels: Vec<Panel> =
        curves.panels.iter().map(|outline| panel(measured, &summaries, outline, &unit)).collect();
    let values = panels.iter().flat_map(|p| p.curves.iter().flat_map(|c| c.points.iter()));
    let range = extent(values.map(|p| p.1)).unwrap_or((0.0, 1.0));
    let x = Axis::new(curves.label.as_str(), curves.domain).ticks(6);
    let y = Axis::new(response_label(findings), padded(range, 0.06)).ticks(4);
    let drawing = small_multiples(&panels, &x, &y, "measured curves of every group");
    let mut keys = vec![Key::line("s-replicate", "replicate")];
    let repeated = panels.iter().any(|panel| !panel.bands.is_empty());
    if repeated {
        keys.push(Key::line("s-mean", "mean of the replicates"));
        keys.push(Key::area("s-band", "mean ± 1.96 sd of the replicates"));
    }
    if measured.flagged.iter().any(|f| !f.left_out) {
        keys.insert(1, Key::line("s-flagged", "replicate flagged by the screen"));
    }
    let replicates = measured.used.replicates();
    let thinned = if replicates > MOST_DRAWN {
        let (all, most) = (count(replicates), MOST_DRAWN);
        format!(" Of {all} replicates at most {most} are drawn; mean and band are of all.")
    } else {
        String::new()
    };
    let shows = format!(
        "Measured curves of every group, all panels on the same axes.{thinned}{}",
        curves.left_out_sentence()
    );
    let caption = Caption::new(
        shows,
        if repeated {
            "the replicates: the band is where single repetitions fall, not the error of their mean."
        } else {
            ""
        },
        "curves apart from the others, bands that widen late, gaps.",
    );
    numbers.figure("measurements", &drawing, &keys, &caption)
}

fn panel(
    measured: &MeasuredFindings,
    summaries: &[Summary],
    outline: &CurvePanel,
    unit: &ShownUnit,
) -> Panel {
    let is_flagged = |replicate: &str| {
        measured.flagged.iter().any(|f| f.replicate == replicate && f.group == outline.title)
    };
    let measured_here = replicates(measured, outline);
    let stride = measured_here.len().div_ceil(MOST_DRAWN).max(1);
    let chosen = measured_here.iter().enumerate();
    let chosen = chosen.filter(|(i, (r, _))| i % stride == 0 || is_flagged(&r.name));
    let mut curves: Vec<Curve> = chosen
        .map(|(_, (replicate, begin))| Curve {
            class: if is_flagged(&replicate.name) { "s-flagged" } else { "s-replicate" },
            name: replicate.name.clone(),
            points: outline
                .curve(|i| replicate.values[i - begin].map_or(f64::NAN, |v| unit.show(v))),
        })
        .collect();
    curves.sort_by_key(|c| c.class == "s-flagged");
    let mean = |i: usize| if summaries[i].count > 0 { summaries[i].mean } else { f64::NAN };
    let edges = |i: usize| {
        let half = 1.96 * summaries[i].sd()?;
        Some((unit.show(mean(i) - half), unit.show(mean(i) + half)))
    };
    let most = outline.places.iter().map(|&(_, i)| summaries[i].count).max().unwrap_or(0);
    let mut bands = Vec::new();
    // With one replicate, the mean is that replicate.
    if most > 1 {
        let points = outline.curve(|i| unit.show(mean(i)));
        curves.push(Curve { class: "s-mean", name: String::from("mean"), points });
        bands.push(Band { class: "s-band", edges: outline.band(edges) });
    }
    Panel {
        title: outline.title.clone(),
        remark: if most == 1 {
            "1 replicate".to_owned()
        } else {
            format!("{} replicates", count(most))
        },
        bands,
        curves,
    }
}

/// The replicates that have a value in a panel, each with the first output of its block.
fn replicates<'a>(
    measured: &'a MeasuredFindings,
    outline: &CurvePanel,
) -> Vec<(&'a Replicate, usize)> {
    let layouts = measured.used.layouts();
    let mut found = Vec::new();
    for (block, range) in measured.used.blocks.iter().zip(layouts.ranges()) {
        let inside: Vec<usize> = outline.places.iter().map(|&(_, i)| i).collect();
        if !inside.first().is_some_and(|i| range.contains(i)) {
            continue;
        }
        let there = |r: &&Replicate| inside.iter().any(|i| r.values[i - range.start].is_some());
        found.extend(block.replicates.iter().filter(there).map(|r| (r, range.start)));
    }
    found
}

fn flagged(findings: &Findings, measured: &MeasuredFindings, numbers: &mut Numbers) -> Markup {
    let mut table = Table::new(
        &["replicate", group_word(&findings.layouts), "fate"],
        &["distance", "threshold"],
    );
    for curve in &measured.flagged {
        let fate = if curve.left_out { "left out" } else { "kept" };
        table.row([
            curve.replicate.clone(),
            curve.group.clone(),
            fate.to_owned(),
            significant(curve.distance, 3),
            significant(curve.threshold, 3),
        ]);
    }
    let caption = Caption::new(
        "Curves that the screen flagged; distances from the median curve in robust standard \
         deviations. A curve that was left out is not in the figure nor in any summary.",
        "",
        "one replicate in many groups (a bad pulse) or one group in many replicates (a bad gauge).",
    );
    numbers.table(&table, &caption)
}
