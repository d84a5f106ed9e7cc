//! Command `convert`: the draws of a run as a table.

use std::path::Path;

use lacuna::plugin::reader::Variable;
use lacuna::plugin::{Reader, registry};
use lacuna::run::{Stop, files};

use crate::{misuse, print};

/// File of a run directory with the draws.
const DRAWS: &str = "posterior.nc";

/// A column of the table: heading and numbers, one per draw.
struct Column {
    heading: String,
    values: Vec<f64>,
}

/// Runs `lacuna convert RUN OUT`.
pub fn convert(run: &Path, out: &Path) -> anyhow::Result<()> {
    let is_csv = out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    if out != Path::new("-") && !is_csv {
        let text =
            format!("error: `{}` does not end in `.csv`, the format of the table", out.display());
        return Err(misuse(text));
    }
    if !run.is_dir() {
        let text = format!(
            "error: `{}` is not a run directory\nhelp: `lacuna inspect FILE --variable NAME --csv OUT` writes the \
             signals of a file",
            run.display()
        );
        return Err(misuse(text));
    }
    let path = run.join(DRAWS);
    if !path.is_file() {
        let stop = Stop::new(format!("{} has no draws", run.display()));
        return Err(stop
            .help(format!("a finished run has a file `{DRAWS}`: `lacuna resume RUN`"))
            .into());
    }
    let reader = registry::from_text::<dyn Reader>("hdf5", "").map_err(misuse)?.plugin;
    let contents = reader.inspect(&path).map_err(Stop::from)?;
    let columns = columns(&path, &contents.variables)?;
    let text = table(&columns);
    if out == Path::new("-") {
        print(text.trim_end());
        return Ok(());
    }
    files::write_atomic(out, text.as_bytes())?;
    print(&format!("wrote {}", out.display()));
    Ok(())
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
