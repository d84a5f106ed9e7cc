//! Contract of readers.

use std::fs;
use std::path::{Path, PathBuf};

use lacuna::data::{Axis, Coordinates, Layout};
use lacuna::plugin::Reader;
use lacuna::plugin::reader::{EnsembleSource, MeasurementSource};

use crate::judge::{Check, calm, judge, layout, refused, same_on_threads};

/// A file that a reader understands, and the response in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Path of the file.
    pub file: PathBuf,
    /// Layout of the response.
    pub layout: Layout,
    /// Values of the response.
    pub values: Vec<f64>,
    /// Relative tolerance of a value, for formats with few digits.
    pub tolerance: f64,
}

/// Tests a reader against its contract; files go to the folder `scratch`.
///
/// - It recognises its sample, lists the same variables each time, and reads the response in it, on any number of
///   threads.
/// - It does not recognise an empty file or random bytes.
/// - Files that are missing, empty, truncated or random, and folders, give errors that name the file.
/// - A response with a sensor or a time that the file does not have gives an error.
/// - A source without runs or measurements gives an error.
/// - No damaged byte makes it panic.
pub fn reader(
    name: &str,
    reader: &dyn Reader,
    sample: &Sample,
    scratch: &Path,
) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 6] = [
        ("reads its sample", Box::new(|| reads_its_sample(reader, sample))),
        ("recognises its own", Box::new(|| recognises_its_own(reader, sample))),
        ("refuses bad files", Box::new(|| refuses_bad_files(reader, sample, scratch))),
        ("misses what is not there", Box::new(|| misses_what_is_absent(reader, sample))),
        ("needs a source", Box::new(|| needs_a_source(reader, scratch))),
        ("bears damaged bytes", Box::new(|| bears_damage(reader, sample, scratch))),
    ];
    judge("reader", name, &checks)
}

fn reads_its_sample(reader: &dyn Reader, sample: &Sample) -> Result<(), String> {
    let read = || reader.response(&sample.file, &sample.layout).map_err(|e| e.to_string());
    let found = read()?;
    if found.len() != sample.values.len() {
        return Err(format!("{} values and not {}", found.len(), sample.values.len()));
    }
    let largest = sample.values.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    let far = |(a, b): (&f64, &f64)| a.is_nan() || (a - b).abs() > sample.tolerance * largest;
    if let Some(i) = found.iter().zip(&sample.values).position(far) {
        let (place, right) = (sample.layout.describe(i), sample.values[i]);
        return Err(format!("the response at {place} is {} and not {right}", found[i]));
    }
    let contents = || reader.inspect(&sample.file).map_err(|e| e.to_string());
    let first = contents()?;
    if first.format.is_empty() || first.variables.is_empty() {
        return Err("`inspect` names no format or no variable".into());
    }
    // Signals may hold NaN, which is not equal to itself: compare the printed form.
    if format!("{first:?}") != format!("{:?}", contents()?) {
        return Err("`inspect` sees something else the second time".into());
    }
    same_on_threads(read)
}

fn recognises_its_own(reader: &dyn Reader, sample: &Sample) -> Result<(), String> {
    let bytes = fs::read(&sample.file).map_err(|e| e.to_string())?;
    if !reader.recognises(&sample.file, &bytes[..bytes.len().min(4096)]) {
        return Err("its sample is not recognised".into());
    }
    for (what, bytes) in [("no bytes", Vec::new()), ("random bytes", garbage())] {
        let known = calm(what, || reader.recognises(Path::new("file.dat"), &bytes))?;
        if known {
            return Err(format!("{what} are recognised"));
        }
    }
    Ok(())
}

/// 4096 pseudo-random bytes from a linear congruential generator.
fn garbage() -> Vec<u8> {
    let next = |state: &mut u32| {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        Some((*state >> 24) as u8)
    };
    let mut state = 1_u32;
    std::iter::from_fn(|| next(&mut state)).take(4096).collect()
}

/// Writes bytes to a file with the sample's extension.
fn write(scratch: &Path, sample: &Sample, stem: &str, bytes: &[u8]) -> Result<PathBuf, String> {
    let extension = sample.file.extension().unwrap_or_default();
    let path = scratch.join(stem).with_extension(extension);
    fs::write(&path, bytes).map_err(|e| e.to_string())?;
    Ok(path)
}

fn refuses_bad_files(reader: &dyn Reader, sample: &Sample, scratch: &Path) -> Result<(), String> {
    let whole = fs::read(&sample.file).map_err(|e| e.to_string())?;
    let mut bad = vec![
        ("a missing file", scratch.join("missing.file")),
        ("an empty file", write(scratch, sample, "empty", &[])?),
        ("random bytes", write(scratch, sample, "noise", &garbage())?),
        ("a folder", scratch.to_owned()),
    ];
    for magic in [&b"CDF\x01"[..], b"CDF\x02", b"CDF\x05", b"\x89HDF\r\n\x1a\n"] {
        let bytes = [magic, &garbage()].concat();
        let stem = format!("magic{}", bad.len());
        bad.push((
            "random bytes after a netCDF file's first",
            write(scratch, sample, &stem, &bytes)?,
        ));
    }
    for (what, path) in &bad {
        let listed = calm(what, || reader.inspect(path))?;
        let read = calm(what, || reader.response(path, &sample.layout))?;
        for error in [listed.err(), read.err()] {
            let error = error.ok_or_else(|| format!("{what} is accepted"))?;
            if &error.path != path || error.message.is_empty() {
                return Err(format!("the error about {what} does not name the file: {error}"));
            }
        }
    }
    for percent in [1, 10, 30, 50, 70, 90] {
        let cut = &whole[..whole.len() * percent / 100];
        let path = write(scratch, sample, &format!("cut{percent}"), cut)?;
        let what = format!("a file cut off after {percent} % of its bytes");
        calm(&what, || reader.inspect(&path).is_ok())?;
        refused(&what, || reader.response(&path, &sample.layout))?;
    }
    Ok(())
}

fn misses_what_is_absent(reader: &dyn Reader, sample: &Sample) -> Result<(), String> {
    let changed = |change: &dyn Fn(&mut Coordinates)| {
        let mut layout = sample.layout.clone();
        layout.axes.iter_mut().for_each(|axis| change(&mut axis.coordinates));
        layout
    };
    let sensor = changed(&|axis| {
        if let Coordinates::Labels(labels) = axis {
            labels.push("no such label".into());
        }
    });
    let late = changed(&|axis| {
        if let Coordinates::Grid { values, .. } = axis {
            let last = values.last().copied().unwrap_or(1.0);
            values.push(2.0 * last.abs() + 1.0);
        }
    });
    for (what, layout) in
        [("a label that the file does not have", sensor), ("a number beyond the file's", late)]
    {
        if layout != sample.layout {
            refused(what, || reader.response(&sample.file, &layout))?;
        }
    }
    let axes = vec![Axis::labels("no such axis", ["a", "b"])];
    let other = Layout { name: "no such response".into(), axes, ..sample.layout.clone() };
    refused("a response that the file does not have", || reader.response(&sample.file, &other))
}

fn needs_a_source(reader: &dyn Reader, scratch: &Path) -> Result<(), String> {
    let layout = layout();
    let nowhere = scratch.join("nowhere");
    let folders = [None, Some(nowhere.as_path())];
    for simulated in folders {
        let source = EnsembleSource {
            directory: &nowhere,
            simulated,
            parameters: &[],
            scenario: None,
            layout: &layout,
        };
        refused("a source without runs", || reader.ensemble(&source))?;
    }
    let source = MeasurementSource { directory: &nowhere, scenario: None, layout: &layout };
    refused("a source without measurements", || reader.measurements(&source))?;
    calm("asking for its files", || reader.files(&nowhere, None)).map(|_| ())
}

fn bears_damage(reader: &dyn Reader, sample: &Sample, scratch: &Path) -> Result<(), String> {
    let whole = fs::read(&sample.file).map_err(|e| e.to_string())?;
    // The first bytes determine how the rest is read, so they are damaged more densely.
    let head = whole.len().min(600);
    let places = (0..head).step_by(13).chain((head..whole.len()).step_by(whole.len() / 8 + 1));
    for place in places {
        for damage in [0x00, 0xff] {
            let mut bytes = whole.clone();
            bytes[place] = damage;
            let path = write(scratch, sample, "damaged", &bytes)?;
            let what = format!("byte {damage} in place {place}");
            calm(&what, || reader.inspect(&path).is_ok())?;
            if let Ok(values) = calm(&what, || reader.response(&path, &sample.layout))?
                && values.len() != sample.layout.len()
            {
                return Err(format!("{what} changes the number of values"));
            }
        }
    }
    Ok(())
}
