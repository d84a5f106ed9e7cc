//! Location of a signal: the options for one gauge.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::exodus::{Group, Kind};

/// Location of one gauge in a simulation's output.
///
/// A history or heartbeat file needs only `variable`. In a results file the entity is chosen by its `id`, or as the
/// one `nearest` to a point; `block` narrows the choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Name of the variable. If no variable has this exact name, the only one that differs in case is taken.
    ///
    /// With `direction`, the name of a symmetric tensor without its component: `log_strain` for `log_strain_xx`, ...
    /// `log_strain_zx`. A component in the middle of the name is written `{component}`:
    /// `unrotated_stress_{component}_1`.
    pub variable: String,
    /// Kind of entity to which the variable is attached; needed only if several kinds have a variable of this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<Kind>,
    /// Element block, node set or side set, by name or id.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub block: Option<GroupName>,
    /// Id of the node or element, as in the input deck.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<i64>,
    /// Side of the element `id`, counted from 1; needed if a side set contains several of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<i64>,
    /// Point whose nearest node, or element by its centroid, is read; in the mesh's unit of length. For a side set
    /// the centroid is that of the element behind the side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nearest: Option<[f64; 3]>,
    /// Direction of the gauge: the signal is the normal component e = d·E·d of the symmetric tensor E along the unit
    /// vector d; the vector given is normalised. Shear components are those of the tensor, not the engineering shear,
    /// which is twice as large.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
}

impl Probe {
    /// Returns a probe without a location, for a global of a history file or a column of a heartbeat file.
    pub fn named(variable: impl Into<String>) -> Self {
        Self {
            variable: variable.into(),
            kind: None,
            block: None,
            id: None,
            side: None,
            nearest: None,
            direction: None,
        }
    }

    /// Returns true if the user gave a location in the mesh.
    pub(super) fn is_placed(&self) -> bool {
        self.block.is_some() || self.id.is_some() || self.nearest.is_some()
    }
}

/// A block or set, by id or by name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum GroupName {
    /// Id in the input deck.
    Id(i64),
    /// Name.
    Name(String),
}

impl GroupName {
    /// Returns true if this is the id or name of a group.
    pub fn means(&self, group: &Group) -> bool {
        match self {
            Self::Id(id) => group.id == *id,
            Self::Name(name) => group.name.eq_ignore_ascii_case(name),
        }
    }
}

impl std::fmt::Display for GroupName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Id(id) => write!(f, "{id}"),
            Self::Name(name) => write!(f, "{name}"),
        }
    }
}
