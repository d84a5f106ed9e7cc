//! What other versions made, in a run directory.

use std::fs;
use std::path::PathBuf;

use super::directory::{Finished, RECORD, Record, finished};
use super::made_by::MadeBy;
use super::{RunDirectory, files};

impl RunDirectory {
    /// The hash with which a stage stands in its folder, where it is taken whatever made it and was made from these inputs.
    pub(super) fn looked_at(&self, stage: &str, alone: &str) -> Option<String> {
        let folder = self.stage_folder(stage);
        let record: Option<Record> =
            files::read_json(&folder.join(RECORD)).ok().filter(|_| self.looking);
        let record = record.filter(|record| record.is_of(alone))?;
        // What is damaged is made again, under what it is made from now.
        let whole = matches!(finished(&folder, &record.inputs), Finished::Whole(_));
        whole.then_some(record.inputs)
    }

    /// Why a stage that was finished is not taken although the study asks for the same, if that is so.
    pub(super) fn made_otherwise(
        &self,
        stage: &str,
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
            // Set aside where it is not already.
            let place = if *folder == self.stage_folder(stage) {
                self.aside(stage, &record.inputs)
            } else {
                folder.clone()
            };
            let kept = place.strip_prefix(&self.root).unwrap_or(&place).display();
            return Some(format!("it was made by {difference}; what was made is kept in {kept}"));
        }
        let here = all.iter().find(|(folder, _)| *folder == self.stage_folder(stage));
        here.filter(|(_, record)| self.remade && record.lacuna != self.version).map(
            |(_, record)| {
                format!("lacuna {} made it from results that are made again now", record.lacuna)
            },
        )
    }

    /// The records of a stage in this run directory, set aside or not, each with its folder.
    fn finished_before(&self, stage: &str) -> Vec<(PathBuf, Record)> {
        let aside = fs::read_dir(self.root.join(".kept")).into_iter().flatten().flatten();
        let mut folders: Vec<PathBuf> = aside
            .filter(|entry| {
                let name = entry.file_name().to_string_lossy().into_owned();
                name.rsplit_once('-').is_some_and(|(own, _)| own == stage)
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
