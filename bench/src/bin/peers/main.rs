//! Lacuna's part of the comparison with other programs: `bench/peers.sh` runs it, job after job.
//!
//! `peers JOB FOLDER` with the jobs `problem`, `polynomial_chaos`, `ensemble`, `evaluation`, `gaussian_process` and
//! `evidence`. The first writes the data of all others into the folder; each of the others writes its results to
//! `FOLDER/lacuna_JOB.json`. Seconds are processor time.

mod inference;
mod problem;
mod surrogates;

use std::error::Error;
use std::fs;
use std::path::Path;

use serde_json::Value;

type Fallible<T> = Result<T, Box<dyn Error>>;

fn main() -> Fallible<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [job, folder] = &arguments[..] else { return Err("usage: peers JOB FOLDER".into()) };
    let folder = Path::new(folder);
    let figures: Value = match &job[..] {
        "problem" => return problem::write(folder),
        "polynomial_chaos" => surrogates::polynomial_chaos(folder)?,
        "gaussian_process" => surrogates::gaussian_process(folder)?,
        "evaluation" => surrogates::evaluation(folder)?,
        "ensemble" => inference::ensemble(folder)?,
        "evidence" => inference::evidence(folder)?,
        other => return Err(format!("there is no job `{other}`").into()),
    };
    let text = serde_json::to_string_pretty(&figures)?;
    Ok(fs::write(folder.join(format!("lacuna_{job}.json")), text)?)
}
