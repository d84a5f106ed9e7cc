//! What the model misses, in words: for the terminal, the page and the written study alike.

use super::findings::{Findings, GapFindings};
use super::number::{fixed, percent, typeset};
use crate::gap::account::{Account, Addition, HeldOut, Spot};
use crate::gap::name::Word;
use crate::gap::needless::Needless;
use crate::gap::replaced::OtherModel;
use crate::plugin::effect::On;

/// The verdict and what it rests on, one sentence a line, for a terminal.
pub fn gap_text(findings: &Findings) -> String {
    let Some(gap) = &findings.gap else { return String::new() };
    let mut lines = sentences(findings, gap);
    lines.extend(gap.account.verdict.reasons.iter().map(|reason| format!("note: {reason}")));
    lines.join("\n") + "\n"
}

/// The verdict, where the gap is, and how it fares on what was set aside.
pub fn sentences(findings: &Findings, gap: &GapFindings) -> Vec<String> {
    let account = &gap.account;
    let mut sentences = vec![verdict(account)];
    let regions = &account.regions[0];
    if !regions.is_empty() && account.verdict.word != Word::None {
        let told: Vec<String> =
            regions.iter().take(TOLD).map(|r| spot(findings, account, r)).collect();
        let further = match regions.len() - told.len() {
            0 => String::new(),
            n => format!("; and {n} further places"),
        };
        sentences.push(format!("They disagree at {}{further}.", told.join("; ")));
    }
    sentences.extend(account.additions.iter().map(|addition| addition_sentence(gap, addition)));
    sentences
        .extend(gap.held_out().iter().map(|part| held_out(part, !account.additions.is_empty())));
    sentences.extend(account.needless.iter().map(Needless::words));
    sentences.extend(account.models.iter().map(other_model));
    sentences
}

/// Places that are told in words.
const TOLD: usize = 4;

/// What is missing, in a sentence.
pub fn verdict(account: &Account) -> String {
    let listed = |additions: &[Addition]| {
        let each = additions.iter().map(|a| format!("`{}`{}", a.label(), on(&a.on)));
        each.collect::<Vec<_>>().join(" and ")
    };
    let is_swap = account.additions.first().is_some_and(|first| first.model);
    match account.verdict.word {
        Word::None => "Data and calibrated model agree within the noise: nothing is missing that these data can show.".into(),
        Word::Named if is_swap => {
            let (model, effects) = account.additions.split_at(1);
            let besides = if effects.is_empty() {
                String::new()
            } else {
                format!(", and with it {}", listed(effects))
            };
            format!("The data need the model {} in place of the study's{besides}.", listed(model))
        }
        Word::Named => format!("The model misses {}.", listed(&account.additions)),
        Word::Class => {
            let each: Vec<String> = account
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
        Word::Unlisted if account.additions.is_empty() => {
            "Data and calibrated model disagree, and no candidate explains it.".into()
        }
        Word::Unlisted => unlisted(account),
        Word::NotVisible => "Whatever may be missing, the calibrated parameters absorb it: this experiment cannot show it.".into(),
    }
}

/// What explains most of a gap that has no sure name, and how much of it.
fn unlisted(account: &Account) -> String {
    let one = |addition: &Addition| {
        let class: Vec<String> = addition.class.iter().map(|kind| format!("`{kind}`")).collect();
        format!("{}{}", class.join(" or "), on(&addition.on))
    };
    let each: Vec<String> = account.additions.iter().map(one).collect();
    let all = match each.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => each.concat(),
    };
    let verb = if each.len() == 1 { "explains" } else { "explain" };
    match account.explained() {
        Some(share) => format!(
            "Something is missing that has no sure name; {all} {verb} {} of it.",
            percent(share)
        ),
        None => format!("Something is missing that has no sure name; nearest to it: {all}."),
    }
}

/// Where an effect acts: ` on sensor R, V`; nothing where it acts everywhere.
pub fn on(on: &On) -> String {
    let each: Vec<String> =
        on.iter().map(|(axis, labels)| format!("{axis} {}", labels.join(", "))).collect();
    if each.is_empty() { String::new() } else { format!(" on {}", each.join(" and ")) }
}

/// A place of disagreement in words.
pub fn spot(findings: &Findings, account: &Account, spot: &Spot) -> String {
    let curves: Vec<&_> = spot.curves.iter().map(|&s| &account.curves[s]).collect();
    let scenario = curves[0].scenario.as_ref().map(|s| format!(" under `{s}`")).unwrap_or_default();
    let place = if curves.len() == 1 {
        curves[0].name.clone()
    } else {
        format!("all {} curves", curves.len())
    };
    let unit = super::section::axis_unit(findings);
    let whole =
        curves[0].at.first() == Some(&spot.span.0) && curves[0].at.last() == Some(&spot.span.1);
    let span = if whole {
        String::new()
    } else {
        format!(" from {} to {}", unit.text(spot.span.0, 3), unit.text(spot.span.1, 3))
    };
    let band = spot.band.map(|(low, high)| {
        let unit = super::section::frequency_unit(findings);
        format!(", between {} and {}", unit.text(low, 2), unit.text(high, 2))
    });
    format!("{place}{scenario}{span}{} (p = {})", band.unwrap_or_default(), p_value(spot.p))
}

/// A probability as it is told.
pub fn p_value(p: f64) -> String {
    fixed(p, if p < 0.1 { 4 } else { 2 })
}

fn addition_sentence(gap: &GapFindings, addition: &Addition) -> String {
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
            let unit = super::scale::ShownUnit::for_values(&unknown.unit, [value, sd]);
            format!("`{}` {} ± {}", unknown.name, unit.text(value, 3), unit.text(sd, 2))
        })
        .collect();
    format!(
        "{}{}: {} (probability among the candidates {}).",
        capitalised(&addition.title),
        on(&addition.on),
        values.join(", "),
        fixed(addition.probability, 2)
    )
}

/// Another model against the study's own.
fn other_model(model: &OtherModel) -> String {
    let (more, odds) =
        if model.log_odds > 0.0 { ("more", model.log_odds) } else { ("less", -model.log_odds) };
    format!(
        "With the model `{}` in place of the study's the data are {more} probable, by a factor e^{} (± {} in the exponent).",
        model.name,
        fixed(odds, 1),
        fixed(model.error, 1)
    )
}

/// With a capital at the beginning.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// How the gap fares on what was set aside.
fn held_out(part: &HeldOut, with: bool) -> String {
    let all = &part.proof.all;
    let kind = part.kind.words();
    let gap = |x: f64| typeset(&fixed(x, 2));
    if !with {
        return format!(
            "On {} {kind} that were set aside the gap is {} standard deviations of the noise.",
            all.replicates,
            gap(all.before)
        );
    }
    let interval = if all.lower.is_finite() && all.upper.is_finite() {
        format!(" (95 % interval {} to {})", percent(all.lower), percent(all.upper))
    } else {
        " (too few for an interval)".to_owned()
    };
    let outcome = if part.proof.shrank { "It shrank" } else { "That it shrank is not shown" };
    format!(
        "On {} {kind} that were set aside the gap is {} standard deviations of the noise without and {} with what was found: {} of it closed{interval}. {outcome}.",
        all.replicates,
        gap(all.before),
        gap(all.after),
        percent(all.closed),
    )
}
