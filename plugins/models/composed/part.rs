//! One part of a chain: a model of any kind with the shape of what it hands on.

use std::fmt;

use lacuna::data::Layout;
use lacuna::plugin::Model;
use lacuna::plugin::registry::{Section, entries, section};
use lacuna::study::problem::{Complaints, Problem, Problems};
use lacuna::study::read::read;
use lacuna::study::response::ResponseSection;
use lacuna::study::values::Name;
use lacuna::study::{Sources, emit};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A part as a study writes it.
pub struct Part {
    written: toml::Table,
    /// The model, or what is wrong with its options.
    section: Result<Section<dyn Model, PartKeys>, Vec<Problem>>,
}

/// The keys beside the model's own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartKeys {
    /// What the part is called.
    pub name: Name,
    /// What it hands on to the parts after it: name, unit and axes, as in `[response]`. The last part has none: it
    /// gives the response of the study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output: Option<ResponseSection>,
}

impl Part {
    fn of(written: toml::Table) -> Self {
        let mut problems = Problems::new();
        let section = Self::decode(&written, &mut problems);
        let wrong = || problems.sorted().into_iter().cloned().collect();
        Self { section: section.ok_or_else(wrong), written }
    }

    fn decode(
        written: &toml::Table,
        problems: &mut Problems,
    ) -> Option<Section<dyn Model, PartKeys>> {
        let text = match emit::to_toml(written) {
            Ok(text) => text,
            Err(error) => {
                problems.report(None, format!("the options of a part: {error}"));
                return None;
            }
        };
        let mut sources = Sources::default();
        let source = sources.add_argument("part", text);
        let node = read(source, &sources, problems)?;
        section(&node, None, problems)
    }

    /// The model and the keys beside it, where nothing is wrong with them.
    pub fn section(&self) -> Option<&Section<dyn Model, PartKeys>> {
        self.section.as_ref().ok()
    }

    /// The shape of what it hands on, or what is wrong with it.
    pub fn output(&self) -> Result<Option<Layout>, String> {
        let Some(output) = self.section().and_then(|s| s.common.output.as_ref()) else {
            return Ok(None);
        };
        let unknown = |_: &_| Err("the measurements are of the study's response".to_owned());
        let axes: Result<Vec<_>, String> =
            output.axes.0.iter().map(|(name, axis)| axis.axis(name.as_str(), unknown)).collect();
        let name = output.name.as_str().to_owned();
        Ok(Some(Layout { name, unit: output.unit.clone(), axes: axes? }))
    }

    /// Complains of the options of the part at position `place`.
    pub fn check(&self, place: usize, complaints: &mut Complaints<'_>) {
        if let Err(problems) = &self.section {
            pass_on(place, problems.iter(), complaints);
        }
        if let Err(reason) = self.output() {
            complaints.at(&format!("parts.{place}.output.axes")).say(reason);
        }
    }
}

/// Repeats complaints about a part's options where they stand in the study.
pub fn pass_on<'p>(
    place: usize,
    problems: impl Iterator<Item = &'p Problem>,
    complaints: &mut Complaints<'_>,
) {
    for problem in problems {
        let path = format!("parts.{place}.{}", problem.path);
        let said = complaints.at(path.trim_end_matches('.')).say(format!(
            "part {}: {}",
            place + 1,
            problem.message
        ));
        said.expected.clone_from(&problem.expected);
        said.found.clone_from(&problem.found);
        said.help.clone_from(&problem.help);
    }
}

impl fmt::Debug for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Part").field(&self.written).finish()
    }
}

impl Serialize for Part {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut whole = self.written.clone();
        if let Some(section) = self.section() {
            whole.extend(section.built.options.clone());
        }
        whole.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Part {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        toml::Table::deserialize(deserializer).map(Self::of)
    }
}

impl JsonSchema for Part {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Part".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let names: Vec<&str> = entries::<dyn Model>().into_iter().map(|entry| entry.name).collect();
        let output = generator.subschema_for::<ResponseSection>();
        // The options are those of the model; a part may be a chain itself, whose schema has no end.
        json_schema!({
            "type": "object",
            "required": ["use", "name"],
            "properties": {
                "use": { "enum": names, "description": "The model." },
                "name": { "type": "string", "description": "What the part is called." },
                "output": output,
            }
        })
    }
}
