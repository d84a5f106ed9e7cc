//! Finished runs that were made outside the study: by hand, or by another study.

use std::fs;
use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::Artifact as _;

use super::simulate::{Made, Roll, RunRecord, Simulated, inside};
use crate::study::Study;

/// Finished runs in a folder with the layout of the simulate stage.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// Path of the folder.
    pub folder: PathBuf,
    /// Names of the runs.
    pub names: Vec<String>,
    /// Parameters of each run, in the study's order and units (`runs x parameters`).
    pub points: Matrix,
    /// For each scenario its folder and the records of the runs.
    scenarios: Vec<(PathBuf, Vec<RunRecord>)>,
    /// Hash of all runs.
    pub hash: String,
}

/// The folders that a study imports, in the study's order.
pub fn read(study: &Study) -> Result<Vec<Imported>, Stop> {
    let Some(design) = &study.design else { return Ok(Vec::new()) };
    design.common.imports.iter().map(|path| of_folder(study, &study.directory.join(path))).collect()
}

/// The runs of one folder that have a result in every scenario.
pub fn of_folder(study: &Study, folder: &Path) -> Result<Imported, Stop> {
    let wrong = |what: String| {
        Stop::new(format!("the runs in {} cannot be imported: {what}", folder.display()))
            .help("`imports` in `[design]` takes folders such as `2-simulate` of a run directory, or what `lacuna campaign import RUN TABLE` makes")
    };
    let made = Simulated::load(folder).map_err(|stop| wrong(stop.message))?;
    let places = scenarios(study, folder, &made).map_err(wrong)?;
    let column = |name: &String| {
        let place = made.parameters.iter().position(|known| known == name);
        place.ok_or_else(|| wrong(format!("{} has no column `{name}`", super::simulate::TABLE)))
    };
    let columns =
        study.parameters.iter().map(|p| column(&p.name)).collect::<Result<Vec<_>, _>>()?;
    let ours: Vec<&Made> = places.iter().map(|&place| &made.scenarios[place]).collect();
    let first = &ours[0].runs;
    let is_done = |i: &usize| ours.iter().all(|s| s.runs.get(*i).is_some_and(|r| r.file.is_some()));
    let rows: Vec<usize> = (0..first.len()).filter(is_done).collect();
    let names: Vec<String> = rows.iter().map(|&i| first[i].run.clone()).collect();
    let point = |&i: &usize| columns.iter().map(|&j| made.points[(i, j)]).collect::<Vec<f64>>();
    let points = Matrix::from_rows(columns.len(), rows.iter().map(point));
    let mut scenarios = Vec::new();
    let mut lines = String::new();
    for scenario in ours {
        let runs: Vec<RunRecord> = rows.iter().map(|&i| scenario.runs[i].clone()).collect();
        for run in &runs {
            let (file, hash) = (run.file.as_deref(), run.sha256.as_deref());
            lines.push_str(&format!("{} {file:?} {hash:?}\n", run.run));
        }
        scenarios.push((scenario.folder.clone(), runs));
    }
    let hash = files::hash(format!("{lines}{:?}", points.as_slice()).as_bytes());
    Ok(Imported { folder: folder.to_owned(), names, points, scenarios, hash })
}

/// Index of each of the study's scenarios among those of the runs: by name if the folder records the names.
fn scenarios(study: &Study, folder: &Path, made: &Simulated) -> Result<Vec<usize>, String> {
    let roll = Roll::read(folder).map_err(|stop| stop.message)?;
    let roll = roll.filter(|roll| roll.scenarios.len() == made.scenarios.len());
    let Some(roll) = roll else {
        let (found, expected) = (made.scenarios.len(), study.scenarios.len());
        let all = (0..expected).collect();
        let plural = if found == 1 { "" } else { "s" };
        return (found == expected).then_some(all).ok_or_else(|| {
            format!("they are of {found} scenario{plural}, and the study has {expected}")
        });
    };
    let place = |name: &String| {
        let found = roll.scenarios.iter().position(|(known, _)| known == name);
        found.ok_or_else(|| {
            let known: Vec<String> =
                roll.scenarios.iter().map(|(known, _)| format!("`{known}`")).collect();
            let scenario = if name.is_empty() {
                "a study without scenarios".to_owned()
            } else {
                format!("the scenario `{name}`")
            };
            format!("they are not of {scenario}, but of {}", known.join(", "))
        })
    };
    study.scenarios.iter().map(|scenario| place(&scenario.name)).collect()
}

impl Imported {
    /// Places the result of a run of a scenario into a folder, unchanged.
    pub(super) fn bring(
        &self,
        scenario: usize,
        run: &str,
        target: &Path,
    ) -> Result<Option<RunRecord>, Stop> {
        let Some((own, records)) = self.scenarios.get(scenario) else { return Ok(None) };
        let Some(record) = records.iter().find(|record| record.run == run) else { return Ok(None) };
        let Some(file) = &record.file else { return Ok(None) };
        let from = inside(&self.folder, own).join(file);
        let hash = files::hash_file(&from)?;
        if record.sha256.as_ref() != Some(&hash) {
            let message = format!("{} is not as it was imported", from.display());
            return Err(Stop::new(message)
                .help("import the run again, or take its folder out of `imports` in `[design]`"));
        }
        let to = target.join(file);
        if fs::hard_link(&from, &to).is_err() {
            files::write_atomic(&to, &files::read(&from)?)?;
        }
        Ok(Some(record.clone()))
    }
}
