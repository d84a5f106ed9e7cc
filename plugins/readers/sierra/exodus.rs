//! One Exodus II file: its time steps, variables, blocks and sets.
//!
//! Names and meaning of the netCDF variables are those of the Exodus library's `exodusII_int.h`. In them `{v}`, `{b}`
//! and `{k}` are positions counted from 1, never ids.

use std::path::Path;

use lacuna::plugin::reader::ReadError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::container::{Container, Pick};

/// Fill value of the netCDF library for data that were never written: `NC_FILL_DOUBLE`, the same number in single
/// precision.
const NEVER_WRITTEN: f64 = 9.969_209_968_386_869e36;

/// Kind of entity to which an Exodus variable is attached.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// One value per step: every variable of a history file.
    Global,
    /// One value per node.
    Nodal,
    /// One value per element.
    Element,
    /// One value per node of a node set.
    NodeSet,
    /// One value per side of a side set.
    SideSet,
}

impl Kind {
    /// All kinds, in the order in which a file lists them.
    pub const ALL: [Self; 5] =
        [Self::Global, Self::Nodal, Self::Element, Self::NodeSet, Self::SideSet];

    /// Returns the kind as written in a study.
    pub fn label(self) -> &'static str {
        match self {
            Self::Global => "global",
            Self::Nodal => "nodal",
            Self::Element => "element",
            Self::NodeSet => "node_set",
            Self::SideSet => "side_set",
        }
    }

    /// Returns the name of the entity that carries a value, for messages.
    pub(super) fn carrier(self) -> &'static str {
        match self {
            Self::Global => "file",
            Self::Nodal | Self::NodeSet => "node",
            Self::Element | Self::SideSet => "element",
        }
    }

    fn names_variable(self) -> &'static str {
        match self {
            Self::Global => "name_glo_var",
            Self::Nodal => "name_nod_var",
            Self::Element => "name_elem_var",
            Self::NodeSet => "name_nset_var",
            Self::SideSet => "name_sset_var",
        }
    }
}

/// An element block, a node set or a side set.
#[derive(Debug, Clone)]
pub struct Group {
    /// Position in the file, counted from 0.
    pub position: usize,
    /// Id given by the user.
    pub id: i64,
    /// Name given by the user; empty if there is none.
    pub name: String,
    /// Number of elements, nodes or sides.
    pub size: usize,
    /// Position of a block's first element in the file's numbering of elements.
    pub start: usize,
    /// Variables that exist here: the row of the truth table.
    pub present: Vec<bool>,
}

impl Group {
    /// Returns the name, or the id if there is no name.
    pub fn label(&self) -> String {
        if self.name.is_empty() { self.id.to_string() } else { self.name.clone() }
    }
}

/// An open Exodus II file; only the values asked for are read.
pub struct Exodus {
    /// Container of the file.
    pub container: Container,
    /// Times of the complete steps.
    pub times: Vec<f64>,
    /// Number of steps after `last_written_time`, which the writer began but did not finish.
    pub incomplete_steps: usize,
    /// Number of nodes.
    pub nodes: usize,
    /// Element blocks.
    pub blocks: Vec<Group>,
    /// Node sets.
    pub node_sets: Vec<Group>,
    /// Side sets.
    pub side_sets: Vec<Group>,
    names: [Vec<String>; 5],
}

impl Exodus {
    /// Opens a file and reads its description.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::from_container(Container::open(path)?)
    }

    /// Reads the description from an open container.
    pub fn from_container(container: Container) -> Result<Self, ReadError> {
        if container.real("api_version").is_none()
            && container.real("api version").is_none()
            && container.shape("time_whole").is_none()
        {
            return Err(ReadError::new(
                container.path(),
                "is a netCDF file but not Exodus II: it has neither the attribute `api_version` \
                 nor the variable `time_whole`",
            ));
        }
        let (times, incomplete_steps) = complete_steps(&container)?;
        let mut names: [Vec<String>; 5] = Default::default();
        for kind in Kind::ALL {
            let variable = kind.names_variable();
            if container.shape(variable).is_some() {
                names[kind as usize] = container.texts(variable)?;
            }
        }
        let nodes = match (container.shape("coordx"), container.shape("coord")) {
            (Some(shape), _) => shape.first().copied().unwrap_or(0),
            (None, Some(shape)) => shape.get(1).copied().unwrap_or(0),
            (None, None) => container.dimension("num_nodes").unwrap_or(0),
        };
        let count = |kind: Kind| names[kind as usize].len();
        container.check_count("nodes", nodes)?;
        let blocks = groups(&container, &BLOCKS, count(Kind::Element))?;
        let node_sets = groups(&container, &NODE_SETS, count(Kind::NodeSet))?;
        let side_sets = groups(&container, &SIDE_SETS, count(Kind::SideSet))?;
        let file =
            Self { container, times, incomplete_steps, nodes, blocks, node_sets, side_sets, names };
        file.check_extents()?;
        Ok(file)
    }

    /// Returns the path of the file as given by the user.
    pub fn path(&self) -> &Path {
        self.container.path()
    }

    /// Returns the names of the variables of a kind.
    pub fn names(&self, kind: Kind) -> &[String] {
        &self.names[kind as usize]
    }

    /// Returns the blocks or sets of a kind; empty for global and nodal variables.
    pub fn groups(&self, kind: Kind) -> &[Group] {
        match kind {
            Kind::Global | Kind::Nodal => &[],
            Kind::Element => &self.blocks,
            Kind::NodeSet => &self.node_sets,
            Kind::SideSet => &self.side_sets,
        }
    }

    /// Returns the number of elements.
    pub fn elements(&self) -> usize {
        self.blocks.iter().map(|b| b.size).sum()
    }

    /// Returns the index of a variable: by its exact name, else by the only name that differs in case.
    pub fn variable(&self, kind: Kind, name: &str) -> Option<usize> {
        let names = self.names(kind);
        names.iter().position(|n| n == name).or_else(|| {
            let mut alike = (0..names.len()).filter(|&i| names[i].eq_ignore_ascii_case(name));
            let first = alike.next()?;
            alike.next().is_none().then_some(first)
        })
    }

    /// Returns the values of one variable at one entity over the complete steps, NaN where the run wrote none.
    /// `group` and `entity` are positions counted from 0; both are ignored for globals, `group` for nodal variables.
    pub fn values(
        &self,
        kind: Kind,
        variable: usize,
        group: usize,
        entity: usize,
    ) -> Result<Vec<f64>, ReadError> {
        let mut values = self.slab(kind, variable, group, Pick::At(entity))?;
        // In netCDF-4 files a variable may lack the last steps.
        values.resize(self.times.len(), f64::NAN);
        for value in values.iter_mut().filter(|value| **value == NEVER_WRITTEN) {
            *value = f64::NAN;
        }
        Ok(values)
    }

    /// Returns the values of one variable at all entities of a group, over all steps, entities fastest.
    pub fn all_values(
        &self,
        kind: Kind,
        variable: usize,
        group: usize,
    ) -> Result<Vec<f64>, ReadError> {
        self.slab(kind, variable, group, Pick::All)
    }

    fn slab(
        &self,
        kind: Kind,
        variable: usize,
        group: usize,
        entity: Pick,
    ) -> Result<Vec<f64>, ReadError> {
        let (v, g) = (variable + 1, group + 1);
        let (name, picks) = match kind {
            Kind::Global => ("vals_glo_var".to_owned(), vec![Pick::All, Pick::At(variable)]),
            Kind::Nodal if self.container.shape("vals_nod_var").is_some() => {
                ("vals_nod_var".to_owned(), vec![Pick::All, Pick::At(variable), entity])
            }
            Kind::Nodal => (format!("vals_nod_var{v}"), vec![Pick::All, entity]),
            Kind::Element => (format!("vals_elem_var{v}eb{g}"), vec![Pick::All, entity]),
            Kind::NodeSet => (format!("vals_nset_var{v}ns{g}"), vec![Pick::All, entity]),
            Kind::SideSet => (format!("vals_sset_var{v}ss{g}"), vec![Pick::All, entity]),
        };
        if self.times.is_empty() {
            return Err(ReadError::new(self.path(), "has no complete time step"));
        }
        match self.container.shape(&name) {
            None => {
                let text = format!(
                    "is incomplete: it lists {} variable `{}` but has no `{name}`",
                    kind.label(),
                    self.names(kind)[variable]
                );
                return Err(ReadError::new(self.path(), text));
            }
            Some(shape) if shape.len() != picks.len() => {
                let text = format!("`{name}` has {} dimensions, not {}", shape.len(), picks.len());
                return Err(ReadError::new(self.path(), text));
            }
            Some(_) => {}
        }
        self.container.part(&name, &picks)
    }

    /// Fails unless the id maps are as long as the mesh: every look-up by id relies on it.
    fn check_extents(&self) -> Result<(), ReadError> {
        for name in ["node_num_map", "elem_num_map"] {
            if let Some(&[size]) = self.container.shape(name) {
                let expected = if name == "node_num_map" { self.nodes } else { self.elements() };
                if size != expected {
                    let text = format!(
                        "is damaged: `{name}` has {size} entries for {expected} {}s",
                        &name[..4]
                    );
                    return Err(ReadError::new(self.path(), text));
                }
            }
        }
        Ok(())
    }
}

/// Returns the times of the steps up to `last_written_time`, and the number of steps after it. In a file without that
/// attribute every step that has a time is complete.
fn complete_steps(container: &Container) -> Result<(Vec<f64>, usize), ReadError> {
    if container.shape("time_whole").is_none() {
        return Ok((Vec::new(), 0));
    }
    let mut times = container.reals("time_whole")?;
    let single = container.real("floating_point_word_size") == Some(4.0);
    let last = container.real("last_written_time").unwrap_or(f64::INFINITY);
    // The attribute is in double precision even if times are stored in single precision.
    let complete =
        |t: f64| t != NEVER_WRITTEN && (t <= last || (single && t as f32 <= last as f32));
    let steps = times.iter().take_while(|&&t| complete(t) || t.is_nan()).count();
    let dropped = times.len() - steps;
    times.truncate(steps);
    Ok((finite(container, times)?, dropped))
}

fn finite(container: &Container, times: Vec<f64>) -> Result<Vec<f64>, ReadError> {
    match times.iter().position(|t| !t.is_finite()) {
        None => Ok(times),
        Some(i) => {
            let text = format!("is damaged: the time of step {} is {}", i + 1, times[i]);
            Err(ReadError::new(container.path(), text))
        }
    }
}

/// Names in the file for one sort of group.
struct Spelling {
    ids: &'static str,
    names: &'static str,
    table: &'static str,
    size: &'static str,
    members: &'static str,
}

const BLOCKS: Spelling = Spelling {
    ids: "eb_prop1",
    names: "eb_names",
    table: "elem_var_tab",
    size: "num_el_in_blk",
    members: "connect",
};
const NODE_SETS: Spelling = Spelling {
    ids: "ns_prop1",
    names: "ns_names",
    table: "nset_var_tab",
    size: "num_nod_ns",
    members: "node_ns",
};
const SIDE_SETS: Spelling = Spelling {
    ids: "ss_prop1",
    names: "ss_names",
    table: "sset_var_tab",
    size: "num_side_ss",
    members: "elem_ss",
};

fn exists(container: &Container, spelling: &Spelling, number: i64) -> bool {
    container.shape(&format!("{}{number}", spelling.members)).is_some()
}

fn groups(
    container: &Container,
    spelling: &Spelling,
    variables: usize,
) -> Result<Vec<Group>, ReadError> {
    let ids = match container.shape(spelling.ids) {
        Some(_) => container.integers(spelling.ids)?,
        None => (1..=i64::MAX).take_while(|k| exists(container, spelling, *k)).collect(),
    };
    let names = match container.shape(spelling.names) {
        Some(_) => container.texts(spelling.names)?,
        None => Vec::new(),
    };
    let table = match container.shape(spelling.table) {
        Some(shape) if *shape == [ids.len(), variables] => Some(container.reals(spelling.table)?),
        Some(shape) => {
            let text = format!(
                "is damaged: `{}` has shape {shape:?}, expected [{}, {variables}]",
                spelling.table,
                ids.len()
            );
            return Err(ReadError::new(container.path(), text));
        }
        None => None,
    };
    let mut start: usize = 0;
    let mut groups = Vec::with_capacity(ids.len());
    for (position, id) in ids.into_iter().enumerate() {
        let number = position + 1;
        let members = container.shape(&format!("{}{number}", spelling.members));
        let size = container
            .dimension(&format!("{}{number}", spelling.size))
            .or_else(|| members.and_then(|shape| shape.first().copied()))
            .unwrap_or(0);
        container.check_count("entries of a block or set", start.saturating_add(size))?;
        let present = (0..variables)
            .map(|v| table.as_ref().is_none_or(|t| t[position * variables + v] != 0.0))
            .collect();
        let name = names.get(position).cloned().unwrap_or_default();
        groups.push(Group { position, id, name, size, start, present });
        start = start.saturating_add(size);
    }
    Ok(groups)
}
