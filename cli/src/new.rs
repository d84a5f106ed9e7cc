//! `new`: skeletons.

use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use lacuna::study::emit;

use crate::{Failure, print};

/// What can be made new.
#[derive(clap::Subcommand)]
pub enum What {
    /// A folder with a study that runs as it stands: `NAME/study.toml` and its measured data.
    Study {
        /// The folder to make.
        name: PathBuf,
    },
}

/// `lacuna new …`
pub fn write(what: &What) -> Result<(), Failure> {
    match what {
        What::Study { name } => study(name),
    }
}

const STUDY: &str = include_str!("new/study.toml");
/// What the skeleton calls itself; the folder's name takes its place.
const NAME: &str = "\"oscillator\"";
const RUNS: &str = include_str!("new/runs.csv");
const RESPONSES: &str = include_str!("new/responses.csv");
const MEASURED: &str = include_str!("new/measured.csv");

fn study(folder: &Path) -> Result<(), Failure> {
    if folder.exists() {
        let stop = Stop::new(format!("{} is there already", folder.display()));
        return Err(stop.help("choose another name").into());
    }
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let named = STUDY.replace(NAME, &emit::string(&name));
    let all = [
        ("study.toml", named.as_str()),
        ("runs.csv", RUNS),
        ("responses.csv", RESPONSES),
        ("measured.csv", MEASURED),
    ];
    for (file, text) in all {
        files::write_atomic(&folder.join(file), text.as_bytes())?;
    }
    print(&format!("wrote {0}; run it with `lacuna run {0}/study.toml`", folder.display()));
    Ok(())
}
