//! Noise stated by a table: standard deviations, a covariance, and masked values.

use std::path::Path;

use csv::{ReaderBuilder, Trim};
use lacuna::data::{Layout, Measurements};
use lacuna::plugin::reader::ReadError;
use lacuna_linalg::Matrix;

use super::cells::{Headings, LongColumns};
use super::faults::Faults;
use super::netcdf;
use super::sheet::{Record, Sheet, delimiter};

/// Name of the column with the names of repeated measurements.
pub const REPLICATE: &str = "replicate";
/// Name of the column or variable with standard deviations.
pub const SIGMA: &str = "sigma";
/// Name of the column or variable that is 1 for a masked value.
pub const MASK: &str = "mask";

/// Largest difference of a covariance from its transpose, relative to the product of the standard deviations.
const SYMMETRY: f64 = 1e-8;

/// Returns true if a cell of a mask excludes its value.
pub fn left_out(sheet: &Sheet, record: &Record, column: usize) -> Result<bool, ReadError> {
    match record.cells[column].to_ascii_lowercase().as_str() {
        "1" | "1.0" | "true" => Ok(true),
        "0" | "0.0" | "false" | "" => Ok(false),
        found => {
            let text = format!("expected 1 for a value that is left out, or 0, found `{found}`");
            Err(sheet.complain(record, column, text))
        }
    }
}

/// Excludes the values that a mask table marks: its columns are the axes, `mask`, and optionally `replicate`.
pub fn apply_mask(path: &Path, layout: &Layout, data: &mut Measurements) -> Result<(), ReadError> {
    let (sheet, mut faults) = Sheet::open(path)?;
    let mask = sheet.column(MASK)?;
    let places = LongColumns::places(&sheet, layout, mask)?;
    let of_replicate = sheet.find(REPLICATE);
    for record in &sheet.records {
        let place = faults.take(record.line, places.place(&sheet, record));
        let out = faults.take(record.line, left_out(&sheet, record, mask));
        let (Some(place), Some(out)) = (place, out) else { continue };
        let name = of_replicate.map(|column| (column, &record.cells[column]));
        let mut known = name.is_none();
        for replicate in &mut data.replicates {
            if name.is_none_or(|(_, name)| name == replicate.name) {
                known = true;
                if out {
                    replicate.values[place] = None;
                }
            }
        }
        if let (false, Some((column, name))) = (known, name) {
            let text = format!("the measurements have no replicate `{name}`");
            faults.note(record.line, sheet.complain(record, column, text));
        }
    }
    faults.or(())
}

/// Reads the covariance of the noise of one curve (`outputs x outputs`, on the layout); outputs that the file does
/// not contain have zeros.
///
/// A netCDF file holds it in the variable `covariance` over two dimensions, a text file as a square of numbers. Rows
/// and columns follow the layout, the last axis fastest, or the headings of the columns. Fails if it is not symmetric
/// or not positive definite.
pub fn covariance(path: &Path, layout: &Layout) -> Result<Matrix, ReadError> {
    let square = match path.extension().and_then(|e| e.to_str()) {
        Some("nc" | "nc4" | "cdf" | "h5") => netcdf::square(path, "covariance", layout)?,
        _ => text(path, layout)?,
    };
    symmetric(path, layout, &square)?;
    positive_definite(path, layout, &square)?;
    let Square { places, values } = square;
    let mut whole = Matrix::zeros(layout.len(), layout.len());
    for (i, &row) in places.iter().enumerate() {
        for (j, &column) in places.iter().enumerate() {
            whole[(row, column)] = values[(i, j)];
        }
    }
    Ok(whole)
}

/// A square of numbers, and the output of each row and column.
pub struct Square {
    /// Flat index of the output of each row and column.
    pub places: Vec<usize>,
    /// Elements of the matrix.
    pub values: Matrix,
}

fn text(path: &Path, layout: &Layout) -> Result<Square, ReadError> {
    let bytes =
        std::fs::read(path).map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(delimiter(&bytes))
        .comment(Some(b'#'))
        .trim(Trim::All)
        .from_reader(&*bytes);
    let mut lines: Vec<(usize, Vec<String>)> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| ReadError::new(path, format!("cannot be read: {e}")))?;
        let line = record.position().map_or(0, |p| p.line() as usize);
        lines.push((line, record.iter().map(str::to_owned).collect()));
    }
    if lines.is_empty() {
        return Err(ReadError::new(path, "is empty: expected a square of numbers"));
    }
    let headed = lines[0].1.iter().any(|cell| cell.parse::<f64>().is_err());
    let heading = headed.then(|| lines.remove(0));
    let named = heading.as_ref().is_some_and(|(_, cells)| cells[0].is_empty());
    let places = match &heading {
        None => (0..layout.len()).collect(),
        Some((line, cells)) => headings(path, layout, *line, &cells[usize::from(named)..])?,
    };
    let size = places.len();
    if lines.len() != size {
        let text =
            format!("expected {size} rows, one a value of the response, found {}", lines.len());
        return Err(ReadError::new(path, text));
    }
    let mut faults = Faults::default();
    let mut values = Matrix::zeros(size, size);
    for (i, (line, cells)) in lines.iter().enumerate() {
        let cells = &cells[usize::from(named && !cells.is_empty())..];
        if cells.len() != size {
            let text = format!("expected {size} numbers, found {}", cells.len());
            faults.note(*line, ReadError::new(path, text).at(format!("line {line}")));
            continue;
        }
        for (j, cell) in cells.iter().enumerate() {
            match cell.parse::<f64>() {
                Ok(x) if x.is_finite() => values[(i, j)] = x,
                _ => {
                    let text = format!("expected a finite number, found `{cell}`");
                    let place = format!("line {line}, column {}", j + 1 + usize::from(named));
                    faults.note(*line, ReadError::new(path, text).at(place));
                }
            }
        }
    }
    faults.or(Square { places, values })
}

fn headings(
    path: &Path,
    layout: &Layout,
    line: usize,
    cells: &[String],
) -> Result<Vec<usize>, ReadError> {
    let headings = Headings::of(layout);
    let mut places = Vec::with_capacity(cells.len());
    for cell in cells {
        let at = |text: String| ReadError::new(path, text).at(format!("line {line}"));
        let place = headings.place(cell).map_err(at)?;
        if places.contains(&place) {
            return Err(at(format!("two columns are headed `{cell}`")));
        }
        places.push(place);
    }
    Ok(places)
}

fn symmetric(path: &Path, layout: &Layout, square: &Square) -> Result<(), ReadError> {
    let Square { places, values } = square;
    for i in 0..places.len() {
        for j in 0..i {
            let (a, b) = (values[(i, j)], values[(j, i)]);
            let scale = (values[(i, i)] * values[(j, j)]).abs().sqrt();
            if (a - b).abs() > SYMMETRY * scale {
                let [row, column] = [i, j].map(|k| layout.describe(places[k]));
                let text = format!(
                    "the covariance of {row} with {column} is {a:e} in row {}, and {b:e} in row {}: the matrix must be \
                     symmetric",
                    i + 1,
                    j + 1
                );
                return Err(ReadError::new(path, text));
            }
        }
    }
    Ok(())
}

/// By Cholesky factorisation, whose pivots are the variances of each output given those before it.
fn positive_definite(path: &Path, layout: &Layout, square: &Square) -> Result<(), ReadError> {
    let n = square.places.len();
    let mut lower = Matrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let (row, other) = (lower.row(i)[..j].to_vec(), lower.row(j)[..j].to_vec());
            let known: f64 = row.iter().zip(&other).map(|(a, b)| a * b).sum();
            let rest = square.values[(i, j)] - known;
            if i > j {
                lower[(i, j)] = rest / lower[(j, j)];
                continue;
            }
            // A pivot of the size of rounding errors counts as zero.
            if rest.is_nan() || rest <= 1e-14 * square.values[(i, i)].abs() {
                let place = layout.describe(square.places[i]);
                let text = format!(
                    "the covariance is not positive definite: in row {}, {place}, the variance {:e} minus \
                     the part that the rows above determine is {rest:e}",
                    i + 1,
                    square.values[(i, i)]
                );
                return Err(ReadError::new(path, text));
            }
            lower[(i, i)] = rest.sqrt();
        }
    }
    Ok(())
}
