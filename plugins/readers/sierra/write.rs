//! Writer of history files in Sierra's layout.
//!
//! The layout is that of the IOSS library: a dummy mesh of one node and one `sphere` element, all signals as global
//! variables in alphabetical order, in a 64-bit offset container. The Exodus tools and any netCDF reader can open it.

use std::path::Path;

use lacuna::run::Stop;
use lacuna::run::files::write_atomic;
use netcdf_writer::{DimensionId, Error, NcAttrValue, NcFileBuilder, NcWriteOptions};

/// Version of the Exodus library whose format is written.
const VERSION: f32 = 9.06;
/// Length of a name and of a QA field, with the terminating NUL.
const NAME: usize = 33;
/// Length of an information line, with the terminating NUL.
const LINE: usize = 81;

/// Information on the origin of a history file. All of it, including the date, is an argument, so that equal data
/// give equal bytes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Origin {
    /// Title of the run, at most 80 characters.
    pub title: String,
    /// QA record: code, version, date (`2022/04/15`), time (`12:00:00`), at most 32 characters each.
    pub qa: [String; 4],
    /// Information records, usually the input deck; longer lines are wrapped at 79 characters with a backslash.
    pub info: Vec<String>,
}

/// Signals over common times.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    /// Increasing times.
    pub times: Vec<f64>,
    /// Names of the signals, at most 256 characters each.
    pub names: Vec<String>,
    /// Values of the signals, one list per signal and each as long as `times`.
    pub values: Vec<Vec<f64>>,
}

/// Writes a history file. The file appears under its name only when it is complete.
pub fn write_history(path: &Path, origin: &Origin, history: &History) -> Result<(), Stop> {
    let failed = |reason: String| Stop::new(format!("cannot write {}: {reason}", path.display()));
    check(history).map_err(failed)?;
    let bytes = encode(origin, history).map_err(|e| failed(e.to_string()))?;
    write_atomic(path, &bytes)
}

fn check(history: &History) -> Result<(), String> {
    if history.names.is_empty() || history.times.is_empty() {
        return Err("a history file needs at least one signal and one time".to_owned());
    }
    if history.names.len() != history.values.len() {
        let (names, values) = (history.names.len(), history.values.len());
        return Err(format!("{names} names for {values} signals"));
    }
    for (name, values) in history.names.iter().zip(&history.values) {
        if name.is_empty() || name.len() > 256 || !name.is_ascii() {
            return Err(format!("`{name}` is not a name of 1 to 256 ASCII characters"));
        }
        if values.len() != history.times.len() {
            let (found, expected) = (values.len(), history.times.len());
            return Err(format!("signal `{name}` has {found} values for {expected} times"));
        }
    }
    let mut sorted: Vec<&String> = history.names.iter().collect();
    sorted.sort();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("two signals are called `{}`", pair[0])),
        None => Ok(()),
    }
}

fn encode(origin: &Origin, history: &History) -> Result<Vec<u8>, Error> {
    let mut order: Vec<usize> = (0..history.names.len()).collect();
    order.sort_by(|&a, &b| history.names[a].cmp(&history.names[b]));
    let longest = history.names.iter().map(String::len).max().unwrap_or(0);
    let mut file = NcFileBuilder::new();
    file.add_attribute("api_version", NcAttrValue::Floats(vec![VERSION]))?;
    file.add_attribute("version", NcAttrValue::Floats(vec![VERSION]))?;
    file.add_attribute("floating_point_word_size", NcAttrValue::Ints(vec![8]))?;
    file.add_attribute("file_size", NcAttrValue::Ints(vec![1]))?;
    file.add_attribute("maximum_name_length", NcAttrValue::Ints(vec![longest as i32]))?;
    file.add_attribute("int64_status", NcAttrValue::Ints(vec![0]))?;
    file.add_attribute("title", NcAttrValue::Chars(clipped(&origin.title, 80)))?;
    let last = history.times.last().copied().unwrap_or(0.0);
    file.add_attribute("last_written_time", NcAttrValue::Doubles(vec![last]))?;
    let width = NAME.max(longest + 1);
    let name_length = file.add_dimension("len_name", width as u64)?;
    add_records(&mut file, origin)?;
    let step = file.add_unlimited_dimension("time_step")?;
    let time_whole = file.add_variable::<f64>("time_whole", &[step])?;
    file.write_variable(time_whole, &history.times)?;
    add_mesh(&mut file, name_length, width)?;

    let signals = file.add_dimension("num_glo_var", order.len() as u64)?;
    let values = file.add_variable::<f64>("vals_glo_var", &[step, signals])?;
    let rows = 0..history.times.len();
    let flat: Vec<f64> =
        rows.flat_map(|t| order.iter().map(move |&s| history.values[s][t])).collect();
    file.write_variable(values, &flat)?;
    let names: Vec<&str> = order.iter().map(|&s| history.names[s].as_str()).collect();
    add_texts(&mut file, "name_glo_var", &[signals, name_length], width, &names)?;
    let (_, bytes) = file.to_vec(NcWriteOptions::offset64())?;
    Ok(bytes)
}

fn add_records(file: &mut NcFileBuilder, origin: &Origin) -> Result<(), Error> {
    let length = file.add_dimension("len_string", NAME as u64)?;
    let four = file.add_dimension("four", 4)?;
    let count = file.add_dimension("num_qa_rec", 1)?;
    let fields: Vec<&str> = origin.qa.iter().map(String::as_str).collect();
    add_texts(file, "qa_records", &[count, four, length], NAME, &fields)?;
    let lines: Vec<String> = origin.info.iter().flat_map(|line| wrapped(line)).collect();
    if lines.is_empty() {
        return Ok(());
    }
    let length = file.add_dimension("len_line", LINE as u64)?;
    let count = file.add_dimension("num_info", lines.len() as u64)?;
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    add_texts(file, "info_records", &[count, length], LINE, &lines)
}

/// Adds the mesh that IOSS gives a history file; its coordinates and element have no meaning.
fn add_mesh(file: &mut NcFileBuilder, name_length: DimensionId, width: usize) -> Result<(), Error> {
    let axes = file.add_dimension("num_dim", 3)?;
    let nodes = file.add_dimension("num_nodes", 1)?;
    let elements = file.add_dimension("num_elem", 1)?;
    let blocks = file.add_dimension("num_el_blk", 1)?;
    let in_block = file.add_dimension("num_el_in_blk1", 1)?;
    let per_element = file.add_dimension("num_nod_per_el1", 1)?;
    for (name, dimension) in [
        ("node_num_map", nodes),
        ("elem_num_map", elements),
        ("eb_status", blocks),
        ("eb_prop1", blocks),
    ] {
        let variable = file.add_variable::<i32>(name, &[dimension])?;
        file.write_variable(variable, &[1])?;
        if name == "eb_prop1" {
            file.add_variable_attribute(variable, "name", NcAttrValue::Chars("ID".into()))?;
        }
    }
    add_texts(file, "eb_names", &[blocks, name_length], width, &["e1"])?;
    for (name, place) in [("coordx", 1.1), ("coordy", 2.2), ("coordz", 3.3)] {
        let variable = file.add_variable::<f64>(name, &[nodes])?;
        file.write_variable(variable, &[place])?;
    }
    add_texts(file, "coor_names", &[axes, name_length], width, &["x", "y", "z"])?;
    let connect = file.add_variable::<i32>("connect1", &[in_block, per_element])?;
    file.add_variable_attribute(connect, "elem_type", NcAttrValue::Chars("sphere".into()))?;
    file.write_variable(connect, &[1])
}

/// Adds a character variable; each text is cut to its field and padded with NUL.
fn add_texts(
    file: &mut NcFileBuilder,
    name: &str,
    dimensions: &[DimensionId],
    length: usize,
    texts: &[&str],
) -> Result<(), Error> {
    let variable = file.add_char_variable(name, dimensions)?;
    let mut bytes = Vec::with_capacity(texts.len() * length);
    for text in texts {
        let kept = clipped(text, length - 1);
        bytes.extend_from_slice(kept.as_bytes());
        bytes.resize(bytes.len() + length - kept.len(), 0);
    }
    file.write_char_variable(variable, &bytes)
}

/// Wraps a line as Exodus stores input decks: all pieces but the last end in a backslash.
fn wrapped(line: &str) -> Vec<String> {
    let characters: Vec<char> = line.chars().map(|c| if c.is_ascii() { c } else { '?' }).collect();
    let mut pieces = Vec::new();
    let mut rest = &characters[..];
    while rest.len() > LINE - 1 {
        let (piece, remainder) = rest.split_at(LINE - 2);
        pieces.push(piece.iter().chain(&['\\']).collect());
        rest = remainder;
    }
    pieces.push(rest.iter().collect());
    pieces
}

/// Returns at most `length` bytes of ASCII, because Exodus strings are limited to it.
fn clipped(text: &str, length: usize) -> String {
    text.chars().map(|c| if c.is_ascii() { c } else { '?' }).take(length).collect()
}
