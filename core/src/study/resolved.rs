//! A study written out: every default filled in, for `resolved.toml`.

use toml::Table;

use super::emit::{Unwritable, to_table};
use super::file::{ResponseSection, ScenarioSection};
use super::gap::Swap;
use super::resolve::Study;
use crate::plugin::registry::Section;

/// The study with every default filled in.
pub(super) fn table(
    study: &Study,
    response: Option<&ResponseSection>,
    scenarios: &[ScenarioSection],
) -> Result<Table, Unwritable> {
    let mut about = to_table(&study.about)?;
    about.insert("name".to_owned(), study.name.clone().into());
    let directory = std::path::absolute(&study.directory).unwrap_or(study.directory.clone());
    about.insert("directory".to_owned(), directory.display().to_string().into());
    let parameters: Result<Vec<Table>, _> = study
        .parameters
        .iter()
        .zip(&study.unknowns)
        .map(|(parameter, unknown)| {
            let mut table = to_table(parameter)?;
            table.insert("name".to_owned(), unknown.name.clone().into());
            if let Some(scenario) = unknown.scenario {
                let name = study.scenarios[scenario].name.clone();
                // The symbol of one scenario's parameter is made from the written one.
                let suffix = format!("[{name}]");
                let symbol = parameter.symbol.strip_suffix(&suffix).unwrap_or(&parameter.symbol);
                table.insert("symbol".to_owned(), symbol.into());
                table.insert("scenario".to_owned(), name.into());
            }
            Ok(table)
        })
        .collect();
    let mut whole = Table::new();
    whole.insert("study".to_owned(), about.into());
    if !study.libraries.section.load.is_empty() {
        whole.insert("plugins".to_owned(), to_table(&study.libraries.section)?.into());
    }
    whole.insert("parameter".to_owned(), parameters?.into());
    if !study.derived_sections.is_empty() {
        let derived: Result<Vec<Table>, _> = study.derived_sections.iter().map(to_table).collect();
        whole.insert("derived".to_owned(), derived?.into());
    }
    if !scenarios.is_empty() {
        let scenarios: Result<Vec<Table>, _> = scenarios.iter().map(to_table).collect();
        whole.insert("scenario".to_owned(), scenarios?.into());
    }
    if let Some(response) = response {
        whole.insert("response".to_owned(), to_table(response)?.into());
    }
    macro_rules! sections {
        ($($field:ident),+) => {
            $(if let Some(section) = &study.$field {
                whole.insert(stringify!($field).to_owned(), merged(section)?.into());
            })+
        };
    }
    sections!(target, model, design, executor, simulations, measurements, surrogate, discrepancy);
    if let Some(numerical_error) = &study.numerical_error {
        let table = to_table(&numerical_error.written)?;
        whole.insert("numerical_error".to_owned(), table.into());
    }
    if let Some(low_fidelity) = &study.low_fidelity {
        let table = to_table(&low_fidelity.written)?;
        whole.insert("low_fidelity".to_owned(), table.into());
    }
    if !study.effects.is_empty() {
        let effects: Result<Vec<Table>, _> = study.effects.iter().map(merged).collect();
        whole.insert("effect".to_owned(), effects?.into());
    }
    sections!(sampler);
    whole.insert("validate".to_owned(), to_table(&study.validate)?.into());
    let mut gap = to_table(&study.gap.keys)?;
    if !study.gap.candidates.is_empty() {
        let candidates: Result<Vec<Table>, _> = study.gap.candidates.iter().map(merged).collect();
        gap.insert("candidate".to_owned(), candidates?.into());
    }
    let inside = &study.gap.inside;
    let mut list = |name: &str, tables: Result<Vec<Table>, Unwritable>| {
        let tables = tables?;
        if !tables.is_empty() {
            gap.insert(name.to_owned(), tables.into());
        }
        Ok(())
    };
    list("switch", inside.switches.iter().map(to_table).collect())?;
    list("term", inside.terms.iter().map(merged).collect())?;
    list("model", inside.models.iter().map(swapped).collect())?;
    whole.insert("gap".to_owned(), gap.into());
    Ok(whole)
}

/// A model in place of the study's.
fn swapped(swap: &Swap) -> Result<Table, Unwritable> {
    let mut table = to_table(&swap.keys)?;
    table.insert("use".to_owned(), swap.section.built.name.into());
    table.extend(swap.section.built.options.clone());
    Ok(table)
}

/// One table of `use`, the engine's keys and the plugin's.
fn merged<K: ?Sized, C: serde::Serialize>(section: &Section<K, C>) -> Result<Table, Unwritable> {
    let mut table = Table::new();
    table.insert("use".to_owned(), section.built.name.into());
    table.extend(to_table(&section.common)?);
    table.extend(section.built.options.clone());
    Ok(table)
}
