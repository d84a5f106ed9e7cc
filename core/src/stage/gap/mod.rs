//! Stage 7: where data and calibrated model disagree, what is missing, and whether the gap shrinks with it.
//!
//! What proves is set aside before anything is looked at: the stage calibrates anew, with the rest alone.

pub mod add;
mod models;
mod own;
pub(super) mod search;
pub mod show;
mod study_file;

use std::path::Path;

use serde_json::{Value, json};

use crate::gap::account::Account;
use crate::gap::name::Word;
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop, files};
use crate::study::Study;

use super::Known;
use super::gap_model::{self, Pieces};
use models::Models;
use search::Inside;

const FOLDER: &str = "7-gap";
const FILE: &str = "gap.toml";

impl Artifact for Account {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_toml(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_toml(&folder.join(FILE))
    }
}

/// Searches for what is missing; `None` where the study has no measurements.
pub fn stage(
    study: &Study,
    known: &Known<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Account>>, Stop> {
    let Some(measured) = &known.data.value.measured else { return Ok(None) };
    let pieces = Pieces::of(study)?;
    let inside = Inside::of(pieces.as_ref(), study, known, run, observer)?;
    let rivals = gap_model::rivals(study, known, run, observer)?;
    observer.begin("gap", "", 0);
    let kept = run.keep(FOLDER, &inputs(study, known), observer, |_| {
        Models { study, known, inside: &inside, rivals: &rivals, measured }.account(observer)
    })?;
    observer.end("gap", &summary(&kept.value));
    Ok(Some(kept))
}

/// What the stage found in an earlier run with the same inputs.
pub fn kept(
    study: &Study,
    known: &Known<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Account>>, Stop> {
    if run.has(FOLDER, &inputs(study, known))? {
        return stage(study, known, run, observer);
    }
    Ok(None)
}

/// Everything that the search depends on.
pub(super) fn inputs(study: &Study, known: &Known<'_>) -> Value {
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.prior)).collect();
    let effects: Vec<_> = study.effects.iter().map(|e| (e.built.identity(), &e.common)).collect();
    let candidates = study.gap.candidates.iter();
    let candidates: Vec<_> = candidates.map(|c| (c.built.identity(), &c.common)).collect();
    json!([
        known.data.hash,
        known.origin,
        known.numerics.map(|n| &n.hash),
        study.numerical_error.as_ref().map(|section| section.written.scales()),
        known.region,
        laws,
        effects,
        study.gap.keys,
        pieces(study),
        candidates,
        study.about.seed,
    ])
}

/// What the study says of pieces inside its model.
fn pieces(study: &Study) -> Value {
    let inside = &study.gap.inside;
    let terms = inside.terms.iter().map(|t| (t.built.identity(), &t.common));
    let models = inside.models.iter().map(|m| (m.section.built.identity(), &m.keys));
    json!([inside.switches, terms.collect::<Vec<_>>(), models.collect::<Vec<_>>()])
}

fn summary(account: &Account) -> String {
    let names: Vec<&str> = account.additions.iter().map(|a| a.name.as_str()).collect();
    match account.verdict.word {
        Word::None => "data and model agree within the noise".to_owned(),
        Word::Named => format!("missing: {}", names.join(", ")),
        Word::Class => {
            let class: Vec<&str> =
                account.additions.iter().flat_map(|a| a.class.iter().map(String::as_str)).collect();
            format!("missing: one of {}", class.join(", "))
        }
        Word::Unlisted => match (account.explained(), &names[..]) {
            (_, []) => "something is missing that no candidate explains".to_owned(),
            (None, _) => {
                format!("something is missing without a sure name; nearest: {}", names.join(", "))
            }
            (Some(share), _) => format!(
                "something is missing without a sure name; {:.0} % of it explained by: {}",
                100.0 * share,
                names.join(", ")
            ),
        },
        Word::NotVisible => "whatever may be missing, the parameters absorb it".to_owned(),
    }
}
