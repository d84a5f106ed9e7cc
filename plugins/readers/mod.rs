//! Readers: files in, data with names, units and axes out.

pub mod cells;
pub mod contents;
pub mod csv;
mod ending;
mod faults;
pub mod hdf5;
pub mod matlab;
pub mod netcdf;
mod noise;
pub mod records;
mod rows;
pub mod runs;
pub mod scenario;
pub mod sheet;
pub mod sierra;
pub mod tdms;

/// Formats names for a message: all of a short list, the beginning of a long one.
pub(crate) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const SHOWN: usize = 12;
    let mut text: Vec<String> =
        names.iter().take(SHOWN).map(|name| format!("`{}`", name.as_ref())).collect();
    if names.len() > SHOWN {
        text.push(format!("and {} more", names.len() - SHOWN));
    }
    if text.is_empty() { "none".to_owned() } else { text.join(", ") }
}
