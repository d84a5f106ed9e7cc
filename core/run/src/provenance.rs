//! Results of other versions in a run directory.

use std::fs;
use std::path::PathBuf;

use lacuna::run::files;

use crate::RunDirectory;
use crate::directory::{Finished, RECORD, Record, finished};
use crate::made_by::MadeBy;
use crate::stage::Folder;

impl RunDirectory {
    /// Hash under which a stage is stored, if results are reused whatever code made them and this one has these inputs, or
    /// inputs that cannot be told any more.
    pub(super) fn looked_at(&self, stage: &Folder, alone: &str) -> Option<String> {
        let folder = self.stage_folder(stage);
        let record: Option<Record> =
            files::read_json(&folder.join(RECORD)).ok().filter(|_| self.looking);
        let record = record.filter(|record| self.as_recorded || record.is_of(alone))?;
        // A damaged result is repeated, under the hash of the present code.
        let whole = matches!(finished(&folder, &record.inputs), Finished::Whole(_));
        whole.then_some(record.inputs)
    }

    /// Reason why a finished stage with the same inputs is not reused; `None` if there is none.
    pub(super) fn made_otherwise(
        &self,
        stage: &Folder,
        alone: &str,
        inputs: &str,
        made_by: &MadeBy,
    ) -> Option<String> {
        let all = self.finished_before(stage);
        if all.iter().any(|(_, record)| record.inputs == inputs) {
            return None;
        }
        if let Some((folder, record)) = all.iter().find(|(_, record)| record.is_of(alone)) {
            let difference = made_by.difference(&record.made_by, &record.lacuna);
            // The folder will have been moved aside, unless it already is.
            let place = if *folder == self.stage_folder(stage) {
                self.aside(stage, &record.inputs)
            } else {
                folder.clone()
            };
            let kept = place.strip_prefix(&self.root).unwrap_or(&place).display();
            return Some(format!(
                "it was made by {difference}; the earlier result is kept in {kept}"
            ));
        }
        let here = all.iter().find(|(folder, _)| *folder == self.stage_folder(stage));
        here.filter(|(_, record)| self.remade && record.lacuna != self.version).map(
            |(_, record)| {
                format!("lacuna {} made it from results that are now repeated", record.lacuna)
            },
        )
    }

    /// Records of a stage in this run directory, in place or moved aside, each with its folder.
    fn finished_before(&self, stage: &Folder) -> Vec<(PathBuf, Record)> {
        let aside = fs::read_dir(self.root.join(".kept")).into_iter().flatten().flatten();
        let mut folders: Vec<PathBuf> = aside
            .filter(|entry| {
                let name = entry.file_name().to_string_lossy().into_owned();
                name.rsplit_once('-').is_some_and(|(own, _)| own == stage.name())
            })
            .map(|entry| entry.path())
            .collect();
        folders.sort();
        folders.insert(0, self.stage_folder(stage));
        let record = |folder: PathBuf| {
            let record = files::read_json::<Record>(&folder.join(RECORD)).ok()?;
            Some((folder, record))
        };
        folders.into_iter().filter_map(record).collect()
    }
}
