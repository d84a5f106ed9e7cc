//! Command `new`: skeletons of studies and plugins.

mod language;
mod library;
mod plugin;
mod skeleton;
mod study;
#[cfg(test)]
mod tests;
mod tree;

use std::path::PathBuf;

use language::Language;

/// Type of skeleton.
#[derive(clap::Subcommand)]
pub enum What {
    /// A folder with a study that runs as it is: `NAME/study.toml`, its measured data, and the schema for editors
    Study {
        /// Folder to create
        name: PathBuf,
    },
    /// A plugin that works as it is: one file in Lacuna's source, a library of its own, or a file in another language
    Plugin {
        /// Kind, such as `sampler`
        kind: String,
        /// Name by which a study chooses the plugin, such as `random_walk`
        name: String,
        /// Language of the plugin; a file in another one than Rust is written into the current folder
        #[arg(long, value_enum, default_value = "rust")]
        language: language::Language,
        /// Create a library in this folder, outside Lacuna's source; a study loads it with `[plugins]`
        #[arg(long, value_name = "FOLDER")]
        library: Option<PathBuf>,
        /// Lacuna's source, which contains the SDK of the library
        /// (default: the source around the current folder, or the one that this program was built from)
        #[arg(long, value_name = "FOLDER", requires = "library")]
        source: Option<PathBuf>,
    },
}

/// Runs `lacuna new …`.
pub fn write(what: &What) -> anyhow::Result<()> {
    match what {
        What::Study { name } => study::write(name),
        What::Plugin { kind, name, language, library, .. } if *language != Language::Rust => {
            if library.is_some() {
                let help = "leave out `--library`";
                return Err(plugin::wrong("a library folder holds a plugin in Rust", help));
            }
            language::write(kind, name, *language)
        }
        What::Plugin { kind, name, library, source, .. } => {
            plugin::write(kind, name, library.as_deref(), source.as_deref())
        }
    }
}
