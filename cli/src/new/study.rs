//! Skeleton of a study that runs as it is.

use std::path::Path;

use lacuna::run::{Stop, files};
use lacuna::text::emit;
use lacuna_engine::study::language;

use crate::print;

const STUDY: &str = include_str!("study.toml");
/// Name in the skeleton, replaced by that of the folder.
const NAME: &str = "\"oscillator\"";
const RUNS: &str = include_str!("runs.csv");
const RESPONSES: &str = include_str!("responses.csv");
const MEASURED: &str = include_str!("measured.csv");

/// Creates the folder.
pub fn write(folder: &Path) -> anyhow::Result<()> {
    if folder.exists() {
        let stop = Stop::new(format!("{} is there already", folder.display()));
        return Err(stop.help("choose another name").into());
    }
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let named = STUDY.replace(NAME, &emit::string(&name));
    let schema = language::schema_text();
    let all = [
        ("study.toml", named.as_str()),
        // Named in the first line of the study, from where editors take it.
        ("study.schema.json", schema.as_str()),
        ("runs.csv", RUNS),
        ("responses.csv", RESPONSES),
        ("measured.csv", MEASURED),
    ];
    let write =
        |(file, text): (&str, &str)| files::write_atomic(&folder.join(file), text.as_bytes());
    if let Err(stop) = all.into_iter().try_for_each(write) {
        // A part of a skeleton would be in the way of the next attempt.
        let _ = std::fs::remove_dir_all(folder);
        return Err(stop.into());
    }
    print(&format!("wrote {0}; run it with `lacuna run {0}/study.toml`", folder.display()));
    Ok(())
}
