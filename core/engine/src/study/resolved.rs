//! A study written out: every default filled in, for `resolved.toml`.

use std::collections::BTreeMap;

use lacuna::data::Parameter;
use lacuna::text::emit::{Unwritable, to_table};
use toml::{Table, Value};

use super::dependence::Sections;
use super::file::{ResponseSection, ScenarioSection};
use super::gap::companion::Companion;
use super::gap::{Gap, Swap};
use super::libraries::PluginsSection;
use super::plain::Study;
use super::table::{SECTIONS, written};
use super::unknowns::Unknown;

/// The study with every default filled in.
pub(super) fn table(
    study: &Study,
    response: Option<&ResponseSection>,
    scenarios: &[ScenarioSection],
) -> Result<Table, Unwritable> {
    let mut about = to_table(&study.about)?;
    about.insert("name".to_owned(), study.name.clone().into());
    let directory = std::path::absolute(&study.directory).unwrap_or(study.directory.clone());
    about.insert("directory".to_owned(), text(&directory));
    let first = |(j, (_, unknown)): &(usize, (&Parameter, &Unknown))| {
        let again = unknown.member.is_some()
            && study.unknowns[..*j].iter().any(|other| other.name == unknown.name);
        !again && !unknown.of_population() && !unknown.of_field()
    };
    let parameters: Result<Vec<Table>, _> = study
        .parameters
        .iter()
        .zip(&study.unknowns)
        .enumerate()
        .filter(first)
        .map(|(_, (parameter, unknown))| {
            let mut by_group = study.hierarchy.sections.iter();
            if let Some(own) = by_group.find(|section| section.name.as_str() == unknown.name) {
                return to_table(own);
            }
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
            if unknown.interval {
                let (low, high) = parameter.prior.support();
                table.insert("prior".to_owned(), only("interval", vec![low, high].into()));
            }
            if let Some(run) = study.dependence_sections.run_of(&parameter.name) {
                table.insert("prior".to_owned(), only("posterior", text(run)));
            }
            Ok(table)
        })
        .collect();
    let mut whole = Table::new();
    whole.insert("study".to_owned(), about.into());
    if study.libraries.section != PluginsSection::default() {
        whole.insert("plugins".to_owned(), to_table(&study.libraries.section)?.into());
    }
    whole.insert("parameter".to_owned(), parameters?.into());
    let mut list = |name: &str, tables: Result<Vec<Table>, Unwritable>| {
        let tables = tables?;
        if !tables.is_empty() {
            whole.insert(name.to_owned(), tables.into());
        }
        Ok(())
    };
    let Sections { dependence, constraint, .. } = &study.dependence_sections;
    list("field", study.field_sections.iter().map(to_table).collect())?;
    list("start", study.starts.iter().map(to_table).collect())?;
    list("dependence", dependence.iter().map(to_table).collect())?;
    list("constraint", constraint.iter().map(to_table).collect())?;
    list("derived", study.derived_sections.iter().map(to_table).collect())?;
    list("scenario", scenarios.iter().map(to_table).collect())?;
    if let Some(response) = response {
        whole.insert("response".to_owned(), to_table(response)?.into());
    }
    let mut later: BTreeMap<&str, Value> = BTreeMap::new();
    later.extend(study.plugins.written()?.into_iter().map(|(name, table)| (name, table.into())));
    if let Some(numerical_error) = &study.numerical_error {
        later.insert("numerical_error", to_table(&numerical_error.written)?.into());
    }
    if let Some(low_fidelity) = &study.low_fidelity {
        later.insert("low_fidelity", to_table(&low_fidelity.written)?.into());
    }
    if !study.effects.is_empty() {
        let effects: Result<Vec<Table>, _> = study.effects.iter().map(written).collect();
        later.insert("effect", effects?.into());
    }
    if !study.quantities.is_empty() {
        let quantities: Result<Vec<Table>, _> = study.quantities.iter().map(written).collect();
        later.insert("quantity", quantities?.into());
    }
    if let Some(forward) = &study.forward {
        later.insert("forward", to_table(forward)?.into());
    }
    if !study.reliability.is_empty() {
        let rare: Result<Vec<Table>, _> = study.reliability.iter().map(written).collect();
        later.insert("reliability", rare?.into());
    }
    // Beside a target the section would be refused, and without measurements the next one.
    if study.target.is_none() {
        later.insert("validate", to_table(&study.validate)?.into());
    }
    if study.measurements.is_some() {
        later.insert("gap", gap(&study.gap)?.into());
    }
    for name in SECTIONS {
        whole.extend(later.remove(name).map(|section| ((*name).to_owned(), section)));
    }
    Ok(whole)
}

fn text(path: &std::path::Path) -> Value {
    path.display().to_string().into()
}

/// A table with one key.
fn only(key: &str, value: Value) -> Value {
    Table::from_iter([(key.to_owned(), value)]).into()
}

/// `[gap]` with its lists.
fn gap(section: &Gap) -> Result<Table, Unwritable> {
    let mut gap = to_table(&section.keys)?;
    if !section.candidates.is_empty() {
        let candidates: Result<Vec<Table>, _> = section.candidates.iter().map(written).collect();
        gap.insert("candidate".to_owned(), candidates?.into());
    }
    let inside = &section.inside;
    let mut list = |name: &str, tables: Result<Vec<Table>, Unwritable>| {
        let tables = tables?;
        if !tables.is_empty() {
            gap.insert(name.to_owned(), tables.into());
        }
        Ok(())
    };
    list("switch", inside.switches.iter().map(to_table).collect())?;
    list("term", inside.terms.iter().map(written).collect())?;
    list("model", inside.models.iter().map(swapped).collect())?;
    list("runs", section.runs.iter().map(written).collect())?;
    if let Some(own) = &section.companion {
        gap.insert("companion".to_owned(), companion(own)?.into());
    }
    Ok(gap)
}

/// `[gap.companion]` with its terms.
fn companion(companion: &Companion) -> Result<Table, Unwritable> {
    let mut table = to_table(&companion.keys)?;
    if let Some(model) = &companion.study.model {
        table.insert("use".to_owned(), model.built.name.into());
        table.extend(model.built.options.clone());
    }
    let terms: Result<Vec<Table>, _> =
        companion.study.gap.inside.terms.iter().map(written).collect();
    if !companion.keys.term.is_empty() {
        table.insert("term".to_owned(), terms?.into());
    }
    Ok(table)
}

/// A model in place of the study's.
fn swapped(swap: &Swap) -> Result<Table, Unwritable> {
    let mut table = to_table(&swap.keys)?;
    table.insert("use".to_owned(), swap.section.built.name.into());
    table.extend(swap.section.built.options.clone());
    Ok(table)
}
