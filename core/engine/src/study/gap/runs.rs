//! `[[gap.runs]]`: further tables of simulation runs, each with a suspected piece of physics in the simulator.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::text::values::Name;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The engine's keys of `[[gap.runs]]`: a second table of simulation runs, made with the suspected physics in the simulator.
///
/// Its difference from the study's emulator is learned by the study's surrogate, and is a candidate of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunsKeys {
    /// Name of the physics in the results.
    pub name: Name,
    /// Name of the physics in words. Default: `name`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Parameter of the table that is the size of the physics, such as a rate of damping. Without it all runs have the
    /// physics at one size, and the size of the candidate is a share of that: 0 without it, 1 as in the table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<Name>,
    /// Unit of the size, of its `absent` and its `prior`.
    #[serde(default)]
    pub unit: Unit,
    /// Size at which the physics is absent.
    #[serde(default)]
    pub absent: f64,
    /// Prior of the size; with `size`, inside the range of the table.
    pub prior: Distribution,
}

impl RunsKeys {
    /// The name of the size among the parameters.
    pub fn size_name(&self) -> &str {
        self.size.as_ref().map_or("share", AsRef::as_ref)
    }
}
