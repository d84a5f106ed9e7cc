//! What made an artifact: the version of the program, and the revisions of the stage and of the plugins that took part.
//!
//! A revision is a number that whoever changes what a stage or plugin computes raises. The test `revisions` recomputes
//! small artifacts and fails when their numbers change and the revision does not.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{Stop, files};

/// The stages, by the last of these words in the names of their folders, with what their artifacts depend on.
pub const STAGES: [(&str, Depends); 13] = [
    ("design", Depends::OnNothing),
    ("simulate", Depends::OnRevisions(1)),
    ("read", Depends::OnVersion(1)),
    ("error", Depends::OnVersion(2)),
    ("surrogate", Depends::OnVersion(2)),
    ("calibrate", Depends::OnVersion(5)),
    ("evidence", Depends::OnVersion(2)),
    ("validate", Depends::OnVersion(3)),
    ("assess", Depends::OnVersion(4)),
    ("gap", Depends::OnVersion(2)),
    ("show", Depends::OnVersion(1)),
    ("power", Depends::OnVersion(1)),
    ("coverage", Depends::OnVersion(2)),
];

/// What the artifacts of a stage depend on besides its inputs; the number is the stage's revision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depends {
    /// On nothing: the points of a design are points whatever made them, and runs are made at them.
    OnNothing,
    /// On the revisions of the stage and of its plugins. Runs are dear and most often the work of somebody else's
    /// simulator: another version of Lacuna is no reason to make them again.
    OnRevisions(u32),
    /// On the version of the program too.
    OnVersion(u32),
}

/// What the artifacts in a folder depend on; those of a stage that is not listed depend on the version.
fn depends(folder: &str) -> Depends {
    let known = |word: &str| STAGES.iter().find(|(name, _)| *name == word).map(|(_, on)| *on);
    folder.rsplit('-').find_map(known).unwrap_or(Depends::OnVersion(1))
}

/// What made an artifact, as far as the artifact depends on it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MadeBy {
    /// The version of Lacuna.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lacuna: Option<String>,
    /// The revision of the stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<u32>,
    /// The revisions of the plugins that are above one, by kind and name as in `sampler.metropolis`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub plugins: BTreeMap<String, u32>,
}

impl MadeBy {
    fn of(folder: &str, version: &str, mut plugins: BTreeMap<String, u32>) -> Self {
        plugins.retain(|_, revision| *revision > 1);
        match depends(folder) {
            Depends::OnNothing => Self::default(),
            Depends::OnRevisions(1) => Self { lacuna: None, stage: None, plugins },
            Depends::OnRevisions(stage) => Self { lacuna: None, stage: Some(stage), plugins },
            Depends::OnVersion(stage) => {
                Self { lacuna: Some(version.to_owned()), stage: Some(stage), plugins }
            }
        }
    }

    /// What is different here from another, in words that follow "made by".
    pub(super) fn difference(&self, before: &Self, recorded: &str) -> String {
        let mut all = Vec::new();
        if self.lacuna.as_deref().is_some_and(|ours| ours != recorded) {
            let ours = self.lacuna.as_deref().unwrap_or_default();
            all.push(format!("lacuna {recorded}, and this is lacuna {ours}"));
        }
        if self.stage != before.stage && before.stage.is_some() {
            let [old, new] = [before.stage, self.stage].map(|r| r.unwrap_or(1));
            all.push(format!("revision {old} of the stage, which now has revision {new}"));
        }
        let names = self
            .plugins
            .keys()
            .chain(before.plugins.keys().filter(|name| !self.plugins.contains_key(*name)));
        for name in names {
            let [old, new] =
                [before, self].map(|made| made.plugins.get(name).copied().unwrap_or(1));
            if old != new {
                all.push(format!("revision {old} of `{name}`, which now has revision {new}"));
            }
        }
        if all.is_empty() {
            all.push(format!("lacuna {recorded}, before revisions were recorded"));
        }
        all.join("; ")
    }
}

/// The key that marks a plugin among the inputs of a stage; see [`Plugin`].
const MARK: &str = "plugin of a study";

/// A plugin among the inputs of a stage: what is hashed, and what only [`MadeBy`] records.
#[derive(Debug, Serialize)]
pub struct Plugin<I> {
    /// What its results depend on besides its code.
    #[serde(rename = "plugin of a study")]
    pub identity: I,
    /// The revisions of its code and of the plugins that it asks.
    pub revisions: BTreeMap<String, u32>,
}

/// The hashes of what a stage is asked for.
pub(super) struct Asked {
    /// Of the inputs alone.
    pub alone: String,
    /// Of the inputs and of what makes the artifact.
    pub whole: String,
    /// What makes it.
    pub made_by: MadeBy,
}

impl Asked {
    pub fn of(stage: &str, inputs: &impl Serialize, version: &str) -> Result<Self, Stop> {
        let wrong = |error| Stop::new(format!("cannot hash the inputs of {stage}: {error}"));
        let mut value = serde_json::to_value(inputs).map_err(wrong)?;
        let mut plugins = BTreeMap::new();
        strip(&mut value, &mut plugins);
        let text = serde_json::to_string(&(stage, &value)).map_err(wrong)?;
        let alone = files::hash(text.as_bytes());
        let made_by = MadeBy::of(stage, version, plugins);
        // What depends on no code has the hash that it had before revisions were recorded.
        let whole = if made_by == MadeBy::default() {
            alone.clone()
        } else {
            files::hash(serde_json::to_string(&(&text, &made_by)).map_err(wrong)?.as_bytes())
        };
        Ok(Self { alone, whole, made_by })
    }
}

/// Puts the identity in the place of each plugin and collects the revisions.
fn strip(value: &mut Value, plugins: &mut BTreeMap<String, u32>) {
    match value {
        Value::Object(table) if table.contains_key(MARK) => {
            let mut own: Map<String, Value> = std::mem::take(table);
            let revisions: Option<BTreeMap<String, u32>> =
                own.remove("revisions").and_then(|r| serde_json::from_value(r).ok());
            plugins.extend(revisions.unwrap_or_default());
            *value = own.remove(MARK).unwrap_or(Value::Null);
            strip(value, plugins);
        }
        Value::Object(table) => table.values_mut().for_each(|value| strip(value, plugins)),
        Value::Array(items) => items.iter_mut().for_each(|value| strip(value, plugins)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::json;

    use super::*;

    fn plugin(revision: u32) -> Plugin<Value> {
        let revisions = BTreeMap::from([("sampler.x".to_owned(), revision)]);
        Plugin { identity: json!(["x", { "steps": 3 }]), revisions }
    }

    fn asked(stage: &str, revision: u32, version: &str) -> Asked {
        Asked::of(stage, &(1, plugin(revision)), version).unwrap()
    }

    #[test]
    fn stages_are_known_by_the_last_word_of_their_folder() {
        for (folder, on) in [
            ("1-design", Depends::OnNothing),
            ("2-simulate-finer", Depends::OnRevisions(1)),
            ("5-refine-2-simulate", Depends::OnRevisions(1)),
            ("7-gap-read-surrogate", Depends::OnVersion(2)),
            ("6-unheard_of", Depends::OnVersion(1)),
        ] {
            assert_eq!(depends(folder), on, "{folder}");
        }
    }

    #[test]
    fn each_stage_depends_on_what_it_should() {
        let differ = |stage: &str, a: (u32, &str), b: (u32, &str)| {
            let (a, b) = (asked(stage, a.0, a.1), asked(stage, b.0, b.1));
            assert_eq!(a.alone, b.alone, "{stage}: the study is the same");
            a.whole != b.whole
        };
        for (stage, by_version, by_revision) in [
            ("1-design", false, false),
            ("2-simulate", false, true),
            ("5-calibrate", true, true),
            ("6-unheard_of", true, true),
        ] {
            assert_eq!(differ(stage, (1, "0.1.0"), (1, "0.2.0")), by_version, "{stage}");
            assert_eq!(differ(stage, (1, "0.1.0"), (2, "0.1.0")), by_revision, "{stage}");
        }
    }

    #[test]
    fn runs_that_were_made_before_revisions_were_recorded_are_found() {
        // The hash of the inputs as they were: name and options of each plugin.
        let before = files::hash(br#"["2-simulate",[1,["x",{"steps":3}]]]"#);
        assert_eq!(asked("2-simulate", 1, "0.1.0").whole, before);
    }

    #[test]
    fn a_difference_is_told_in_words() {
        let (old, new) = (asked("5-calibrate", 1, "0.1.0"), asked("5-calibrate", 3, "0.2.0"));
        assert_eq!(
            new.made_by.difference(&old.made_by, "0.1.0"),
            "lacuna 0.1.0, and this is lacuna 0.2.0; revision 1 of `sampler.x`, which now has \
             revision 3"
        );
    }
}
