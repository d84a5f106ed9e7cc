//! Code that made an artifact: the version of the program, and the revisions of the stage and of the plugins involved.
//!
//! A revision is a number that is raised whenever the results of a stage or plugin change. The test `revisions`
//! recomputes small artifacts and fails if their numbers change and the revision does not.

use std::collections::BTreeMap;

use lacuna::plugin::identity::MARK;
use lacuna::run::{Stop, files};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::stage::{Depends, Folder, Stage};

/// Code that made an artifact, as far as the artifact depends on it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MadeBy {
    /// Version of Lacuna.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lacuna: Option<String>,
    /// Revision of the stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<u32>,
    /// Revisions above one of the plugins, by kind and name as in `sampler.metropolis`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub plugins: BTreeMap<String, u32>,
}

impl MadeBy {
    fn of(stage: Stage, version: &str, mut plugins: BTreeMap<String, u32>) -> Self {
        plugins.retain(|_, revision| *revision > 1);
        match stage.depends() {
            Depends::OnNothing => Self::default(),
            Depends::OnRevisions(1) => Self { lacuna: None, stage: None, plugins },
            Depends::OnRevisions(stage) => Self { lacuna: None, stage: Some(stage), plugins },
            Depends::OnVersion(stage) => {
                Self { lacuna: Some(version.to_owned()), stage: Some(stage), plugins }
            }
        }
    }

    /// The difference from another record, phrased to follow "made by".
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

/// Hashes that identify a requested artifact.
pub(super) struct Asked {
    /// Hash of the inputs alone.
    pub alone: String,
    /// Hash of the inputs and of the code.
    pub whole: String,
    /// Code that makes the artifact.
    pub made_by: MadeBy,
}

impl Asked {
    /// `libraries` are the hashes of the files of plugins that the study loads: what any of them computes from the draws is
    /// computed again if one changes, whatever the stage names among its inputs.
    pub fn of(
        folder: &Folder,
        inputs: &impl Serialize,
        version: &str,
        libraries: &[String],
    ) -> Result<Self, Stop> {
        let wrong = |error| Stop::new(format!("cannot hash the inputs of {folder}: {error}"));
        let mut value = serde_json::to_value(inputs).map_err(wrong)?;
        if folder.stage() >= Stage::Calibrate && !libraries.is_empty() {
            value = serde_json::json!([value, libraries]);
        }
        let mut plugins = BTreeMap::new();
        strip(&mut value, &mut plugins);
        let text = serde_json::to_string(&(folder.name(), &value)).map_err(wrong)?;
        let alone = files::hash(text.as_bytes());
        let made_by = MadeBy::of(folder.stage(), version, plugins);
        // An artifact that depends on no code keeps the hash it had before revisions were recorded.
        let whole = if made_by == MadeBy::default() {
            alone.clone()
        } else {
            files::hash(serde_json::to_string(&(&text, &made_by)).map_err(wrong)?.as_bytes())
        };
        Ok(Self { alone, whole, made_by })
    }
}

/// Replaces each plugin by its identity and collects the revisions.
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
    use lacuna::plugin::identity::Plugin;
    use serde_json::json;

    use super::*;

    fn plugin(revision: u32) -> Plugin<Value> {
        let revisions = BTreeMap::from([("sampler.x".to_owned(), revision)]);
        Plugin { identity: json!(["x", { "steps": 3 }]), revisions }
    }

    fn asked(stage: Stage, revision: u32, version: &str) -> Asked {
        Asked::of(&stage.folder(), &(1, plugin(revision)), version, &[]).unwrap()
    }

    #[test]
    fn each_stage_depends_on_what_it_should() {
        let differ = |stage: Stage, a: (u32, &str), b: (u32, &str)| {
            let (a, b) = (asked(stage, a.0, a.1), asked(stage, b.0, b.1));
            assert_eq!(a.alone, b.alone, "{stage:?}: the study is the same");
            a.whole != b.whole
        };
        for (stage, by_version, by_revision) in [
            (Stage::Design, false, false),
            (Stage::Simulate, false, true),
            (Stage::Calibrate, true, true),
        ] {
            assert_eq!(differ(stage, (1, "0.1.0"), (1, "0.2.0")), by_version, "{stage:?}");
            assert_eq!(differ(stage, (1, "0.1.0"), (2, "0.1.0")), by_revision, "{stage:?}");
        }
    }

    #[test]
    fn runs_that_were_made_before_revisions_were_recorded_are_found() {
        // The hash of the inputs in the earlier format: name and options of each plugin.
        let before = files::hash(br#"["2-simulate",[1,["x",{"steps":3}]]]"#);
        assert_eq!(asked(Stage::Simulate, 1, "0.1.0").whole, before);
    }

    #[test]
    fn a_difference_is_told_in_words() {
        let (old, new) = (asked(Stage::Calibrate, 1, "0.1.0"), asked(Stage::Calibrate, 3, "0.2.0"));
        assert_eq!(
            new.made_by.difference(&old.made_by, "0.1.0"),
            "lacuna 0.1.0, and this is lacuna 0.2.0; revision 1 of `sampler.x`, which now has \
             revision 3"
        );
    }
}
