//! Location of a command's response: its output, or a file in any reader's format.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

use lacuna::data::Layout;
use lacuna::plugin::reader::ReadError;
use lacuna::plugin::schema;
use lacuna::plugin::{Context, Reader};
use lacuna::text::problem::{Complaints, Problem};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::models::nested::{self, Nested};

/// Location of the response.
#[derive(Debug)]
pub enum Output {
    /// JSON on the command's standard output.
    Json,
    /// A file in the run's folder.
    File(Box<File>),
}

/// A file with a response, and the reader of its format.
pub type File = Nested<dyn Reader, FileKeys>;

/// Keys next to the reader's own options.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileKeys {
    /// File with the response, relative to the run's folder.
    pub path: PathBuf,
}

impl Output {
    /// Returns the file, if the response is in one.
    pub fn file(&self) -> Option<&File> {
        match self {
            Self::Json => None,
            Self::File(file) => Some(file),
        }
    }
}

impl File {
    /// Returns the path of the file, relative to the run's folder.
    pub fn path(&self) -> &Path {
        self.section().map_or(Path::new(""), |section| &section.common.path)
    }

    /// Reads the response from the file of a run.
    pub fn read(&self, folder: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        let path = folder.join(self.path());
        match self.section() {
            Ok(section) => section.built.plugin.response(&path, layout),
            Err(_) => Err(ReadError::new(path, "the reader's options are wrong")),
        }
    }

    /// Reports problems of the reader's options, at `output`.
    pub fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        match self.section() {
            Err(problems) => pass_on(problems, complaints),
            Ok(section) if section.built.plugin.names_files() => {
                complaints
                    .at("output")
                    .say("the reader's options name files of finished runs")
                    .help("leave them out: each run's file is `path`, in the run's folder");
            }
            Ok(section) => {
                let plugin = &section.built.plugin;
                pass_on(&nested::complaints(|said| plugin.check(context, said)), complaints);
            }
        }
    }
}

/// Repeats problems of the reader's options at their position in the study.
fn pass_on(problems: &[Problem], complaints: &mut Complaints<'_>) {
    nested::pass_on("output", "", problems, complaints);
}

impl Serialize for Output {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Json => serializer.serialize_str("json"),
            Self::File(file) => file.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Output {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

struct Written;

impl<'de> Visitor<'de> for Written {
    type Value = Output;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("`\"json\"`, or a table such as `{ use = \"csv\", path = \"result.csv\" }`")
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Output, E> {
        match text {
            "json" => Ok(Output::Json),
            _ => Err(E::invalid_value(serde::de::Unexpected::Str(text), &self)),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Output, A::Error> {
        let written = toml::Table::deserialize(MapAccessDeserializer::new(map));
        let written = written.map_err(A::Error::custom)?;
        Ok(Output::File(Box::new(File::of(written))))
    }
}

impl JsonSchema for Output {
    fn schema_name() -> Cow<'static, str> {
        "Output".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let file = schema::section::<dyn Reader, FileKeys>(generator);
        json_schema!({ "oneOf": [{ "type": "string", "const": "json" }, file.to_value()] })
    }
}
