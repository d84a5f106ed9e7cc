//! The section of the report on the gap: verdict, regions of disagreement, effects, and proof on held-out data.

mod figures;
mod insight;
mod law;
pub mod next;
mod picture;
pub mod power;
mod proof;
pub mod reliability;
mod sentences;
mod tables;

use lacuna::data::{Layouts, Parameter};
use maud::html;

use crate::gap::result::GapFindings;
use crate::gap::search::VerdictKind;
use crate::page::scale::ShownUnit;
use crate::page::{Numbers, Section, paragraph};

pub use sentences::{on, text, verdict};

/// Layouts, parameters and units with which the gap is shown.
pub struct View<'a> {
    /// The layouts of the responses.
    pub layouts: &'a Layouts,
    /// The parameters of the model.
    pub parameters: &'a [Parameter],
    /// The unit in which the response is shown.
    pub response: ShownUnit,
}

impl View<'_> {
    /// The label of an axis that shows the response.
    fn label(&self) -> String {
        self.response.label(self.layouts.name())
    }
}

/// The section on the gap.
pub fn section(view: &View<'_>, gap: &GapFindings, numbers: &mut Numbers) -> Section {
    let result = &gap.result;
    let said = sentences::sentences(view, gap);
    let good = matches!(result.verdict.word, VerdictKind::None | VerdictKind::Named);
    let content = html! {
        p.verdict.good[good] { b { (paragraph(&verdict(result))) } }
        @for sentence in said.iter().skip(1) { p { (paragraph(sentence)) } }
        @if !result.verdict.reasons.is_empty() {
            ul { @for reason in &result.verdict.reasons { li { (paragraph(reason)) } } }
        }
        (picture::figure(view, result, numbers))
        @if !gap.held_out().is_empty() {
            (tables::held_out(gap, numbers))
            (tables::scores(view, gap, numbers))
        }
        @if let Some(proof) = gap.proof().filter(|proof| !proof.rivals.is_empty()) {
            (proof::table(gap, &proof, numbers))
        }
        (figures::maps(view, result, numbers))
        (figures::curves(view, result, numbers))
        (figures::differences(view, result, numbers))
        @if let Some(step) = result.path.iter().find(|step| !step.leaders.is_empty()) {
            (figures::leaders(step, numbers))
        }
        @if !result.path.is_empty() { (tables::path(result, numbers)) }
        @if let Some(counted) = &result.reliability {
            (reliability::figure(&[("before the correction by this count", counted)], numbers))
        }
        (insight::all(view, result, numbers))
        (law::figures(view, result, numbers))
        @if let Some(warning) = proof::warning(gap) { p { b { (paragraph(&warning)) } } }
        (tables::parameters(gap, numbers))
        @if let Some(averages) = proof::averages(gap, numbers) { (averages) }
        (tables::visible(result, numbers))
        (tables::noise(view, result, numbers))
        @if let Some(added) = &gap.added {
            p {
                "The study with what was missing is " code { (added.study.display()) } "; its run is in "
                code { (added.run.display()) } "."
            }
        }
    };
    Section { id: "gap", title: "What the model misses", content }
}
