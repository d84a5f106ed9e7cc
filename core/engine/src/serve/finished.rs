//! Results of a finished run, read from its folder.

use std::path::Path;

use lacuna::run::{Stop, files};
use lacuna::text::emit;
use lacuna_run::RunDirectory;

use crate::study::Study;

/// Run directory of a study, if a run of this very study is finished there; `None` if there is no run.
pub fn finished(study: &Study, folder: &Path) -> Result<Option<RunDirectory>, Stop> {
    if !folder.join("manifest.json").exists() {
        return Ok(None);
    }
    let kept = files::read(&folder.join("resolved.toml"))?;
    let kept = String::from_utf8_lossy(&kept);
    let ours = emit::to_toml(&study.resolved)
        .map_err(|error| Stop::new(format!("the study cannot be written down: {error}")))?;
    // The head names the version of the program and is not compared.
    if kept.split_once("\n\n").is_none_or(|(_, kept)| kept != ours) {
        let folder = folder.display();
        let message = format!("the run in {folder} was made from another version of the study");
        return Err(Stop::new(message).help(format!(
            "run the study again, or serve the run's own: `{folder}/resolved.toml` with `--out {folder}`"
        )));
    }
    let mut run = RunDirectory::open(folder)?;
    run.look();
    Ok(Some(run))
}
