//! What the model misses: the verdict, where the gap is, what explains it, and whether it shrinks.

mod figures;
mod insight;
mod tables;

use maud::html;

use crate::gap::name::Word;
use crate::report::findings::Findings;
use crate::report::gap::{sentences, verdict};
use crate::report::page::{Numbers, Section, paragraph};

/// The gap, where it was searched for.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let gap = findings.gap.as_ref()?;
    let account = &gap.account;
    let said = sentences(findings, gap);
    let good = matches!(account.verdict.word, Word::None | Word::Named);
    let content = html! {
        p.verdict.good[good] { b { (paragraph(&verdict(account))) } }
        @for sentence in said.iter().skip(1) { p { (paragraph(sentence)) } }
        @if !account.verdict.reasons.is_empty() {
            ul { @for reason in &account.verdict.reasons { li { (paragraph(reason)) } } }
        }
        @if !gap.held_out().is_empty() {
            (tables::held_out(gap, numbers))
            (tables::scores(findings, gap, numbers))
        }
        (figures::maps(findings, account, numbers))
        (figures::curves(findings, account, numbers))
        (figures::differences(findings, account, numbers))
        @if let Some(step) = account.path.iter().find(|step| !step.leaders.is_empty()) {
            (figures::leaders(step, numbers))
        }
        @if !account.path.is_empty() { (tables::path(account, numbers)) }
        (insight::all(findings, account, numbers))
        (tables::parameters(gap, numbers))
        (tables::visible(account, numbers))
        (tables::noise(findings, account, numbers))
        @if let Some(added) = &gap.added {
            p {
                "The study with what was missing is " code { (added.study.display()) } "; its run is in "
                code { (added.run.display()) } "."
            }
        }
    };
    Some(Section { id: "gap", title: "What the model misses", content })
}
