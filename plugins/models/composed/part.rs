//! One part of a chain: a model of any kind with the shape of what it hands on.

use std::borrow::Cow;

use lacuna::data::Layout;
use lacuna::plugin::registry::entries;
use lacuna::plugin::{Given, Model};
use lacuna::study::problem::{Complaints, Problem};
use lacuna::study::response::ResponseSection;
use lacuna::study::values::Name;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::models::given::listed;
use crate::models::nested::{self, Nested};

/// A part as a study writes it.
pub type Part = Nested<dyn Model, PartKeys>;

/// The keys beside the model's own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartKeys {
    /// What the part is called.
    pub name: Name,
    /// The inputs of the study and of the parts before it that it takes; all when left out, which suits models that choose
    /// for themselves, such as `equations`. Functions are seen by all parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub takes: Option<Vec<Name>>,
    /// What it hands on to the parts after it: name, unit and axes, as in `[response]`. The last part has none: it
    /// gives the response of the study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gives: Option<ResponseSection>,
}

impl Part {
    /// The shape of what it hands on, or what is wrong with it.
    pub fn gives(&self) -> Result<Option<Layout>, String> {
        let Some(given) = self.section().ok().and_then(|s| s.common.gives.as_ref()) else {
            return Ok(None);
        };
        let unknown = |_: &_| Err("the measurements are of the study's response".to_owned());
        let axes: Result<Vec<_>, String> =
            given.axes.0.iter().map(|(name, axis)| axis.axis(name.as_str(), unknown)).collect();
        let name = given.name.as_str().to_owned();
        Ok(Some(Layout { name, unit: given.unit.clone(), axes: axes? }))
    }

    /// What it sees of what is given.
    pub fn seen(&self, given: &[Given]) -> Result<Vec<Given>, String> {
        let Some(takes) = self.section().ok().and_then(|s| s.common.takes.as_ref()) else {
            return Ok(given.to_vec());
        };
        let find = |name: &Name| {
            let found = given.iter().find(|given| given.name == name.as_str());
            found.cloned().ok_or_else(|| {
                let known = listed(given.iter().map(|given| given.name.as_str()));
                format!("nothing gives `{}`, expected {known}", name.as_str())
            })
        };
        takes.iter().map(find).collect()
    }

    /// Complains of the options of the part at position `place`.
    pub fn check(&self, place: usize, complaints: &mut Complaints<'_>) {
        if let Err(problems) = self.section() {
            pass_on(place, problems, complaints);
        }
        if let Err(reason) = self.gives() {
            complaints.at(&format!("parts.{place}.gives.axes")).say(reason);
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
        let gives = generator.subschema_for::<ResponseSection>();
        // The options are those of the model; a part may be a chain itself, whose schema has no end.
        json_schema!({
            "type": "object",
            "required": ["use", "name"],
            "properties": {
                "use": { "enum": names, "description": "The model." },
                "name": { "type": "string", "description": "What the part is called." },
                "takes": {
                    "type": "array",
                    "items": { "type": "string" },
                    "description": "The inputs that it takes; all when left out.",
                },
                "gives": gives,
            }
        })
    }
}
