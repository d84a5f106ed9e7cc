//! The study with candidates of its companion, as text.

use std::collections::BTreeMap;

use lacuna::run::Stop;
use lacuna::text::emit::to_line;
use serde::Serialize;

use crate::gap::edit::with_keys;
use crate::gap::result::companion::IdentifiedCompanion;
use crate::study::Study;

/// The text of a study in which its companion has these further candidates, by their names, with the constants that were
/// identified and the point `around` which their changes are learned, by name; `comments` are lines that say why.
pub fn with_added(
    text: String,
    study: &Study,
    names: &[&str],
    found: &IdentifiedCompanion,
    around: &BTreeMap<&str, f64>,
    comments: &str,
) -> Result<String, Stop> {
    let Some(companion) = &study.gap.companion else { return Ok(text) };
    let mut add = companion.keys.add.clone();
    add.extend(names.iter().map(|name| (*name).to_owned()));
    let constants = companion.keys.parameter.iter().zip(&found.constants);
    let constants: BTreeMap<String, f64> =
        constants.map(|(own, value)| (own.name.as_str().to_owned(), *value)).collect();
    let mut new = vec![("add", line(&add)?)];
    if !constants.is_empty() {
        new.push(("constants", line(&constants)?));
    }
    new.push(("around", line(around)?));
    Ok(with_keys(text, "[gap.companion]", new, comments))
}

fn line(value: &impl Serialize) -> Result<String, Stop> {
    to_line(value).map_err(|error| Stop::new(format!("the new study {error}")))
}
