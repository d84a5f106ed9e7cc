//! One part of a chain: a model of any kind with the shape of what it hands on.

use std::borrow::Cow;

use lacuna::data::Layout;
use lacuna::plugin::Model;
use lacuna::plugin::registry::entries;
use lacuna::study::problem::{Complaints, Problem};
use lacuna::study::response::ResponseSection;
use lacuna::study::values::Name;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::models::nested::{self, Nested};

/// A part as a study writes it.
pub type Part = Nested<dyn Model, PartKeys>;

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
    /// The shape of what it hands on, or what is wrong with it.
    pub fn output(&self) -> Result<Option<Layout>, String> {
        let Some(output) = self.section().ok().and_then(|s| s.common.output.as_ref()) else {
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
        if let Err(problems) = self.section() {
            pass_on(place, problems, complaints);
        }
        if let Err(reason) = self.output() {
            complaints.at(&format!("parts.{place}.output.axes")).say(reason);
        }
    }
}

/// Repeats complaints about the options of the part at position `place` where they stand in the study.
pub fn pass_on(place: usize, problems: &[Problem], complaints: &mut Complaints<'_>) {
    let who = format!("part {}: ", place + 1);
    nested::pass_on(&format!("parts.{place}"), &who, problems, complaints);
}

impl JsonSchema for Part {
    fn schema_name() -> Cow<'static, str> {
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
