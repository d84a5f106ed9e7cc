//! `[plugins]`: libraries of plugins that a study loads.

use std::fmt;
use std::path::{Path, PathBuf};

use lacuna::plugin::Library;
use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::run::files;
use lacuna::text::decode::decode;
use lacuna::text::{Complaints, Node, Problems};
use lacuna_abi::record::{self, Record};
use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use crate::host::{declared, library};

/// Plugin libraries from third parties. Their code runs with all rights of the program: load only libraries you trust.
/// `lacuna check STUDY` lists the libraries without loading them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PluginsSection {
    /// Library files, relative to the study: `["./libmatern.so"]`, or with the hash that the file must have,
    /// `[{ path = "./libmatern.so", sha256 = "…" }]`. No search path is used.
    pub load: Vec<LibraryFile>,
}

/// The file of a library.
#[derive(Debug, Clone, PartialEq)]
pub struct LibraryFile {
    /// Path of the library, relative to the study.
    pub path: PathBuf,
    /// SHA-256 hash that the file must have, in hexadecimal; the library is not loaded if it differs.
    pub sha256: Option<String>,
}

/// The file of a library as a table.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Table {
    /// Path of the library, relative to the study.
    path: PathBuf,
    /// SHA-256 hash that the file must have, in hexadecimal; the library is not loaded if it differs.
    sha256: String,
}

impl Serialize for LibraryFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let path = self.path.clone();
        match &self.sha256 {
            None => path.serialize(serializer),
            Some(sha256) => Table { path, sha256: sha256.clone() }.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for LibraryFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = LibraryFile;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a path, or `{ path = \"…\", sha256 = \"…\" }`")
            }
            fn visit_str<E: de::Error>(self, path: &str) -> Result<LibraryFile, E> {
                Ok(LibraryFile { path: path.into(), sha256: None })
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<LibraryFile, A::Error> {
                let table = Table::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(LibraryFile { path: table.path, sha256: Some(table.sha256) })
            }
        }
        deserializer.deserialize_any(Either)
    }
}

impl JsonSchema for LibraryFile {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "LibraryFile".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let table = generator.subschema_for::<Table>();
        schemars::json_schema!({ "anyOf": [{ "type": "string" }, table] })
    }
}

/// Purpose for which a study is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// To run it: its model must be available.
    Run,
    /// To check it: no plugin library is loaded, since that would run its code.
    Check,
    /// To read the results of a run: the model and the executor, which are not used, may be unavailable.
    Look,
}

/// A plugin library as read from its file without loading it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// Path of the library as written in the study.
    pub path: PathBuf,
    /// SHA-256 hash of the file.
    pub sha256: String,
    /// Record that the library carries about itself and its plugins; `None` if it has none.
    pub record: Option<Record>,
}

/// The libraries of a study.
#[derive(Debug, Clone, Default)]
pub struct Libraries {
    /// The section as written in the study.
    pub section: PluginsSection,
    /// The libraries as read from their files.
    pub seen: Vec<Seen>,
    /// The libraries that were loaded.
    pub loaded: Vec<&'static Library>,
}

impl Libraries {
    /// Plugins that stand for those that the libraries are said to hold.
    pub(super) fn declared(&self) -> Vec<AnyEntry> {
        let all = self.seen.iter().filter_map(|seen| Some((seen, seen.record.as_ref()?)));
        all.flat_map(|(seen, record)| declared::entries(&seen.path, record)).collect()
    }
}

/// `[plugins]`: looks at the files, and loads them unless the study is only checked; `None` after complaints.
pub(super) fn libraries(
    root: &Node,
    directory: &Path,
    purpose: Use,
    problems: &mut Problems,
) -> Option<Libraries> {
    let Some(node) = root.get("plugins") else { return Some(Libraries::default()) };
    problems.within("plugins", |problems| {
        let section: PluginsSection = decode(node, problems)?;
        let before = problems.len();
        let mut libraries = Libraries::default();
        for (i, file) in section.load.iter().enumerate() {
            let brought = bring(file, directory, purpose, &mut libraries);
            if let Err(reason) = brought {
                let message = format!(
                    "the library of plugins {} cannot be used: {reason}",
                    file.path.display()
                );
                Complaints::new(node, problems).at(&format!("load.{i}")).say(message);
            }
        }
        libraries.section = section;
        (problems.len() == before).then_some(libraries)
    })
}

fn bring(
    file: &LibraryFile,
    directory: &Path,
    purpose: Use,
    libraries: &mut Libraries,
) -> Result<(), String> {
    let path = directory.join(&file.path);
    let bytes = std::fs::read(&path).map_err(|error| files::in_words(&error))?;
    let sha256 = files::hash(&bytes);
    library::pinned(&sha256, file.sha256.as_deref())?;
    let record = record::find(&bytes);
    libraries.seen.push(Seen { path: file.path.clone(), sha256, record });
    if purpose != Use::Check {
        libraries.loaded.push(library::load(&path, file.sha256.as_deref())?);
    }
    Ok(())
}
