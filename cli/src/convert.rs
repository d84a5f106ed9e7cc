//! Command `convert`: the draws of a run, or the measurements of a study, as a table; the emulator of a run as numbers.

use std::path::Path;

use lacuna::data::{Coordinates, Layout, Replicate};
use lacuna::plugin::reader::{MeasurementSource, Variable};
use lacuna::plugin::{Reader, registry};
use lacuna::run::{Stop, files};
use lacuna_engine::serve;
use lacuna_engine::study::Study;
use lacuna_engine::study::resolve::Use;
use lacuna_run::RunDirectory;

use crate::study::{self, Settings};
use crate::{misuse, print, progress};

/// File of a run directory with the draws.
const DRAWS: &str = "posterior.nc";

/// A column of the table: heading and numbers, one per draw.
struct Column {
    heading: String,
    values: Vec<f64>,
}

/// Runs `lacuna convert SOURCE OUT`.
pub fn convert(source: &Path, settings: &Settings, out: &Path) -> anyhow::Result<()> {
    if out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("nc")) {
        return emulator(source, out);
    }
    let is_csv = out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    if out != Path::new("-") && !is_csv {
        let text = format!(
            "error: `{}` ends neither in `.csv`, for a table, nor in `.nc`, for the emulator of a run",
            out.display()
        );
        return Err(misuse(text));
    }
    let text = if source.is_dir() {
        draws(source)?
    } else if source.extension().is_some_and(|extension| extension == "toml") {
        measurements(&study::load(source, settings)?)?
    } else {
        let text = format!(
            "error: `{}` is neither a run directory nor a study\nhelp: `lacuna inspect FILE --variable NAME --csv OUT` \
             writes the signals of a file",
            source.display()
        );
        return Err(misuse(text));
    };
    if out == Path::new("-") {
        print(text.trim_end());
        return Ok(());
    }
    files::write_atomic(out, text.as_bytes())?;
    print(&format!("wrote {}", out.display()));
    Ok(())
}

/// Writes the emulator of a run.
fn emulator(run: &Path, out: &Path) -> anyhow::Result<()> {
    if !run.is_dir() {
        let text = format!(
            "error: `{}` is no run directory: the emulator in `{}` would be that of a run\nhelp: `lacuna convert RUN OUT.nc`",
            run.display(),
            out.display()
        );
        return Err(misuse(text));
    }
    let study = study::kept_study_for(run, Use::Look)?;
    let mut directory = RunDirectory::open(run)?;
    directory.look();
    serve::export(&study, directory, &*progress::observer(), out)?;
    print(&format!("wrote {}", out.display()));
    Ok(())
}

/// The draws of a run.
fn draws(run: &Path) -> anyhow::Result<String> {
    let path = run.join(DRAWS);
    if !path.is_file() {
        let stop = Stop::new(format!("{} has no draws", run.display()));
        return Err(stop
            .help(format!("a finished run has a file `{DRAWS}`: `lacuna resume RUN`"))
            .into());
    }
    let reader = registry::from_text::<dyn Reader>("hdf5", "").map_err(misuse)?.plugin;
    let contents = reader.inspect(&path).map_err(Stop::from)?;
    Ok(table(&columns(&path, &contents.variables)?))
}

/// The measurements of a study in the long form that the reader `csv` reads, converted to the units of the study.
fn measurements(study: &Study) -> Result<String, Stop> {
    let section = study
        .measurements
        .as_ref()
        .ok_or_else(|| Stop::new("the study has no section `measurements`"))?;
    let mut parts = Vec::new();
    for scenario in study.scenarios.iter().filter(|scenario| !scenario.unmeasured) {
        let Some((layout, _)) = study.layouts.of_scenario(&scenario.name) else { continue };
        let label = scenario.label();
        let source =
            MeasurementSource { directory: &study.directory, scenario: label, layout: &layout };
        let data = section.built.plugin.measurements(&source)?;
        if data.covariance.is_some() {
            let stop =
                Stop::new("a table of measurements has no place for the covariance of their noise");
            return Err(
                stop.help("take `covariance` out of the section, and name it beside the table")
            );
        }
        parts.push((label.map(str::to_owned), layout, data.replicates));
    }
    let Some((label, first, _)) = parts.first() else {
        return Err(Stop::new("nothing was measured in the scenarios of the study"));
    };
    let sigma = parts.iter().any(|(.., replicates)| replicates.iter().any(|r| r.sd.is_some()));
    let mut headings = Vec::new();
    headings.extend(label.as_ref().map(|_| "scenario".to_owned()));
    headings.push("replicate".to_owned());
    for axis in &first.axes {
        headings.push(match &axis.coordinates {
            Coordinates::Labels(_) => axis.name.clone(),
            Coordinates::Grid { unit, .. } => format!("{} [{unit}]", axis.name),
        });
    }
    headings.push(format!("{} [{}]", first.name, first.unit));
    headings.extend(sigma.then(|| format!("sigma [{}]", first.unit.difference())));
    let mut text = line(&headings);
    for (label, layout, replicates) in &parts {
        for replicate in replicates {
            rows(&mut text, label.as_deref(), layout, replicate, sigma);
        }
    }
    Ok(text)
}

/// Adds the rows of a replicate; a missing value is a blank.
fn rows(
    text: &mut String,
    label: Option<&str>,
    layout: &Layout,
    replicate: &Replicate,
    sigma: bool,
) {
    for (flat, value) in replicate.values.iter().enumerate() {
        let mut cells: Vec<String> = label.map(str::to_owned).into_iter().collect();
        cells.push(replicate.name.clone());
        let place = layout.place(flat);
        cells.extend(layout.axes.iter().zip(place).map(|(axis, i)| match &axis.coordinates {
            Coordinates::Labels(labels) => labels[i].clone(),
            Coordinates::Grid { values, .. } => values[i].to_string(),
        }));
        cells.push(value.map_or(String::new(), |y| y.to_string()));
        if sigma {
            let sd = replicate.sd.as_ref().filter(|_| value.is_some()).map(|sd| sd[flat]);
            cells.push(sd.map_or(String::new(), |sd| sd.to_string()));
        }
        text.push_str(&line(&cells));
    }
}

fn line(cells: &[String]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| crate::inspect::quoted(cell)).collect();
    cells.join(",") + "\n"
}

/// The columns of the table: number of chain and draw, the unknowns, the log density.
fn columns(path: &Path, variables: &[Variable]) -> Result<Vec<Column>, Stop> {
    let missing = |name: &str| Stop::new(format!("{} has no numbers `{name}`", path.display()));
    let find = |name: &str| variables.iter().find(|v| v.name == name);
    let coordinate = |name: &str| find(name).map(flat).ok_or_else(|| missing(name));
    let (chain, draw) = (coordinate("posterior/chain")?, coordinate("posterior/draw")?);
    let count = chain.len() * draw.len();
    let of_draw = |i: usize| (chain[i / draw.len()], draw[i % draw.len()]);
    let mut columns = vec![
        Column { heading: "chain".into(), values: (0..count).map(|i| of_draw(i).0).collect() },
        Column { heading: "draw".into(), values: (0..count).map(|i| of_draw(i).1).collect() },
    ];
    let log_density = find("sample_stats/lp").ok_or_else(|| missing("sample_stats/lp"))?;
    let unknowns = variables.iter().filter(|v| v.name.starts_with("posterior/"));
    for variable in unknowns.chain([log_density]) {
        let lengths: Vec<usize> = variable.axes.iter().map(|(_, length)| *length).collect();
        if lengths.len() < 2 || lengths[..2] != [chain.len(), draw.len()] {
            continue;
        }
        let values = flat(variable);
        let parts: usize = lengths[2..].iter().product();
        if values.len() != count * parts {
            return Err(missing(&variable.name));
        }
        let name = variable.name.rsplit('/').next().unwrap_or_default();
        let unit = variable.unit.as_ref().map_or(String::new(), |unit| format!(" [{unit}]"));
        for part in 0..parts {
            let index = if parts == 1 { String::new() } else { format!(" {}", part + 1) };
            let values = values.iter().skip(part).step_by(parts).copied().collect();
            columns.push(Column { heading: format!("{name}{index}{unit}"), values });
        }
    }
    Ok(columns)
}

/// All numbers of a variable, the last axis fastest.
fn flat(variable: &Variable) -> Vec<f64> {
    variable.signals.columns.iter().flat_map(|column| column.values.iter().copied()).collect()
}

fn table(columns: &[Column]) -> String {
    let headings: Vec<String> =
        columns.iter().map(|c| crate::inspect::quoted(&c.heading)).collect();
    let mut text = headings.join(",") + "\n";
    for i in 0..columns.first().map_or(0, |c| c.values.len()) {
        let cells: Vec<String> = columns.iter().map(|c| c.values[i].to_string()).collect();
        text.push_str(&(cells.join(",") + "\n"));
    }
    text
}
