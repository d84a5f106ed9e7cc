//! One part of a chain: a model of any kind with the shape of its output.

use std::borrow::Cow;

use lacuna::data::Layout;
use lacuna::plugin::registry::entries;
use lacuna::plugin::{Given, Model};
use lacuna::text::problem::{Complaints, Problem};
use lacuna::text::response::ResponseSection;
use lacuna::text::values::Name;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::models::given::listed;
use crate::models::nested::{self, Nested};

/// A part as written in a study.
pub type Part = Nested<dyn Model, PartKeys>;

/// Keys next to the model's own options.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartKeys {
    /// Name of the part.
    pub name: Name,
    /// Inputs of the study and outputs of earlier parts that the part receives. Default: all, which suits models that
    /// select for themselves, such as `equations`. Functions are available to all parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub takes: Option<Vec<Name>>,
    /// Output that the part passes on to the parts after it: name, unit and axes, as in `[response]`. The last part
    /// has none: it gives the response of the study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gives: Option<ResponseSection>,
}

impl Part {
    /// Returns the layout of its output; `None` if it has none. The error describes what is wrong with it.
    pub fn gives(&self) -> Result<Option<Layout>, String> {
        let Some(given) = self.section().ok().and_then(|s| s.common.gives.as_ref()) else {
            return Ok(None);
        };
        let unknown = |_: &_| {
            Err("the axes of a part's response cannot be taken from the measurements".to_owned())
        };
        let axes: Result<Vec<_>, String> =
            given.axes.0.iter().map(|(name, axis)| axis.axis(name.as_str(), unknown)).collect();
        let name = given.name.as_str().to_owned();
        Ok(Some(Layout { name, unit: given.unit.clone(), axes: axes? }))
    }

    /// Selects the inputs that the part receives; fails if one of them does not exist.
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

    /// Reports problems in the options of the part at index `place`.
    pub fn check(&self, place: usize, complaints: &mut Complaints<'_>) {
        if let Err(problems) = self.section() {
            pass_on(place, problems, complaints);
        }
        if let Err(reason) = self.gives() {
            complaints.at(&format!("parts.{place}.gives.axes")).say(reason);
        }
    }
}

/// Repeats problems in the options of the part at index `place` at their position in the study.
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
        // The options are those of the model; a part may itself be a chain, whose schema would be infinite.
        json_schema!({
            "type": "object",
            "required": ["use", "name"],
            "properties": {
                "use": { "enum": names, "description": "The model." },
                "name": { "type": "string", "description": "Name of the part." },
                "takes": {
                    "type": "array",
                    "items": { "type": "string" },
                    "description": "Inputs that the part receives. Default: all.",
                },
                "gives": gives,
            }
        })
    }
}
