//! The tables of the gap.

use maud::Markup;

use super::View;
use crate::gap::noise::Origin;
use crate::gap::prove::Closing;
use crate::gap::report::sentences::{on, p_value};
use crate::gap::result::{GapFindings, GapResult};
use crate::page::curves::axis_unit;
use crate::page::number::{fixed, percent, significant};
use crate::page::scale::ShownUnit;
use crate::page::table::Table;
use crate::page::{Caption, Numbers};

/// The proof on held-out data.
pub fn held_out(gap: &GapFindings, numbers: &mut Numbers) -> Markup {
    let columns = ["number", "gap without", "with", "closed", "95 % interval"];
    let mut table = Table::new(&["held out"], &columns);
    for part in gap.held_out() {
        let proof = &part.proof;
        let mut row = |name: String, count: usize, c: Closing| {
            let [closed, lower, upper] = c.closed.map(percent);
            let gaps = [c.before, c.after].map(|gap| fixed(gap, 3));
            let mut cells = vec![name, count.to_string()];
            cells.extend(gaps);
            cells.extend([closed, format!("{lower} to {upper}")]);
            table.row(cells);
        };
        let (all, beyond) = (proof.all.closing(), proof.all.beyond_known_errors);
        row(part.kind.words().to_owned(), proof.all.replicates, all);
        if beyond != all {
            row("· beyond known errors".to_owned(), proof.all.replicates, beyond);
        }
        if proof.conditions.len() > 1 {
            for condition in &proof.conditions {
                let name = condition.scenario.clone().unwrap_or_default();
                let own = &condition.comparison;
                row(format!("· {name}"), own.replicates, own.closing());
            }
        }
    }
    let caption = Caption::new(
        "Data that were held out before the search, against the calibrated response without and with what was \
         found. The gap is the root of the whitened mean square misfit less what the noise of replicates makes of it, in \
         standard deviations of the noise; closed is the share of its square. Beyond known errors is the same less what \
         emulator and numerics could make of it, with what was found: how large those errors may be is known, not what \
         they are. Intervals pair the misfits of each replicate.",
        "sampling of the replicates (Student's law).",
        "an interval above zero in all, and below zero under no condition.",
    );
    numbers.table(&table, &caption)
}

/// Further measures of the proof.
pub fn scores(view: &View<'_>, gap: &GapFindings, numbers: &mut Numbers) -> Markup {
    let unit = &view.response;
    let rmse = unit.label("RMSE without");
    let columns =
        [&rmse, "with", "inside 95 % without", "with", "accuracy without", "with", "log score"];
    let mut table = Table::new(&["held out"], &columns);
    for part in gap.held_out() {
        let proof = &part.proof;
        let mut cells = vec![part.kind.words().to_owned()];
        cells.extend(proof.rmse.map(|x| significant(unit.show(x), 3)));
        cells.extend(proof.coverage.map(percent));
        let accuracy = part.accuracy.map(|both| both.map(percent));
        cells.extend(accuracy.unwrap_or_else(|| ["–", "–"].map(str::to_owned)));
        cells.push(format!("{:+.1}", proof.log_score));
        table.row(cells);
    }
    let caption = Caption::new(
        "The same responses against the held-out data: root mean square difference from the mean of the replicates; share of \
         values inside the 95 % band of a replicate; accuracy, the share of points inside the replicates' own 95 % interval \
         (Radaideh et al., arXiv 2202.03959); log score, the gain in the log of the joint predictive density.",
        "the held-out replicates.",
        "a band that holds 95 %, and a gain above zero.",
    );
    numbers.table(&table, &caption)
}

/// The steps of the search.
pub fn path(result: &GapResult, numbers: &mut Numbers) -> Markup {
    let columns = ["p of score", "p of place", "p of energy", "log odds"];
    let mut table = Table::new(&["step", "added", "dropped"], &columns);
    for (i, step) in result.path.iter().enumerate() {
        let added: Vec<String> =
            step.added.iter().map(|(kind, place)| format!("`{kind}`{}", on(place))).collect();
        let mut cells = vec![(i + 1).to_string(), added.join(", "), step.dropped.join(", ")];
        cells.extend(step.p.map(|p| p_value(p, result.simulations)));
        cells.push(fixed(step.log_odds, 1));
        table.row(cells);
    }
    let mut last = vec![String::from("end"), String::new(), String::new()];
    last.extend(result.p[1].map(|p| p_value(p, result.simulations)));
    last.push(String::new());
    table.emphasised(last);
    let caption = Caption::new(
        "The steps of the search: at each step the probabilities, if nothing more were missing, of the largest \
         candidate's score, of the place that disagrees most and of the whole misfit; what was added; and the log of the odds \
         that any candidate acts, against nothing further.",
        "data simulated without a missing effect, with the noise estimated and the model calibrated anew.",
        "probabilities that are no longer small at the end.",
    );
    numbers.table(&table, &caption)
}

/// The calibrated parameters without and with the effects that were found.
pub fn parameters(gap: &GapFindings, numbers: &mut Numbers) -> Markup {
    let result = &gap.result;
    let mut table = Table::new(
        &["parameter"],
        &["without", "sd", "with", "sd", "shift in prior sd", "posterior mean without", "with"],
    );
    for shift in &result.parameters {
        let unit = ShownUnit::for_values(&shift.unit, shift.value);
        let show = |x: f64| significant(unit.show(x), 4);
        let [before, after] = shift.value;
        let mark = |k: usize| if shift.at_bound[k] { " (at a bound)" } else { "" };
        let mut cells = vec![
            unit.label(&shift.name),
            format!("{}{}", show(before), mark(0)),
            significant(unit.show(shift.sd[0]), 2),
            format!("{}{}", show(after), mark(1)),
            significant(unit.show(shift.sd[1]), 2),
            fixed((after - before) / shift.prior_sd, 2),
        ];
        let moved = gap.added.iter().flat_map(|a| &a.parameters).find(|m| m.name == shift.name);
        if let Some(moved) = moved {
            cells.extend(
                moved.mean.iter().zip(&moved.sd).map(|(mean, sd)| {
                    format!("{} ± {}", show(*mean), significant(unit.show(*sd), 2))
                }),
            );
        }
        table.row(cells);
    }
    let caption = Caption::new(
        "The parameters, calibrated without and with what was found to the replicates that were not held out \
         (largest posterior density, normal approximation), and the posteriors of the two studies from all data.",
        "posterior.",
        "parameters that had absorbed what was missing and move back.",
    );
    numbers.table(&table, &caption)
}

/// The detectability of each type.
pub fn visible(result: &GapResult, numbers: &mut Numbers) -> Markup {
    let mut table = Table::new(
        &["candidate", "where it shows best"],
        &["absorbed", "smallest size seen in 80 %"],
    );
    let mut kinds: Vec<&str> = result.visible.iter().map(|v| v.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let own = result.visible.iter().filter(|v| v.kind == kind);
        let Some(best) = own.min_by(|a, b| a.smallest.total_cmp(&b.smallest)) else { continue };
        let size = result.sizes.iter().find(|size| size.kind == kind);
        let smallest = size.map_or_else(String::new, |size| {
            let unit = ShownUnit::for_values(&size.unit, [best.smallest]);
            format!("{} {}", size.name, unit.text(best.smallest, 2))
        });
        let place = on(&best.on);
        let place = if place.is_empty() { " everywhere" } else { &place };
        table.row([
            kind.to_owned(),
            place.trim_start().to_owned(),
            percent(best.absorbed),
            smallest,
        ]);
    }
    let caption = Caption::new(
        "What this experiment could see: for each type the place where it shows best, the share of it that the \
         calibrated parameters absorb there, and the smallest size that would be found in 80 % of cases \
         (linearised).",
        "",
        "types of which nearly all is absorbed: that none was found says nothing of them.",
    );
    numbers.table(&table, &caption)
}

/// The noise of the replicates.
pub fn noise(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    let response = &view.response;
    let axis = axis_unit(view.layouts);
    let (sd, offset, clock) = (response.label("sd"), response.label("offset"), axis.label("clock"));
    let mut table = Table::new(&["curve"], &[&sd, "autoregression", &offset, "gain [%]", &clock]);
    for curve in result.curves.iter().filter(|curve| !curve.measured.is_empty()) {
        let scenario = curve.scenario.as_ref().map(|s| format!(" · {s}")).unwrap_or_default();
        let assumed = match curve.origin {
            Origin::Replicates => "",
            Origin::Stated => " (stated)",
            Origin::StatedInPart => " (stated in part)",
            Origin::Record => " (assumed)",
        };
        let memory: Vec<String> = curve.memory.iter().map(|a| fixed(*a, 2)).collect();
        let memory = if memory.is_empty() { String::from("white") } else { memory.join(", ") };
        let [o, g, c] = curve.wander;
        table.row([
            format!("{}{scenario}{assumed}", curve.name),
            significant(response.show(curve.sd), 3),
            memory,
            significant(response.show(o), 2),
            significant(100.0 * g, 2),
            significant(axis.show(c), 2),
        ]);
    }
    let caption = Caption::new(
        "The noise of one replicate, from the differences between replicates alone: its standard deviation along the \
         curve, how a value follows from those before it, and the standard deviations of what whole replicates \
         differ by.",
        "replicates.",
        "curves without replicates: their noise is stated by the study, or assumed from one record.",
    );
    numbers.table(&table, &caption)
}
