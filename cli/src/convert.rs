//! Command `convert`: the draws of a run, or the measurements of a study, as a table; the emulator of a run as numbers.

mod parquet;
mod table;
mod thrift;

use std::path::Path;

use lacuna::data::{Coordinates, Layout, Replicate};
use lacuna::plugin::reader::{MeasurementSource, Variable};
use lacuna::plugin::{Reader, registry};
use lacuna::run::{Stop, files};
use lacuna_engine::serve;
use lacuna_engine::study::Study;
use lacuna_engine::study::resolve::Use;
use lacuna_run::RunDirectory;

use self::table::{Cells, Column};
use crate::study::{self, Settings};
use crate::terminal::print_data;
use crate::{misuse, print, progress};

/// File of a run directory with the draws.
const DRAWS: &str = "posterior.nc";

/// A format of the table.
#[derive(Clone, Copy)]
enum Format {
    Csv,
    Parquet,
}

/// Runs `lacuna convert SOURCE OUT`.
pub fn convert(source: &Path, settings: &Settings, out: &Path) -> anyhow::Result<()> {
    if out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("nc")) {
        return emulator(source, out);
    }
    let format = format_of(out)?;
    let columns = if source.is_dir() {
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
        print_data(table::csv(&columns).trim_end());
        return Ok(());
    }
    let bytes = match format {
        Format::Csv => table::csv(&columns).into_bytes(),
        Format::Parquet => {
            table::with_names_of_their_own(&columns)?;
            parquet::file(&columns)
        }
    };
    files::write_named(out, &bytes)?;
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

/// The format that the name of a file asks for; CSV for the terminal.
fn format_of(out: &Path) -> anyhow::Result<Format> {
    let ends = |end: &str| out.extension().is_some_and(|own| own.eq_ignore_ascii_case(end));
    if out == Path::new("-") || ends("csv") {
        return Ok(Format::Csv);
    }
    if ends("parquet") {
        return Ok(Format::Parquet);
    }
    let text = format!(
        "error: `{}` ends in none of `.csv` and `.parquet`, the formats of the table, and `.nc`, that of an emulator",
        out.display()
    );
    Err(misuse(text))
}

/// The draws of a run.
fn draws(run: &Path) -> anyhow::Result<Vec<Column>> {
    let path = run.join(DRAWS);
    if !path.is_file() {
        let stop = Stop::new(format!("{} has no draws", run.display()));
        return Err(stop
            .help(format!("a finished run has a file `{DRAWS}`: `lacuna resume RUN`"))
            .into());
    }
    let reader = registry::from_text::<dyn Reader>("hdf5", "").map_err(misuse)?.plugin;
    let contents = reader.inspect(&path).map_err(Stop::from)?;
    Ok(columns_of_draws(&path, &contents.variables)?)
}

/// The measurements of a study in the long form that the reader `csv` reads, converted to the units of the study.
fn measurements(study: &Study) -> Result<Vec<Column>, Stop> {
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
        let replicates = data.replicates.into_iter().collect();
        parts.push(Part { label: label.map(str::to_owned), layout, replicates });
    }
    columns_of_measurements(&parts)
}

/// The measurements of one scenario.
struct Part {
    label: Option<String>,
    layout: Layout,
    replicates: Vec<Replicate>,
}

impl Part {
    /// Number of rows: a replicate has one for each value of the response, a missing one too.
    fn rows(&self) -> impl Iterator<Item = (&Replicate, usize)> {
        self.replicates.iter().flat_map(|r| (0..r.values.len()).map(move |flat| (r, flat)))
    }

    /// Names and units of the axes.
    fn headings(&self) -> Vec<(&str, Option<String>)> {
        let unit = |coordinates: &Coordinates| match coordinates {
            Coordinates::Labels(_) => None,
            Coordinates::Grid { unit, .. } => Some(unit.to_string()),
        };
        self.layout.axes.iter().map(|a| (a.name.as_str(), unit(&a.coordinates))).collect()
    }
}

fn columns_of_measurements(parts: &[Part]) -> Result<Vec<Column>, Stop> {
    let Some(first) = parts.first() else {
        return Err(Stop::new("nothing was measured in the scenarios of the study"));
    };
    let headings = first.headings();
    if let Some(other) = parts.iter().find(|part| part.headings() != headings) {
        let name = other.label.as_deref().unwrap_or_default();
        let text =
            format!("scenario `{name}` has other axes than the first, and a table has one set");
        return Err(Stop::new(text));
    }
    let texts = |text: &dyn Fn(&Part, &Replicate) -> String| {
        let rows = parts.iter().flat_map(|part| part.rows().map(move |row| (part, row)));
        Cells::Texts(rows.map(|(part, (replicate, _))| text(part, replicate)).collect())
    };
    let column =
        |name: &str, unit: Option<String>, cells| Column { name: name.into(), unit, cells };
    let mut columns = Vec::new();
    if first.label.is_some() {
        let labels = texts(&|part, _| part.label.clone().unwrap_or_default());
        columns.push(column("scenario", None, labels));
    }
    columns.push(column("replicate", None, texts(&|_, replicate| replicate.name.clone())));
    for (i, (name, unit)) in headings.into_iter().enumerate() {
        columns.push(column(name, unit, coordinates(parts, i)));
    }
    let numbers = |of: &dyn Fn(&Replicate, usize) -> Option<f64>| {
        let rows = parts.iter().flat_map(Part::rows);
        Cells::Numbers(rows.map(|(replicate, flat)| of(replicate, flat)).collect())
    };
    let layout = &first.layout;
    let values = numbers(&|replicate, flat| replicate.values[flat]);
    columns.push(column(&layout.name, Some(layout.unit.to_string()), values));
    if parts.iter().any(|part| part.replicates.iter().any(|replicate| replicate.sd.is_some())) {
        let sigma = numbers(&|replicate, flat| {
            replicate.values[flat].and_then(|_| replicate.sd.as_ref().map(|sd| sd[flat]))
        });
        columns.push(column("sigma", Some(layout.unit.difference().to_string()), sigma));
    }
    Ok(columns)
}

/// Label or number along an axis of each row.
fn coordinates(parts: &[Part], axis: usize) -> Cells {
    let places = parts.iter().flat_map(|part| {
        part.rows().map(move |(_, flat)| {
            (&part.layout.axes[axis].coordinates, part.layout.place(flat)[axis])
        })
    });
    let is_label = matches!(parts[0].layout.axes[axis].coordinates, Coordinates::Labels(_));
    if is_label {
        let label = |(coordinates, i): (&Coordinates, usize)| match coordinates {
            Coordinates::Labels(labels) => labels[i].clone(),
            Coordinates::Grid { values, .. } => values[i].to_string(),
        };
        return Cells::Texts(places.map(label).collect());
    }
    let number = |(coordinates, i): (&Coordinates, usize)| match coordinates {
        Coordinates::Labels(_) => None,
        Coordinates::Grid { values, .. } => Some(values[i]),
    };
    Cells::Numbers(places.map(number).collect())
}

/// The columns of the table: number of chain and draw, the unknowns, the log density.
fn columns_of_draws(path: &Path, variables: &[Variable]) -> Result<Vec<Column>, Stop> {
    let missing = |name: &str| Stop::new(format!("{} has no numbers `{name}`", path.display()));
    let find = |name: &str| variables.iter().find(|v| v.name == name);
    let coordinate = |name: &str| find(name).map(flat).ok_or_else(|| missing(name));
    let (chain, draw) = (coordinate("posterior/chain")?, coordinate("posterior/draw")?);
    let count = chain.len() * draw.len();
    let of_draw = |i: usize| (chain[i / draw.len()], draw[i % draw.len()]);
    let numbers = |name: &str, of: &dyn Fn(usize) -> f64| Column {
        name: name.to_owned(),
        unit: None,
        cells: Cells::Integers((0..count).map(|i| of(i) as i64).collect()),
    };
    let mut columns = vec![numbers("chain", &|i| of_draw(i).0), numbers("draw", &|i| of_draw(i).1)];
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
        let unit = variable.unit.as_ref().map(ToString::to_string);
        for part in 0..parts {
            let index = if parts == 1 { String::new() } else { format!(" {}", part + 1) };
            let cells = values.iter().skip(part).step_by(parts).copied().map(Some).collect();
            let (name, unit) = (format!("{name}{index}"), unit.clone());
            columns.push(Column { name, unit, cells: Cells::Numbers(cells) });
        }
    }
    Ok(columns)
}

/// All numbers of a variable, the last axis fastest.
fn flat(variable: &Variable) -> Vec<f64> {
    variable.signals.columns.iter().flat_map(|column| column.values.iter().copied()).collect()
}
