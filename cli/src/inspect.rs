//! Command `inspect`: the contents of a file as a reader sees them.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use lacuna::data::Table;
use lacuna::plugin::reader::{Contents, Variable};
use lacuna::plugin::{Reader, registry};
use lacuna::run::{Stop, files};
use lacuna::text::nearest::nearest;

use crate::plugins::Libraries;
use crate::terminal::print_data;
use crate::{misuse, plugins, print};

/// Runs `lacuna inspect FILE`.
pub fn inspect(
    path: &Path,
    reader: Option<&str>,
    variable: Option<&str>,
    csv: Option<&Path>,
    libraries: &Libraries,
) -> anyhow::Result<()> {
    plugins::load(libraries)?;
    let (name, reader) = choose(path, reader)?;
    let contents = reader.inspect(path).map_err(Stop::from)?;
    let Some(variable) = variable else {
        print(&format!("{}: {} (reader `{name}`)", path.display(), contents.format));
        for (name, value) in &contents.facts {
            print(&format!("  {name}: {value}"));
        }
        table(&contents.variables.iter().collect::<Vec<_>>());
        return Ok(());
    };
    let found: Vec<&Variable> = contents.variables.iter().filter(|v| v.name == variable).collect();
    if found.is_empty() {
        return Err(no_variable(path, variable, &contents));
    }
    match csv {
        None => table(&found),
        Some(out) => write_csv(&found, out)?,
    }
    Ok(())
}

fn choose(path: &Path, wanted: Option<&str>) -> anyhow::Result<(&'static str, Box<dyn Reader>)> {
    if let Some(name) = wanted {
        let entry = registry::find::<dyn Reader>(name).map_err(|problem| {
            let expected = problem.expected.clone().unwrap_or_default();
            misuse(format!("error: {}: expected {expected}", problem.message))
        })?;
        return Ok((entry.name, build(entry.name)?));
    }
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(4096).read_to_end(&mut head));
    read.map_err(|error| files::cannot_read(path, &error))?;
    for entry in registry::entries::<dyn Reader>() {
        // A reader with required options cannot recognise files by itself.
        let Ok(reader) = build(entry.name) else { continue };
        if reader.recognises(path, &head) {
            return Ok((entry.name, reader));
        }
    }
    let stop = Stop::new(format!("no reader recognises {}", path.display()));
    Err(stop.help("name one with `--reader`; `lacuna plugins reader` lists them").into())
}

fn build(name: &str) -> anyhow::Result<Box<dyn Reader>> {
    let built = registry::from_text::<dyn Reader>(name, "").map_err(misuse)?;
    Ok(built.plugin)
}

/// Width of a column above which longer cells shift the cells to their right.
const WIDEST: usize = 60;

fn table(variables: &[&Variable]) {
    let mut rows = vec![["variable", "on", "axes", "unit", "range"].map(str::to_owned)];
    rows.extend(variables.iter().map(|v| row(v)));
    let longest = |j: usize| rows.iter().map(|row| row[j].chars().count()).max().unwrap_or(0);
    let width = |j: usize| longest(j).min(WIDEST);
    let widths = [0, 1, 2, 3].map(width);
    for row in &rows {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}  "));
        print(format!("  {}{}", cells.collect::<String>(), row[4]).trim_end());
    }
}

fn row(variable: &Variable) -> [String; 5] {
    let axes = variable.axes.iter().map(|(name, length)| format!("{name} {length}"));
    let mut range = match variable.range {
        Some((low, high)) => format!("{low:.6e} to {high:.6e}"),
        None => String::new(),
    };
    if variable.not_finite > 0 {
        range.push_str(&format!(" ({} not finite)", variable.not_finite));
    }
    [
        variable.name.clone(),
        variable.on.clone(),
        axes.collect::<Vec<_>>().join(" x "),
        variable.unit.as_ref().map(ToString::to_string).unwrap_or_default(),
        range,
    ]
}

fn no_variable(path: &Path, name: &str, contents: &Contents) -> anyhow::Error {
    let names = || contents.variables.iter().map(|v| v.name.as_str());
    let near = nearest(name, names())
        .map_or(String::new(), |near| format!("\nhelp: did you mean `{near}`?"));
    misuse(format!("error: {} has no variable `{name}`{near}", path.display()))
}

fn write_csv(variables: &[&Variable], out: &Path) -> anyhow::Result<()> {
    let text: Vec<String> = variables.iter().map(|v| csv(&v.signals)).collect();
    let text = text.join("\n");
    if out == Path::new("-") {
        print_data(text.trim_end());
        return Ok(());
    }
    files::write_named(out, text.as_bytes())?;
    print(&format!("wrote {}", out.display()));
    Ok(())
}

fn csv(table: &Table) -> String {
    let head: Vec<String> = table
        .columns
        .iter()
        .map(|c| match &c.unit {
            Some(unit) => quoted(&format!("{} [{unit}]", c.name)),
            None => quoted(&c.name),
        })
        .collect();
    let mut text = head.join(",") + "\n";
    for i in 0..table.rows() {
        let cells: Vec<String> = table.columns.iter().map(|c| c.values[i].to_string()).collect();
        text.push_str(&(cells.join(",") + "\n"));
    }
    text
}

pub fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
