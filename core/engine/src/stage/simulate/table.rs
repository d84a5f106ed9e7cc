//! Runs as tables and files.

use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::Artifact;

use super::{Made, RunRecord, Simulated};

/// Name of the table of the runs of a scenario.
pub const TABLE: &str = "runs.csv";
const FOLDERS: &str = "scenarios.json";

impl Artifact for Simulated {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let mut names = Vec::new();
        for made in &self.scenarios {
            let folder = inside(folder, &made.folder);
            files::write_atomic(&folder.join(TABLE), self.table(&made.runs).as_bytes())?;
            let seconds: String = std::iter::once("run,seconds\n".to_owned())
                .chain(made.runs.iter().map(|r| format!("{},{:.3}\n", r.run, r.seconds)))
                .collect();
            // Times differ from machine to machine: they are kept for information and are not part of the result.
            files::write_atomic(&folder.join("seconds.csv"), seconds.as_bytes())?;
            names.push(made.folder.join(TABLE).display().to_string());
        }
        if self.scenarios.iter().any(|made| !made.folder.as_os_str().is_empty()) {
            let folders: Vec<&PathBuf> = self.scenarios.iter().map(|made| &made.folder).collect();
            files::write_json(&folder.join(FOLDERS), &folders)?;
            names.push(FOLDERS.to_owned());
        }
        Ok(names)
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let folders: Vec<PathBuf> = if folder.join(FOLDERS).is_file() {
            files::read_json(&folder.join(FOLDERS))?
        } else {
            vec![PathBuf::new()]
        };
        let mut all =
            Self { scenarios: Vec::new(), parameters: Vec::new(), points: Matrix::default() };
        for inner in folders {
            let (runs, parameters, points) = from_table(&inside(folder, &inner).join(TABLE))?;
            all.scenarios.push(Made { folder: inner, runs });
            (all.parameters, all.points) = (parameters, points);
        }
        Ok(all)
    }
}

impl Simulated {
    /// Table `runs.csv`: `run`, `file`, `status`, `valid`, `reason`, `sha256` and one column per parameter.
    fn table(&self, runs: &[RunRecord]) -> String {
        let mut text =
            format!("run,file,status,valid,reason,sha256,{}\n", self.parameters.join(","));
        for (record, point) in runs.iter().zip(self.points.iter_rows()) {
            let status = if record.file.is_some() { "done" } else { "failed" };
            let reason = record.reason.as_deref().unwrap_or("").replace('"', "\"\"");
            let values: Vec<String> = point.iter().map(ToString::to_string).collect();
            text.push_str(&format!(
                "{},{},{status},{},\"{reason}\",{},{}\n",
                record.run,
                record.file.as_deref().unwrap_or(""),
                record.valid,
                record.sha256.as_deref().unwrap_or(""),
                values.join(",")
            ));
        }
        text
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &RunRecord> {
        self.scenarios.iter().flat_map(|made| &made.runs)
    }

    /// Number of failed runs, summed over all scenarios.
    pub fn failures(&self) -> usize {
        self.all().filter(|r| r.file.is_none()).count()
    }

    /// Number of result files that are missing or have changed.
    pub(super) fn damaged(&self, folder: &Path) -> usize {
        let of = |made: &Made| {
            let folder = inside(folder, &made.folder);
            made.runs.iter().filter(|r| r.file.is_some() && !is_whole(r, &folder)).count()
        };
        self.scenarios.iter().map(of).sum()
    }
}

/// Reads the runs of a table with the names and values of their parameters.
pub fn from_table(path: &Path) -> Result<(Vec<RunRecord>, Vec<String>, Matrix), Stop> {
    let bad = |what: String| Stop::new(format!("cannot read {}: {what}", path.display()));
    let bytes = files::read(path)?;
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let header = reader.headers().map_err(|e| bad(e.to_string()))?.clone();
    let parameters: Vec<String> = header.iter().skip(6).map(str::to_owned).collect();
    let mut runs = Vec::new();
    let mut points = Matrix::zeros(0, parameters.len());
    for row in reader.records() {
        let row = row.map_err(|e| bad(e.to_string()))?;
        let some = |i: usize| row.get(i).filter(|t| !t.is_empty()).map(str::to_owned);
        runs.push(RunRecord {
            run: some(0).unwrap_or_default(),
            file: some(1),
            valid: row.get(3) == Some("true"),
            reason: some(4),
            sha256: some(5),
            seconds: 0.0,
        });
        let values: Result<Vec<f64>, _> = row.iter().skip(6).map(str::parse).collect();
        points.push_row(&values.map_err(|e| bad(format!("a parameter: {e}")))?);
    }
    Ok((runs, parameters, points))
}

/// Folder of a scenario's runs inside that of all.
pub fn inside(folder: &Path, own: &Path) -> PathBuf {
    if own.as_os_str().is_empty() { folder.to_owned() } else { folder.join(own) }
}

pub fn is_whole(record: &RunRecord, folder: &Path) -> bool {
    record.file.as_ref().is_some_and(|file| {
        files::hash_file(&folder.join(file)).is_ok_and(|hash| record.sha256.as_ref() == Some(&hash))
    })
}
