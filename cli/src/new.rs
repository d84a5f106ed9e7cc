//! `new`: skeletons.

mod library;
mod plugin;
mod skeleton;
mod study;
#[cfg(test)]
mod tests;
mod tree;

use std::path::PathBuf;

use crate::Failure;

/// What can be made new.
#[derive(clap::Subcommand)]
pub enum What {
    /// A folder with a study that runs as it stands: `NAME/study.toml` and its measured data.
    Study {
        /// The folder to make.
        name: PathBuf,
    },
    /// A plugin that works as it stands: one file in Lacuna's source, or a library of its own.
    Plugin {
        /// The kind, such as `sampler`.
        kind: String,
        /// The name by which a study will choose it, such as `random_walk`.
        name: String,
        /// Make a library in this folder, outside Lacuna's source; a study loads it with `[plugins]`.
        #[arg(long, value_name = "FOLDER")]
        library: Option<PathBuf>,
        /// Lacuna's source, which holds the SDK of the library; when left out, that around the current folder or the one
        /// that this program was built from.
        #[arg(long, value_name = "FOLDER", requires = "library")]
        source: Option<PathBuf>,
    },
}

/// `lacuna new …`
pub fn write(what: &What) -> Result<(), Failure> {
    match what {
        What::Study { name } => study::write(name),
        What::Plugin { kind, name, library, source } => {
            plugin::write(kind, name, library.as_deref(), source.as_deref())
        }
    }
}
