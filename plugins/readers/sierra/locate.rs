//! Search for the entity of an Exodus file that a probe refers to.

use lacuna::plugin::reader::ReadError;

use super::container::Pick;
use super::exodus::{Exodus, Group, Kind};
use super::probe::Probe;
use crate::readers::listed;

/// One entity that carries a value; positions are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entity {
    /// Index of the block or set; 0 for globals and nodal variables.
    pub group: usize,
    /// Position within the group, or within the file for nodal variables.
    pub position: usize,
    /// Distance to the requested point; 0 if the entity was chosen otherwise.
    pub distance: f64,
}

/// Entities of a file that match a probe.
#[derive(Debug, Clone, Default)]
pub struct Found {
    /// Entity nearest to the requested point, or the only match.
    pub entity: Option<Entity>,
    /// Number of entities that match; without id and point there must be one.
    pub count: usize,
    /// Groups that contain the requested id but, by the truth table, not the variable.
    pub without_variable: Vec<String>,
}

impl Found {
    fn offer(&mut self, entity: Entity) {
        self.count += 1;
        // Strictly nearer: of several entities at the same distance the first in the file is kept.
        if self.entity.is_none_or(|best| entity.distance < best.distance) {
            self.entity = Some(entity);
        }
    }
}

impl Exodus {
    /// Returns the entities at which a variable can be read as the probe requests.
    pub fn locate(&self, kind: Kind, variable: usize, probe: &Probe) -> Result<Found, ReadError> {
        let mut found = Found::default();
        match kind {
            Kind::Global => found.offer(Entity { group: 0, position: 0, distance: 0.0 }),
            Kind::Nodal => {
                let members: Vec<usize> = (0..self.nodes).collect();
                self.choose(kind, 0, &members, probe, &mut found)?;
            }
            Kind::Element | Kind::NodeSet | Kind::SideSet => {
                for group in self.meant(kind, probe)? {
                    let members = self.members(kind, group)?;
                    if group.present.get(variable).copied().unwrap_or(false) {
                        self.choose(kind, group.position, &members, probe, &mut found)?;
                    } else if self.holds(kind, &members, probe)? {
                        found.without_variable.push(group.label());
                    }
                }
            }
        }
        Ok(found)
    }

    /// Returns the ids of the nodes or elements, as in the input deck; counted from 1 if the file has none.
    pub fn ids(&self, kind: Kind) -> Result<Vec<i64>, ReadError> {
        let (map, count) = match kind {
            Kind::Global => return Ok(Vec::new()),
            Kind::Nodal | Kind::NodeSet => ("node_num_map", self.nodes),
            Kind::Element | Kind::SideSet => ("elem_num_map", self.elements()),
        };
        if self.container.shape(map).is_some() {
            self.container.integers(map)
        } else {
            Ok((1..=count as i64).collect())
        }
    }

    fn meant(&self, kind: Kind, probe: &Probe) -> Result<Vec<&Group>, ReadError> {
        let groups = self.groups(kind);
        let Some(wanted) = &probe.block else { return Ok(groups.iter().collect()) };
        let meant: Vec<&Group> = groups.iter().filter(|group| wanted.means(group)).collect();
        if meant.is_empty() {
            let labels: Vec<String> = groups.iter().map(Group::label).collect();
            let what = if kind == Kind::Element { "element block" } else { "set" };
            let text = format!("has no {what} `{wanted}`; it has {}", listed(&labels));
            return Err(ReadError::new(self.path(), text));
        }
        Ok(meant)
    }

    /// Returns the nodes or elements of a group, by position in the file counted from 0.
    pub(super) fn members(&self, kind: Kind, group: &Group) -> Result<Vec<usize>, ReadError> {
        let (name, count) = match kind {
            Kind::NodeSet => (format!("node_ns{}", group.position + 1), self.nodes),
            Kind::SideSet => (format!("elem_ss{}", group.position + 1), self.elements()),
            _ => return Ok((group.start..group.start + group.size).collect()),
        };
        if group.size == 0 {
            return Ok(Vec::new());
        }
        self.positions(&name, count)
    }

    /// Returns the entries of a list of nodes or elements, which Exodus counts from 1.
    fn positions(&self, name: &str, count: usize) -> Result<Vec<usize>, ReadError> {
        let inside = |&number: &i64| number >= 1 && number <= count as i64;
        let numbers = self.container.integers(name)?;
        if let Some(wrong) = numbers.iter().find(|number| !inside(number)) {
            let text = format!("is damaged: `{name}` refers to entry {wrong} of {count}");
            return Err(ReadError::new(self.path(), text));
        }
        Ok(numbers.into_iter().map(|number| number as usize - 1).collect())
    }

    fn holds(&self, kind: Kind, members: &[usize], probe: &Probe) -> Result<bool, ReadError> {
        let Some(id) = probe.id else { return Ok(false) };
        let ids = self.ids(kind)?;
        Ok(members.iter().any(|&m| ids.get(m) == Some(&id)))
    }

    fn choose(
        &self,
        kind: Kind,
        group: usize,
        members: &[usize],
        probe: &Probe,
        found: &mut Found,
    ) -> Result<(), ReadError> {
        let mut offer = |position, distance| found.offer(Entity { group, position, distance });
        if let Some(id) = probe.id {
            let ids = self.ids(kind)?;
            let mut chosen: Vec<usize> =
                (0..members.len()).filter(|&i| ids.get(members[i]) == Some(&id)).collect();
            if kind == Kind::SideSet && chosen.len() + usize::from(probe.side.is_some()) > 1 {
                chosen = self.on_side(group, &chosen, id, probe)?;
            }
            chosen.first().into_iter().for_each(|&i| offer(i, 0.0));
        } else if let Some(point) = probe.nearest {
            let places = match kind {
                Kind::Nodal | Kind::NodeSet => self.coordinates()?,
                _ => self.centroids()?,
            };
            for (i, &member) in members.iter().enumerate() {
                offer(i, distance(places[member], point));
            }
        } else {
            (0..members.len()).for_each(|i| offer(i, 0.0));
        }
        Ok(())
    }

    fn on_side(
        &self,
        group: usize,
        chosen: &[usize],
        id: i64,
        probe: &Probe,
    ) -> Result<Vec<usize>, ReadError> {
        let sides = self.container.integers(&format!("side_ss{}", group + 1))?;
        let of = |i: &usize| sides.get(*i).copied().unwrap_or(0);
        let kept: Vec<usize> =
            chosen.iter().copied().filter(|i| probe.side.is_none_or(|s| of(i) == s)).collect();
        if kept.len() > 1 {
            let list: Vec<String> = kept.iter().map(|i| of(i).to_string()).collect();
            let text = format!(
                "side set `{}` holds several sides of element {id}: give `side`, one of {}",
                self.side_sets[group].label(),
                listed(&list)
            );
            return Err(ReadError::new(self.path(), text));
        }
        Ok(kept)
    }

    /// Returns the coordinates of the nodes; a missing third coordinate is 0.
    pub fn coordinates(&self) -> Result<Vec<[f64; 3]>, ReadError> {
        let mut places = vec![[0.0; 3]; self.nodes];
        for (axis, name) in ["coordx", "coordy", "coordz"].into_iter().enumerate() {
            let values = if self.container.shape(name).is_some() {
                self.container.reals(name)?
            } else if self.container.shape("coord").is_some_and(|s| s.len() == 2 && s[0] > axis) {
                self.container.part("coord", &[Pick::At(axis), Pick::All])?
            } else {
                continue;
            };
            for (place, value) in places.iter_mut().zip(values) {
                place[axis] = value;
            }
        }
        Ok(places)
    }

    /// Returns the mean of each element's nodes.
    pub fn centroids(&self) -> Result<Vec<[f64; 3]>, ReadError> {
        let nodes = self.coordinates()?;
        let mut centroids = Vec::with_capacity(self.elements());
        for block in self.blocks.iter().filter(|block| block.size > 0) {
            let name = format!("connect{}", block.position + 1);
            let per_element = match self.container.shape(&name) {
                Some(&[elements, n]) if elements == block.size && n > 0 => n,
                _ => {
                    let text = format!(
                        "elements of block `{}` do not all have the same number of nodes: choose \
                         by `id` instead of `nearest`",
                        block.label()
                    );
                    return Err(ReadError::new(self.path(), text));
                }
            };
            let connect = self.positions(&name, self.nodes)?;
            for element in connect.chunks_exact(per_element) {
                let mut mean = [0.0; 3];
                for &node in element {
                    for axis in 0..3 {
                        mean[axis] += nodes[node][axis] / per_element as f64;
                    }
                }
                centroids.push(mean);
            }
        }
        Ok(centroids)
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}
