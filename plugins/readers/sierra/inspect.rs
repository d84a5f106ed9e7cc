//! Contents of a Sierra file.

use std::path::Path;

use lacuna::data::Table;
use lacuna::data::table::Column;
use lacuna::plugin::reader::{Contents, ReadError, Variable};

use super::exodus::{Exodus, Group, Kind};
use super::heartbeat::Heartbeat;
use super::parts::{part_name, part_paths};
use super::signal::Output;
use crate::readers::contents::{MOST_SIGNAL_VALUES, fact, limits};
use crate::readers::listed;

/// Returns true if the beginning of a netCDF container shows Exodus II: by the names in its header or, for netCDF-4,
/// whose names may be anywhere, by the file name.
pub(super) fn looks_like_exodus(path: &Path, head: &[u8]) -> bool {
    let has = |name: &[u8]| head.windows(name.len()).any(|window| window == name);
    if has(b"api_version") || has(b"api version") || has(b"num_el_blk") || has(b"len_line") {
        return true;
    }
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let stem = part_name(name).map_or(name, |(stem, _, _)| stem);
    let extension = Path::new(stem).extension().and_then(|e| e.to_str()).unwrap_or_default();
    head.starts_with(b"\x89HDF")
        && ["e", "ex", "ex2", "exo", "exii", "g", "gen", "h", "hisr", "rslt"]
            .iter()
            .any(|known| extension.eq_ignore_ascii_case(known))
}

pub(super) fn contents(path: &Path) -> Result<Contents, ReadError> {
    match Output::open(path)? {
        Output::Heartbeat(table) => Ok(heartbeat(&table)),
        Output::Exodus(results) => {
            // In several parts, the part with this path; otherwise the first.
            let parts = results.parts();
            let file = parts.iter().find(|part| part.path() == path).unwrap_or(&parts[0]);
            let mut contents = exodus(file)?;
            let (_, written) = part_paths(path);
            if written > 1 {
                let text = format!("one of {written}, {} are here", parts.len());
                contents.facts.insert(0, fact("part", text));
            }
            Ok(contents)
        }
    }
}

fn heartbeat(table: &Heartbeat) -> Contents {
    let rows = table.columns.first().map_or(0, Vec::len);
    let mut facts = vec![fact("rows", rows), fact("columns", table.names.len())];
    match table.time {
        Some(time) => facts.push(times(&table.columns[time])),
        None => facts.push(fact("time", "there is no column `time`")),
    }
    facts.extend(table.notes.iter().map(|note| fact("note", note)));
    let column = |i: usize| Column {
        name: table.names[i].clone(),
        unit: None,
        values: table.columns[i].clone(),
    };
    let variables = (0..table.names.len())
        .map(|i| {
            let (range, not_finite) = limits(&table.columns[i]);
            let time = table.time.filter(|&t| t != i);
            Variable {
                name: table.names[i].clone(),
                on: "column".to_owned(),
                axes: vec![("time".to_owned(), rows)],
                unit: None,
                range,
                not_finite,
                signals: Table { columns: time.into_iter().chain([i]).map(column).collect() },
            }
        })
        .collect();
    Contents { format: format!("Sierra heartbeat: {}", table.layout), facts, variables }
}

pub(super) fn exodus(file: &Exodus) -> Result<Contents, ReadError> {
    let history = file.elements() == 1 && file.names(Kind::Element).is_empty();
    let what = if history { "history" } else { "results" };
    let mut variables = Vec::new();
    for kind in Kind::ALL {
        for variable in 0..file.names(kind).len() {
            if matches!(kind, Kind::Global | Kind::Nodal) {
                variables.push(described(file, kind, variable, None)?);
            }
            let groups = file.groups(kind).iter().filter(|g| g.size > 0 && g.present[variable]);
            for group in groups {
                variables.push(described(file, kind, variable, Some(group))?);
            }
        }
    }
    Ok(Contents {
        format: format!("Exodus II {what}, {}", file.container.format()),
        facts: facts(file)?,
        variables,
    })
}

fn facts(file: &Exodus) -> Result<Vec<(String, String)>, ReadError> {
    let mut facts = Vec::new();
    facts.extend(file.container.text("title").map(|title| fact("title", title)));
    if file.container.shape("qa_records").is_some() {
        let records = file.container.texts("qa_records")?;
        facts.extend(records.chunks(4).map(|record| fact("written by", record.join(" "))));
    }
    facts.push(fact("steps", file.times.len()));
    if !file.times.is_empty() {
        facts.push(times(&file.times));
    }
    if file.incomplete_steps > 0 {
        facts.push(fact("incomplete steps", file.incomplete_steps));
    }
    facts.push(fact("nodes", file.nodes));
    facts.push(fact("elements", file.elements()));
    for (name, groups) in [
        ("element blocks", &file.blocks),
        ("node sets", &file.node_sets),
        ("side sets", &file.side_sets),
    ] {
        if !groups.is_empty() {
            let labels: Vec<String> = groups.iter().map(Group::label).collect();
            facts.push(fact(name, listed(&labels)));
        }
    }
    Ok(facts)
}

fn times(times: &[f64]) -> (String, String) {
    let (range, _) = limits(times);
    fact("time", range.map_or("none".to_owned(), |(first, last)| format!("{first:e} to {last:e}")))
}

fn described(
    file: &Exodus,
    kind: Kind,
    variable: usize,
    group: Option<&Group>,
) -> Result<Variable, ReadError> {
    let name = file.names(kind)[variable].clone();
    let steps = file.times.len();
    let entities = match kind {
        Kind::Global => 1,
        Kind::Nodal => file.nodes,
        _ => group.map_or(0, |group| group.size),
    };
    let mut axes = vec![("time".to_owned(), steps)];
    if kind != Kind::Global {
        axes.push((kind.carrier().to_owned(), entities));
    }
    let on = match (kind, group) {
        (Kind::Element, Some(group)) => format!("element block `{}`", group.label()),
        (Kind::NodeSet, Some(group)) => format!("node set `{}`", group.label()),
        (Kind::SideSet, Some(group)) => format!("side set `{}`", group.label()),
        _ => kind.label().to_owned(),
    };
    let mut described = Variable { name, on, axes, ..Variable::default() };
    if steps == 0 {
        return Ok(described);
    }
    let position = group.map_or(0, |group| group.position);
    let mut values = match kind {
        Kind::Global => file.values(kind, variable, 0, 0)?,
        _ => file.all_values(kind, variable, position)?,
    };
    values.truncate(steps * entities);
    (described.range, described.not_finite) = limits(&values);
    if values.len() == steps * entities && values.len() <= MOST_SIGNAL_VALUES {
        described.signals = signals(file, kind, &described.name, group, &values)?;
    }
    Ok(described)
}

/// Returns the time and one column per entity, named by the entity's id.
fn signals(
    file: &Exodus,
    kind: Kind,
    name: &str,
    group: Option<&Group>,
    values: &[f64],
) -> Result<Table, ReadError> {
    let column = |name: String, values: Vec<f64>| Column { name, unit: None, values };
    let mut columns = vec![column("time".to_owned(), file.times.clone())];
    if kind == Kind::Global {
        columns.push(column(name.to_owned(), values.to_vec()));
        return Ok(Table { columns });
    }
    let ids = file.ids(kind)?;
    let members = match group {
        Some(group) => file.members(kind, group)?,
        None => (0..file.nodes).collect(),
    };
    for (i, member) in members.iter().enumerate() {
        let id = ids.get(*member).copied().unwrap_or_default();
        let values = values.iter().skip(i).step_by(members.len()).copied().collect();
        columns.push(column(format!("{name} {} {id}", kind.carrier()), values));
    }
    Ok(Table { columns })
}
