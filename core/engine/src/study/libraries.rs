//! `[plugins]`: libraries and Python files of plugins that a study loads.

use std::fmt;
use std::path::{Path, PathBuf};

use lacuna::plugin::Library;
use lacuna::plugin::registry::loaded::AnyEntry;
use lacuna::run::files;
use lacuna::text::decode::decode;
use lacuna::text::{Complaints, Node, Problems, Value};
use lacuna_abi::record::{self, Record};
use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use crate::host::{declared, library, recorded};

/// Plugins from third parties, in libraries or in Python files. Their code runs with all rights of the program: load only libraries you trust.
/// `lacuna check STUDY` lists the libraries without loading them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PluginsSection {
    /// Library files, relative to the study: `["./libmatern.so"]`, or with the hash that the file must have,
    /// `[{ path = "./libmatern.so", sha256 = "…" }]`. No search path is used.
    pub load: Vec<LibraryFile>,
    /// Python files of plugins, relative to the study: `"mine.py"`, or several in an array; with the hash that a file must have
    /// as in `load`. `numpy` has to be installed.
    #[serde(skip_serializing_if = "Files::is_empty")]
    pub python: Files,
    /// Python interpreter of these files: a path relative to the study with a `/`, the directory of a virtual environment, or
    /// a name that is searched for in `PATH`. Default: that of the environment variable `LACUNA_PYTHON`, or `python3`; in
    /// the Python package, the running one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpreter: Option<PathBuf>,
}

/// Key of the Python files.
const PYTHON: &str = stringify!(python);

/// One file or several.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Files(pub Vec<LibraryFile>);

impl Files {
    /// True for none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<'de> Deserialize<'de> for Files {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrSeveral;
        impl<'de> Visitor<'de> for OneOrSeveral {
            type Value = Files;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a path, `{ path = \"…\", sha256 = \"…\" }`, or an array of these")
            }
            fn visit_str<E: de::Error>(self, path: &str) -> Result<Files, E> {
                Ok(Files(vec![LibraryFile { path: path.into(), sha256: None }]))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Files, A::Error> {
                let table = Table::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(Files(vec![LibraryFile { path: table.path, sha256: Some(table.sha256) }]))
            }
            fn visit_seq<A: de::SeqAccess<'de>>(self, seq: A) -> Result<Files, A::Error> {
                let files = Vec::deserialize(de::value::SeqAccessDeserializer::new(seq))?;
                Ok(Files(files))
            }
        }
        deserializer.deserialize_any(OneOrSeveral)
    }
}

impl JsonSchema for Files {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Files".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let (one, several) = (
            generator.subschema_for::<LibraryFile>(),
            generator.subschema_for::<Vec<LibraryFile>>(),
        );
        schemars::json_schema!({ "anyOf": [one, several] })
    }
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
    /// To read the results of a run: the model and the executors, which are not used, may be unavailable.
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
    /// The libraries of a finished run that cannot be loaded any more, as its manifest describes them.
    pub absent: Vec<&'static Library>,
}

impl Libraries {
    /// All libraries that the plugins of the study come from.
    pub fn all(&self) -> impl Iterator<Item = &'static Library> {
        self.loaded.iter().chain(&self.absent).copied()
    }

    /// Plugins that stand for those that the libraries are said to hold.
    pub(super) fn declared(&self) -> Vec<AnyEntry> {
        let all = self.seen.iter().filter_map(|seen| Some((seen, seen.record.as_ref()?)));
        let seen =
            all.flat_map(|(seen, record)| declared::entries(&seen.path, &record.plugins, None));
        let absent = self.absent.iter();
        let absent = absent.flat_map(|l| declared::entries(&l.path, &l.plugins, Some(l)));
        seen.chain(absent).collect()
    }
}

/// `[plugins]`: looks at the files, and loads them unless the study is only checked; `None` after complaints. `run` is the
/// folder of the study's file: in a run directory its manifest stands for a file that is gone or has changed.
pub(super) fn libraries(
    root: &Node,
    (run, directory): (&Path, &Path),
    purpose: Use,
    problems: &mut Problems,
) -> Option<Libraries> {
    let Some(node) = root.get("plugins") else { return Some(Libraries::default()) };
    problems.within("plugins", |problems| {
        let section: PluginsSection = decode(node, problems)?;
        let before = problems.len();
        let mut libraries = Libraries::default();
        let several = node.get(PYTHON).is_some_and(|node| matches!(node.value, Value::Array(_)));
        let load = section.load.iter().enumerate().map(|(i, file)| (file, format!("load.{i}")));
        let python = section.python.0.iter().enumerate().map(|(i, file)| {
            (file, if several { format!("{PYTHON}.{i}") } else { PYTHON.to_owned() })
        });
        for (file, key) in load.chain(python) {
            let in_python = key.starts_with(PYTHON) || library::is_python(&file.path);
            let interpreter = section.interpreter.as_deref();
            let form = if in_python { Form::Python { interpreter } } else { Form::Library };
            if let Err(reason) = bring(file, form, directory, purpose, &mut libraries) {
                let known = || recorded::library(run, &directory.join(&file.path));
                if let Some(library) = (purpose == Use::Look).then(known).flatten() {
                    libraries.absent.push(library);
                    continue;
                }
                let what = if in_python { "file of plugins" } else { "library of plugins" };
                let message =
                    format!("the {what} {} cannot be used: {reason}", file.path.display());
                Complaints::new(node, problems).at(&key).say(message);
            }
        }
        for (file, plugin) in twice(&libraries.loaded) {
            let message = format!("{file} has a {plugin} too: a study has one of each name");
            Complaints::new(node, problems).at("").say(message);
        }
        libraries.section = section;
        (problems.len() == before).then_some(libraries)
    })
}

/// Plugins that two of the files have: the later file, kind and name.
fn twice(loaded: &[&'static Library]) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for (i, library) in loaded.iter().enumerate() {
        let earlier = || loaded[..i].iter().flat_map(|other| &other.plugins);
        for plugin @ (kind, name) in &library.plugins {
            if earlier().any(|other| other == plugin) {
                found.push((library.file(), format!("{kind} `{name}`")));
            }
        }
    }
    found
}

/// Form of a file of plugins.
#[derive(Clone, Copy)]
enum Form<'a> {
    Library,
    Python { interpreter: Option<&'a Path> },
}

/// Looks at a file and, unless the study is only checked, loads it.
fn bring(
    file: &LibraryFile,
    form: Form<'_>,
    directory: &Path,
    purpose: Use,
    libraries: &mut Libraries,
) -> Result<(), String> {
    let path = directory.join(&file.path);
    let bytes = std::fs::read(&path).map_err(|error| files::in_words(&error))?;
    let sha256 = files::hash(&bytes);
    library::pinned(&sha256, file.sha256.as_deref())?;
    let record = match form {
        Form::Python { .. } => Some(lacuna_script::record(&String::from_utf8_lossy(&bytes))),
        Form::Library => record::find(&bytes),
    };
    libraries.seen.push(Seen { path: file.path.clone(), sha256, record });
    if purpose == Use::Check {
        return Ok(());
    }
    let pin = file.sha256.as_deref();
    libraries.loaded.push(match form {
        Form::Python { interpreter } => library::load_python(&path, pin, interpreter, directory)?,
        Form::Library => library::load(&path, pin)?,
    });
    Ok(())
}
