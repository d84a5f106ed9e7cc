//! The result of the gap workflow in sentences: for the terminal and the page.

use super::{View, proof};
pub use crate::gap::candidates::on_words as on;
use crate::gap::experiment::hold_out::HeldOutKind;
use crate::gap::result::law::Law;
use crate::gap::result::remains::Remains;
use crate::gap::result::replaced::OtherModel;
use crate::gap::result::{AddedEffect, GapFindings, GapResult, HeldOut, RegionResult};
use crate::gap::search::VerdictKind;
use crate::gap::search::needless::Needless;
use crate::gap::test::is_at_floor;
use crate::page::number::{fixed, percent, typeset};

/// The verdict and its reasons, one sentence per line, for a terminal.
pub fn text(view: &View<'_>, gap: &GapFindings) -> String {
    let mut lines = sentences(view, gap);
    lines.extend(gap.result.verdict.reasons.iter().map(|reason| format!("note: {reason}")));
    lines.join("\n") + "\n"
}

/// The verdict, the regions of the gap, and the proof on held-out data.
pub fn sentences(view: &View<'_>, gap: &GapFindings) -> Vec<String> {
    let result = &gap.result;
    let mut sentences = vec![verdict(result)];
    let regions = &result.regions[0];
    if !regions.is_empty() && result.verdict.word != VerdictKind::None {
        let told: Vec<String> = regions.iter().take(TOLD).map(|r| spot(view, result, r)).collect();
        let further = match regions.len() - told.len() {
            0 => String::new(),
            n => format!("; and {n} further places"),
        };
        sentences.push(format!("They disagree at {}{further}.", told.join("; ")));
    }
    sentences.extend(result.additions.iter().map(|addition| addition_sentence(gap, addition)));
    let is_told = matches!(result.verdict.word, VerdictKind::Approximate | VerdictKind::Unlisted);
    let remains = result.remains.as_ref().filter(|_| is_told && !result.additions.is_empty());
    sentences.extend(remains.map(|remains| remains_sentence(view, remains)));
    sentences
        .extend(gap.held_out().iter().map(|part| held_out(part, !result.additions.is_empty())));
    sentences.extend(proof::sentences(gap));
    sentences.extend(result.law.iter().flat_map(Law::words));
    sentences.extend(proof::members(gap));
    sentences.extend(result.needless.iter().map(Needless::words));
    sentences.extend(result.models.iter().map(other_model));
    sentences
}

/// Largest number of regions that are described in words.
const TOLD: usize = 4;

/// The verdict in a sentence.
pub fn verdict(result: &GapResult) -> String {
    let listed = |additions: &[AddedEffect]| {
        let each = additions.iter().map(|a| format!("`{}`{}", a.label(), on(&a.on)));
        each.collect::<Vec<_>>().join(" and ")
    };
    let is_swap = result.additions.first().is_some_and(|first| first.model);
    match result.verdict.word {
        VerdictKind::None => "Data and calibrated model agree within the noise: nothing is missing that these data can show.".into(),
        VerdictKind::Named if is_swap => {
            let (model, effects) = result.additions.split_at(1);
            let besides = if effects.is_empty() {
                String::new()
            } else {
                format!(", and with it {}", listed(effects))
            };
            format!("The data need the model {} in place of the study's{besides}.", listed(model))
        }
        VerdictKind::Named => format!("The model misses {}.", listed(&result.additions)),
        VerdictKind::Approximate => format!(
            "What the model misses acts like {}: {:.0} % of the gap; the rest has another form.",
            listed(&result.additions),
            100.0 * result.verdict.closed
        ),
        VerdictKind::Class => {
            let each: Vec<String> = result
                .additions
                .iter()
                .map(|a| {
                    let class: Vec<String> = a.class.iter().map(|kind| format!("`{kind}`")).collect();
                    match class.len() {
                        1 => format!("{}{}", class[0], on(&a.on)),
                        _ => format!("one of {}{}", class.join(", "), on(&a.on)),
                    }
                })
                .collect();
            let what = if is_swap { "The data need" } else { "The model misses" };
            format!("{what} {}; these data cannot tell which.", each.join(" and "))
        }
        VerdictKind::Unlisted if result.additions.is_empty() => {
            "Data and calibrated model disagree, and no candidate explains it.".into()
        }
        VerdictKind::Unlisted => unlisted(result),
        VerdictKind::NotVisible => "Whatever may be missing, the calibrated parameters absorb it: this experiment cannot show it.".into(),
    }
}

/// A sentence with the effects that explain most of a gap without a named cause, and the share that they explain.
fn unlisted(result: &GapResult) -> String {
    let one = |addition: &AddedEffect| {
        let class: Vec<String> = addition.class.iter().map(|kind| format!("`{kind}`")).collect();
        format!("{}{}", class.join(" or "), on(&addition.on))
    };
    let each: Vec<String> = result.additions.iter().map(one).collect();
    let all = match each.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => each.concat(),
    };
    let verb = if each.len() == 1 { "explains" } else { "explain" };
    match result.explained() {
        Some(share) => format!(
            "Something is missing that has no sure name; {all} {verb} {} of it.",
            percent(share)
        ),
        None => format!("Something is missing that has no sure name; nearest to it: {all}."),
    }
}

/// A region of disagreement in words.
pub fn spot(view: &View<'_>, result: &GapResult, spot: &RegionResult) -> String {
    let curves: Vec<&_> = spot.curves.iter().map(|&s| &result.curves[s]).collect();
    let scenario = curves[0].scenario.as_ref().map(|s| format!(" under `{s}`")).unwrap_or_default();
    let place = if curves.len() == 1 {
        curves[0].name.clone()
    } else {
        format!("all {} curves", curves.len())
    };
    let unit = crate::page::curves::axis_unit(view.layouts);
    let whole =
        curves[0].at.first() == Some(&spot.span.0) && curves[0].at.last() == Some(&spot.span.1);
    let span = if whole {
        String::new()
    } else {
        format!(" from {} to {}", unit.text(spot.span.0, 3), unit.text(spot.span.1, 3))
    };
    let band = spot.band.map(|(low, high)| {
        let unit = crate::page::curves::frequency_unit(view.layouts);
        format!(", between {} and {}", unit.text(low, 2), unit.text(high, 2))
    });
    let p = named_p(spot.p, result.simulations);
    format!("{place}{scenario}{span}{} ({p})", band.unwrap_or_default())
}

/// A p-value as it is printed: `0.03`, or `<= 0.0025` if it is the smallest one that this number of simulations can
/// give. Zero simulations denote a p-value from a formula.
pub fn p_value(p: f64, simulations: usize) -> String {
    let bound = if is_at_floor(p, simulations) { "<= " } else { "" };
    format!("{bound}{}", fixed(p, if p < 0.1 { 4 } else { 2 }))
}

/// A p-value with its name: `p = 0.03`, or `p <= 0.0025`.
fn named_p(p: f64, simulations: usize) -> String {
    let sign = if is_at_floor(p, simulations) { "" } else { "= " };
    format!("p {sign}{}", p_value(p, simulations))
}

fn addition_sentence(gap: &GapFindings, addition: &AddedEffect) -> String {
    let values: Vec<String> = addition
        .unknowns
        .iter()
        .map(|unknown| {
            let posterior = gap
                .added
                .iter()
                .flat_map(|added| &added.unknowns)
                .find(|posterior| posterior.name == unknown.name);
            let shared = gap.added.iter().flat_map(|added| &added.parameters);
            let shared = shared.filter(|_| addition.model).find(|p| p.name == unknown.name);
            let (value, sd) = match (posterior, shared) {
                (Some(p), _) => (p.mean, p.sd),
                (_, Some(p)) => (p.mean[1], p.sd[1]),
                _ => (unknown.value, unknown.sd),
            };
            let unit = crate::page::scale::ShownUnit::for_values(&unknown.unit, [value, sd]);
            format!("`{}` {} ± {}", unknown.name, unit.text(value, 3), unit.text(sd, 2))
        })
        .collect();
    format!(
        "{}{}: {} ({} of the gap; probability {}{}).",
        capitalised(&addition.title),
        on(&addition.on),
        values.join(", "),
        percent(addition.share),
        probability(addition.probability),
        none_of_these(gap)
    )
}

/// The probability beside that of an effect: that what is missing is of no type that is named.
fn none_of_these(gap: &GapFindings) -> String {
    let none = gap.result.verdict.none_of_these;
    none.map(|p| format!(", of none of these {}", fixed(p, 2))).unwrap_or_default()
}

/// A probability; above 0.99 as a bound, for no count of cases shows more.
pub fn probability(p: f64) -> String {
    if p > 0.99 { "above 0.99".to_owned() } else { fixed(p, 2) }
}

/// The size and the place of what the effects leave.
fn remains_sentence(view: &View<'_>, remains: &Remains) -> String {
    let mut labels: Vec<&str> = Vec::new();
    for label in remains.sensors.iter().flat_map(|on| on.values().flatten()) {
        if !labels.contains(&label.as_str()) {
            labels.push(label);
        }
    }
    let at = if labels.is_empty() { String::new() } else { format!(" at {}", labels.join(", ")) };
    let below = remains.below.map(|frequency| {
        format!(", below {}", crate::page::curves::frequency_unit(view.layouts).text(frequency, 2))
    });
    format!(
        "{} of the gap remains{at}{}: {} standard deviations of one replicate's noise (log Bayes factor of a remainder {}).",
        percent(remains.share),
        below.unwrap_or_default(),
        fixed(remains.rms, 2),
        fixed(remains.log_bayes_factor, 1)
    )
}

/// The comparison of another model with the study's own.
fn other_model(model: &OtherModel) -> String {
    let (more, odds) =
        if model.log_odds > 0.0 { ("more", model.log_odds) } else { ("less", -model.log_odds) };
    format!(
        "With the model `{}` in place of the study's the data are {more} probable, log Bayes factor {} ± {}.",
        model.name,
        fixed(odds, 1),
        fixed(model.error, 1)
    )
}

/// The text with a capital first letter.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// The proof on one kind of held-out data.
fn held_out(part: &HeldOut, with: bool) -> String {
    let all = &part.proof.all;
    let kind = part.kind.words();
    let gap = |x: f64| typeset(&fixed(x, 2));
    if !with {
        return format!(
            "On {} held-out {kind} the gap is {} standard deviations of the noise.",
            all.replicates,
            gap(all.before)
        );
    }
    let interval = if all.lower.is_finite() && all.upper.is_finite() {
        format!(" (95 % interval {} to {})", percent(all.lower), percent(all.upper))
    } else {
        " (the gap is too small for an interval)".to_owned()
    };
    let outcome = match part.proof.shrank {
        true if part.kind == HeldOutKind::Replicates => "It is reproducible that the gap closes",
        true => "It shrank",
        false => "That it closes is not shown",
    };
    format!(
        "On {} held-out {kind} the gap is {} standard deviations of the noise without and {} with what was found: {} of it closed{interval}. {outcome}.",
        all.replicates,
        gap(all.before),
        gap(all.after),
        percent(all.closed),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With 399 simulations 1/400 is the smallest possible p-value: the true one is at most as large.
    #[test]
    fn a_p_value_at_its_floor_is_a_bound() {
        assert_eq!(p_value(0.0025, 399), "<= 0.0025");
        assert_eq!(named_p(0.0025, 399), "p <= 0.0025");
        assert_eq!(named_p(0.005, 399), "p = 0.0050");
        assert_eq!(p_value(0.12, 399), "0.12");
        assert_eq!(p_value(1e-6, 0), "0.0000");
    }
}
