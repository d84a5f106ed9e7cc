//! Results of a run: one Exodus file, or one file per processor (`run.e.96.00`, ...).

use std::path::{Path, PathBuf};

use lacuna::plugin::reader::ReadError;

use super::exodus::{Exodus, Kind};
use super::locate::{Entity, Found};
use super::probe::Probe;
use crate::readers::listed;

/// The files of one run. A node or element lies in one part, or in several with equal values if it is shared; globals
/// are in all.
pub struct Results {
    parts: Vec<Exodus>,
    expected: usize,
}

impl Results {
    /// Opens a file, together with the other parts if its name shows that it is one of several. The common name of
    /// the parts (`run.e` for `run.e.96.00`) is accepted too.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let (paths, expected) = part_paths(path);
        let parts = paths.iter().map(|p| Exodus::open(p)).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { parts, expected })
    }

    /// Wraps a single file.
    pub fn single(file: Exodus) -> Self {
        Self { parts: vec![file], expected: 1 }
    }

    /// Returns the files, in the order of the processors.
    pub fn parts(&self) -> &[Exodus] {
        &self.parts
    }

    /// Returns times and values of one component of a variable at the location of the probe. `name` takes the place
    /// of the probe's own variable name.
    pub fn series(&self, name: &str, probe: &Probe) -> Result<(Vec<f64>, Vec<f64>), ReadError> {
        let kind = self.kind(name, probe)?;
        let (part, entity) = self.locate(kind, name, probe)?;
        let file = &self.parts[part];
        let variable = file.variable(kind, name).ok_or_else(|| self.unknown(name))?;
        let values = file.values(kind, variable, entity.group, entity.position)?;
        Ok((file.times.clone(), values))
    }

    fn first(&self) -> &Exodus {
        &self.parts[0]
    }

    fn complain(&self, text: impl Into<String>) -> ReadError {
        ReadError::new(self.first().path(), text)
    }

    fn unknown(&self, name: &str) -> ReadError {
        let known: Vec<String> = Kind::ALL
            .iter()
            .flat_map(|&kind| self.first().names(kind))
            .map(ToString::to_string)
            .collect();
        self.complain(format!("has no variable `{name}`; it has {}", listed(&known)))
    }

    fn kind(&self, name: &str, probe: &Probe) -> Result<Kind, ReadError> {
        let has = |kind: Kind| self.first().variable(kind, name).is_some();
        if let Some(kind) = probe.kind {
            if has(kind) {
                return Ok(kind);
            }
            let known = listed(self.first().names(kind));
            let label = kind.label();
            return Err(self.complain(format!("has no {label} variable `{name}`; it has {known}")));
        }
        let placed = probe.is_placed();
        let kinds: Vec<Kind> = Kind::ALL
            .into_iter()
            .filter(|&kind| has(kind) && !(placed && kind == Kind::Global))
            .filter(|&kind| !(probe.block.is_some() && kind == Kind::Nodal))
            .collect();
        match kinds[..] {
            [kind] => Ok(kind),
            [Kind::Global, ..] => Ok(Kind::Global),
            [] if has(Kind::Global) => Err(self.complain(format!(
                "`{name}` is a global variable: leave out `id`, `nearest` and `block`"
            ))),
            [] => Err(self.unknown(name)),
            _ => {
                let labels: Vec<&str> = kinds.iter().map(|kind| kind.label()).collect();
                let text = format!("several variables are called `{name}`: give `kind`, one of ");
                Err(self.complain(text + &listed(&labels)))
            }
        }
    }

    fn locate(&self, kind: Kind, name: &str, probe: &Probe) -> Result<(usize, Entity), ReadError> {
        if kind == Kind::Global {
            return Ok((0, Entity { group: 0, position: 0, distance: 0.0 }));
        }
        let mut best: Option<(usize, Entity)> = None;
        let mut all = Found::default();
        for (number, part) in self.parts.iter().enumerate() {
            let variable = part.variable(kind, name).ok_or_else(|| {
                ReadError::new(part.path(), format!("has no {} variable `{name}`", kind.label()))
            })?;
            let found = part.locate(kind, variable, probe)?;
            all.count += found.count;
            all.without_variable.extend(found.without_variable);
            if let Some(entity) = found.entity
                && best.is_none_or(|(_, nearest)| entity.distance < nearest.distance)
            {
                best = Some((number, entity));
            }
        }
        match self.objection(kind, name, probe, &all) {
            Some(text) => Err(self.complain(text)),
            None => best.ok_or_else(|| self.complain(format!("has no `{name}`"))),
        }
    }

    /// Describes why the entities found in all parts together are not the single one that the probe needs; `None` if
    /// they are.
    fn objection(&self, kind: Kind, name: &str, probe: &Probe, found: &Found) -> Option<String> {
        let carrier = kind.carrier();
        let missing = self.expected - self.parts.len();
        let absent = if missing == 0 {
            String::new()
        } else {
            format!(" ({missing} of the run's {} files are missing)", self.expected)
        };
        if found.count == 0 && !found.without_variable.is_empty() {
            return Some(format!(
                "{} variable `{name}` does not exist on {}: the file's truth table says so",
                kind.label(),
                listed(&found.without_variable)
            ));
        }
        if found.count == 0 {
            let id = probe.id.map_or(String::new(), |id| format!(" {id}"));
            return Some(format!("has no {carrier}{id} with `{name}`{absent}"));
        }
        if probe.nearest.is_some() && probe.id.is_none() && missing > 0 {
            return Some(format!(
                "the nearest {carrier} is unknown{absent}: choose by `id` or join the files \
                 with `epu`"
            ));
        }
        if probe.id.is_none() && probe.nearest.is_none() && found.count > 1 {
            let count = found.count;
            return Some(format!(
                "`{name}` has a value at {count} {carrier}s: give `id` or `nearest`"
            ));
        }
        None
    }
}

/// Returns the existing parts that belong to `path`, in order, and the number of parts that the run wrote.
pub(super) fn part_paths(path: &Path) -> (Vec<PathBuf>, usize) {
    let alone = (vec![path.to_owned()], 1);
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return alone };
    if let Some((stem, count, width)) = part_name(name) {
        return existing(path, stem, count, width).unwrap_or(alone);
    }
    if path.exists() {
        return alone;
    }
    let Some(folder) = path.parent() else { return alone };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    names.sort();
    names
        .iter()
        .find_map(|other| {
            let (stem, count, width) = part_name(other)?;
            (stem == name).then(|| existing(path, stem, count, width))?
        })
        .unwrap_or(alone)
}

/// Splits `run.e.96.07` into the common name, the number of parts and the number of digits of a part.
pub(super) fn part_name(name: &str) -> Option<(&str, usize, usize)> {
    let (rest, part) = name.rsplit_once('.')?;
    let (stem, count) = rest.rsplit_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    if !digits(part) || !digits(count) || part.len() != count.len() {
        return None;
    }
    let (count, number): (usize, usize) = (count.parse().ok()?, part.parse().ok()?);
    // No machine has the files of a million processors in one folder: a larger number is not a part count.
    (number < count && count <= 1_000_000).then_some((stem, count, part.len()))
}

fn existing(path: &Path, stem: &str, count: usize, width: usize) -> Option<(Vec<PathBuf>, usize)> {
    let paths: Vec<PathBuf> = (0..count)
        .map(|part| path.with_file_name(format!("{stem}.{count}.{part:0width$}")))
        .filter(|part| part.exists())
        .collect();
    (!paths.is_empty()).then_some((paths, count))
}
