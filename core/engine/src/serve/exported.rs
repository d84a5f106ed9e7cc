//! The emulator of a finished run as a file for other programs.

use std::path::Path;

use lacuna::data::Layouts;
use lacuna::plugin::surrogate::{Table, Tables};
use lacuna::run::{Observer, Stop};
use lacuna_run::RunDirectory;
use lacuna_run::arrays::{self, Array};

use super::emulated::Emulated;
use crate::pipeline;
use crate::study::Study;

/// Version of the form of the file.
const VERSION: &str = "1";

/// Writes the emulator of a finished run as a netCDF file, whose form is described in `docs/emulator_file.md`.
///
/// # Errors
/// If the study has no surrogate, or if its surrogate has no form that other programs can evaluate.
pub fn export(
    study: &Study,
    mut run: RunDirectory,
    observer: &dyn Observer,
    out: &Path,
) -> Result<(), Stop> {
    let Some(surrogate) = &study.surrogate else {
        return Err(Stop::new("the study has no surrogate, so that there is no emulator to write"));
    };
    let (learned, _) = pipeline::calibrate_emulated(study, &mut run, observer)?;
    let problem = learned.problem();
    let (Some(emulator), Some(emulated)) = (problem.emulator(), Emulated::of(study, &problem)?)
    else {
        return Err(Stop::new("the run has no emulator"));
    };
    let tables = emulator.tables().map_err(|reason| {
        let name = &surrogate.built.name;
        Stop::new(format!("the emulator of `{name}` cannot be written as numbers: {reason}"))
            .help("`lacuna serve` and the Python package evaluate every emulator")
    })?;
    write(study, &tables, &emulated, out)
}

fn write(study: &Study, tables: &Tables, emulated: &Emulated<'_>, out: &Path) -> Result<(), Stop> {
    let all: Vec<usize> = (0..study.parameters.len()).collect();
    let used = if tables.parameters.is_empty() { &all } else { &tables.parameters };
    let of = |say: &dyn Fn(&lacuna::data::Parameter) -> String| -> Vec<String> {
        used.iter().map(|&i| say(&study.parameters[i])).collect()
    };
    let mut attributes = vec![
        ("file_version", VERSION.to_owned()),
        ("lacuna", env!("CARGO_PKG_VERSION").to_owned()),
        ("study", study.name.clone()),
        ("parameters", of(&|p| p.name.clone()).join(" ")),
        ("parameter_units", of(&|p| p.unit.to_string()).join("\n")),
        ("response", study.layouts.name().to_owned()),
        ("unit", study.layouts.unit().to_string()),
        ("shape", shape(&study.layouts)),
        ("layouts", serde_json::to_string(&study.layouts).unwrap_or_default()),
    ];
    attributes.extend(tables.texts.iter().map(|(name, text)| (name.as_str(), text.clone())));
    let ends = |end: fn(&(f64, f64)) -> f64| -> Vec<f64> {
        used.iter().map(|&i| end(&emulated.region()[i])).collect()
    };
    let mut own = Tables::default();
    own.column("low", "parameter", ends(|ends| ends.0));
    own.column("high", "parameter", ends(|ends| ends.1));
    own.column("error_sd", "output", emulated.over_prior().to_vec());
    let arrays: Vec<Array<'_>> = own.arrays.iter().chain(&tables.arrays).map(array).collect();
    arrays::write_named(out, &attributes, &arrays)
}

fn array(table: &Table) -> Array<'_> {
    Array {
        name: table.name.clone(),
        dimensions: table.dimensions.clone(),
        values: table.values.as_slice().into(),
        unit: None,
    }
}

/// Lengths of the axes of the response, or the number of its values if the scenarios have different axes.
fn shape(layouts: &Layouts) -> String {
    let lengths = match &layouts.blocks[..] {
        [one] => one.shape(),
        _ => vec![layouts.len()],
    };
    let lengths: Vec<String> = lengths.iter().map(usize::to_string).collect();
    lengths.join(" ")
}
