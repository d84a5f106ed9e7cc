//! Columns that a file names like the sensors of the response, for options that do not say where these are.

use lacuna::plugin::reader::ReadError;

use super::signal::Output;
use crate::readers::listed;

/// The name of the column or global variable for a curve with these labels: the first of those under which it may be
/// written that is in the file, in upper or lower case. The error lists those of the file.
pub(super) fn column<'a>(
    output: &'a Output,
    response: &str,
    labels: &[&str],
) -> Result<&'a str, ReadError> {
    let names = output.column_names();
    let wanted = wanted(response, labels);
    let found = |wanted: &String| names.iter().find(|name| name.eq_ignore_ascii_case(wanted));
    if let Some(name) = wanted.iter().find_map(found) {
        return Ok(name);
    }
    let kind = if output.is_heartbeat() { "column" } else { "global variable" };
    let text = format!("has no {kind} {}; it has {}", listed(&wanted), listed(names));
    Err(ReadError::new(output.path(), text).help(
        "state the name with `variable = \"strain_{sensor}\"`, or the places of single sensors under `sensors`",
    ))
}

/// Names under which a curve may be written, the most specific first.
fn wanted(response: &str, labels: &[&str]) -> Vec<String> {
    if labels.is_empty() {
        return vec![response.to_owned()];
    }
    let label = labels.join("_");
    vec![format!("{response}_{label}"), format!("{label}_{response}"), label]
}
