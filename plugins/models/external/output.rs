//! Where the response of a command is: in what it printed, or in a file of any reader's format.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

use lacuna::data::Layout;
use lacuna::plugin::reader::ReadError;
use lacuna::plugin::registry::{Section, section};
use lacuna::plugin::{Context, Reader};
use lacuna::study::problem::{Complaints, Problem, Problems};
use lacuna::study::read::read;
use lacuna::study::{Sources, emit, schema};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Where the response is.
#[derive(Debug)]
pub enum Output {
    /// JSON on standard output.
    Json,
    /// A file in the run's folder.
    File(Box<File>),
}

/// A file with a response, and the reader of its format.
pub struct File {
    written: toml::Table,
    /// The reader, or what is wrong with its options.
    section: Result<Section<dyn Reader, FileKeys>, Vec<Problem>>,
}

/// The keys beside the reader's own.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FileKeys {
    /// The file with the response, relative to the run's folder.
    path: PathBuf,
}

impl File {
    fn of(written: toml::Table) -> Self {
        let mut problems = Problems::new();
        let section = Self::decode(&written, &mut problems);
        let wrong = || problems.sorted().into_iter().cloned().collect();
        Self { section: section.ok_or_else(wrong), written }
    }

    fn decode(
        written: &toml::Table,
        problems: &mut Problems,
    ) -> Option<Section<dyn Reader, FileKeys>> {
        let text = match emit::to_toml(written) {
            Ok(text) => text,
            Err(error) => {
                problems.report(None, format!("the options of the reader: {error}"));
                return None;
            }
        };
        let mut sources = Sources::default();
        let source = sources.add_argument("output", text);
        let node = read(source, &sources, problems)?;
        section(&node, None, problems)
    }

    /// The file, relative to the run's folder.
    pub fn path(&self) -> &Path {
        self.section.as_ref().map_or(Path::new(""), |section| &section.common.path)
    }

    /// The response in the file of a run.
    pub fn read(&self, folder: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        let path = folder.join(self.path());
        match &self.section {
            Ok(section) => section.built.plugin.response(&path, layout),
            Err(_) => Err(ReadError::new(path, "the reader's options are wrong")),
        }
    }

    /// Complains of the reader's options, at `output`.
    pub fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        match &self.section {
            Err(problems) => pass_on(problems.iter(), complaints),
            Ok(section) if section.built.plugin.names_files() => {
                complaints
                    .at("output")
                    .say("the reader is given files of finished runs")
                    .help("leave them out: each run's file is `path`, in the run's folder");
            }
            Ok(section) => {
                let mut problems = Problems::new();
                let mut sources = Sources::default();
                let source = sources.add_argument("output", String::new());
                let node = lacuna::study::Node::table(lacuna::study::Place::whole(source));
                section.built.plugin.check(context, &mut Complaints::new(&node, &mut problems));
                pass_on(problems.sorted().into_iter(), complaints);
            }
        }
    }
}

/// Repeats complaints about the reader's options where they stand in the study.
fn pass_on<'p>(problems: impl Iterator<Item = &'p Problem>, complaints: &mut Complaints<'_>) {
    for problem in problems {
        let path = format!("output.{}", problem.path);
        let spot = complaints.at(path.trim_end_matches('.'));
        let said = spot.say(problem.message.clone());
        said.expected.clone_from(&problem.expected);
        said.found.clone_from(&problem.found);
        said.help.clone_from(&problem.help);
    }
}

impl fmt::Debug for File {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("File").field(&self.written).finish()
    }
}

impl Serialize for Output {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let file = match self {
            Self::Json => return serializer.serialize_str("json"),
            Self::File(file) => file,
        };
        let mut whole = file.written.clone();
        if let Ok(section) = &file.section {
            whole.extend(section.built.options.clone());
        }
        whole.serialize(serializer)
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
