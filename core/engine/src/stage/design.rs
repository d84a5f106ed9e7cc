//! Stage 1: choice of the points at which the simulator is run.

use std::collections::HashSet;
use std::path::Path;

use lacuna::data::Parameter;
use lacuna::plugin::Design as Plugin;
use lacuna::plugin::registry::Section;
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::arrays::{self, Array};
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use serde_json::json;

use super::imports::{self, Imported};
use super::read::outside::refuse_points;
use super::stream;
use crate::study::Study;
use crate::study::file::DesignKeys;

/// Points of the runs to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Parameters of each run in physical units, `runs x parameters`.
    pub points: Matrix,
}

const FILE: &str = "points.nc";

impl Artifact for Design {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let points = Array::matrix("points", "run", "parameter", &self.points);
        arrays::write(&folder.join(FILE), &[], &[points])?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        Ok(Self { points: arrays::read(&folder.join(FILE), "points")?.into_matrix() })
    }
}

/// The runs to be made and the imported ones, by name.
#[derive(Debug, Clone)]
pub struct Placed {
    /// Design with all points.
    pub design: Kept<Design>,
    /// Name of each run.
    pub names: Vec<String>,
    /// Finished runs that the last names stand for.
    pub imported: Vec<Imported>,
}

/// Places the runs; `None` if the study has no design.
pub fn stage(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Placed>, Stop> {
    let Some(section) = &study.design else { return Ok(None) };
    let imported = imports::read(study)?;
    let runs = section.common.runs.get();
    let laws: Vec<_> = study.parameters.iter().map(|p| (&p.name, &p.design)).collect();
    let mut inputs = vec![json!([section.built.identity(), runs, laws, study.about.seed])];
    if !section.common.extended.is_empty() {
        inputs.push(json!({ "extended": section.common.extended }));
    }
    if !imported.is_empty() {
        let hashes: Vec<&String> = imported.iter().map(|imported| &imported.hash).collect();
        inputs.push(json!({ "imports": hashes }));
    }
    // A design without extensions keeps the hash that it had before extensions existed.
    let inputs = if inputs.len() == 1 { inputs.remove(0) } else { json!(inputs) };
    observer.begin(Stage::Design.label(), "run", 0);
    let design = run.keep(&Stage::Design.folder(), &inputs, observer, |_| {
        Ok(Design { points: points(section, study, &imported)? })
    })?;
    let names = names(&section.common, &imported)?;
    let brought = names.len() - section.common.total();
    let note = if brought > 0 { format!(", {brought} imported") } else { String::new() };
    observer.end(
        Stage::Design.label(),
        &format!("{} runs by {}{note}", section.common.total(), section.built.name),
    );
    Ok(Some(Placed { design, names, imported }))
}

/// Points of all runs in physical units, those of the imported ones last.
fn points(
    section: &Section<dyn Plugin, DesignKeys>,
    study: &Study,
    imported: &[Imported],
) -> Result<Matrix, Stop> {
    let mut points = physical(&cube(section, study)?, &study.parameters);
    for imported in imported {
        imported.points.iter_rows().for_each(|point| points.push_row(point));
    }
    Ok(points)
}

/// Refuses runs that cannot be imported beside those that the design has: with the name of another run, or outside the
/// declared design.
pub fn accept(study: &Study, runs: &[String], further: &Matrix) -> Result<(), Stop> {
    let Some(section) = &study.design else { return Ok(()) };
    let imported = imports::read(study)?;
    let mut names = names(&section.common, &imported)?;
    let known: HashSet<&String> = names.iter().collect();
    if let Some(twice) = runs.iter().find(|run| known.contains(run)) {
        return Err(Stop::new(format!("there is a run `{twice}` already"))
            .help("give it another name in the column `run` of the table"));
    }
    if study.surrogate.is_none() {
        return Ok(());
    }
    let mut points = points(section, study, &imported)?;
    further.iter_rows().for_each(|point| points.push_row(point));
    names.extend(runs.iter().cloned());
    refuse_points(study, &points, &names)
}

/// Points of the unit cube: the initial runs, followed by the additions in their order.
pub fn cube(section: &Section<dyn Plugin, DesignKeys>, study: &Study) -> Result<Matrix, Stop> {
    let (plugin, stream) = (&section.built.plugin, stream(study, "design"));
    let mut cube = plugin.place(&study.parameters, section.common.runs.get(), &stream)?;
    for count in &section.common.extended {
        let further = plugin.extend(&study.parameters, &cube, count.get(), &stream)?;
        further.iter_rows().for_each(|point| cube.push_row(point));
    }
    Ok(cube)
}

/// Names of all runs of the study's design, and where those begin that are imported; empty without a design.
pub fn run_names(study: &Study) -> Result<(Vec<String>, usize), Stop> {
    let Some(section) = &study.design else { return Ok((Vec::new(), 0)) };
    Ok((names(&section.common, &imports::read(study)?)?, section.common.total()))
}

/// Names of all runs; those of the initial runs do not change when others are added.
fn names(keys: &DesignKeys, imported: &[Imported]) -> Result<Vec<String>, Stop> {
    let mut names = super::simulate::names(keys.runs.get());
    let digits = names.last().map_or(0, |last| last.len() - "run".len());
    names.extend((names.len() + 1..=keys.total()).map(|i| format!("run{i:0digits$}")));
    let mut known: HashSet<String> = names.iter().cloned().collect();
    for imported in imported {
        if let Some(twice) = imported.names.iter().find(|name| !known.insert((*name).clone())) {
            return Err(Stop::new(format!(
                "the run `{twice}` in {} has the name of another run",
                imported.folder.display()
            ))
            .help("give it another name in the table from which it was imported"));
        }
        names.extend(imported.names.iter().cloned());
    }
    Ok(names)
}

/// Maps points of the unit cube to physical units by the quantile function of each parameter's design distribution.
pub fn physical(cube: &Matrix, parameters: &[Parameter]) -> Matrix {
    Matrix::from_fn(cube.rows(), cube.columns(), |i, j| parameters[j].design.quantile(cube[(i, j)]))
}
