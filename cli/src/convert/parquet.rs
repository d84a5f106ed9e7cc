//! A table in an Apache Parquet file: plain encoding, no compression, one row group.
//!
//! Source: `README.md`, `Encodings.md` and `src/main/thrift/parquet.thrift` of the repository apache/parquet-format,
//! version 2.11.

use super::table::{Cells, Column};
use super::thrift::Struct;

/// First and last bytes of a file.
const MAGIC: &[u8] = b"PAR1";
/// Largest number of rows of a page. The size of a page is a signed number of 32 bits, and readers hold pages in memory.
const PAGE: usize = 1 << 17;

// Enumerations of the format.
const INT64: i64 = 2;
const DOUBLE: i64 = 5;
const BYTE_ARRAY: i64 = 6;
const REQUIRED: i64 = 0;
const OPTIONAL: i64 = 1;
const UTF8: i64 = 0;
const PLAIN: i64 = 0;
const RLE: i64 = 3;
const DATA_PAGE: i64 = 0;
const UNCOMPRESSED: i64 = 0;

/// The file of a table whose columns all have the same number of rows. The unit of a column is under the key
/// `unit:NAME` of the file's metadata, and the version of Lacuna under `lacuna`.
pub fn file(columns: &[Column]) -> Vec<u8> {
    file_of_pages(columns, PAGE)
}

fn file_of_pages(columns: &[Column], page: usize) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    let chunks = columns.iter().map(|column| chunk(&mut bytes, column, page)).collect();
    let body = bytes.len() - MAGIC.len();
    let rows = columns.first().map_or(0, |column| column.cells.len());
    let footer = footer(columns, chunks, rows, body);
    bytes.extend(&footer);
    bytes.extend((footer.len() as u32).to_le_bytes());
    bytes.extend(MAGIC);
    bytes
}

/// Writes the pages of a column, and returns the description of the chunk that they are.
fn chunk(bytes: &mut Vec<u8>, column: &Column, page: usize) -> Struct {
    let start = bytes.len();
    let rows = column.cells.len();
    for first in (0..rows).step_by(page) {
        let count = page.min(rows - first);
        let data = page_data(&column.cells, first, count);
        bytes.extend(page_header(data.len(), count));
        bytes.extend(data);
    }
    let size = (bytes.len() - start) as i64;
    let meta = Struct::default()
        .int(1, physical_type(&column.cells))
        .ints(2, &[PLAIN, RLE])
        .texts(3, &[&column.name])
        .int(4, UNCOMPRESSED)
        .long(5, rows as i64)
        .long(6, size)
        .long(7, size)
        .long(9, start as i64);
    Struct::default().long(2, start as i64).inner(3, meta)
}

fn page_header(size: usize, count: usize) -> Vec<u8> {
    let data = Struct::default().int(1, count as i64).int(2, PLAIN).int(3, RLE).int(4, RLE);
    let size = size as i64;
    Struct::default().int(1, DATA_PAGE).int(2, size).int(3, size).inner(5, data).end()
}

/// The definition levels of an optional column, then the values that are there.
fn page_data(cells: &Cells, first: usize, count: usize) -> Vec<u8> {
    let mut data = Vec::new();
    match cells {
        Cells::Integers(cells) => {
            data.extend(cells[first..first + count].iter().flat_map(|n| n.to_le_bytes()));
        }
        Cells::Numbers(all) => {
            let cells = &all[first..first + count];
            if repetition(all) == OPTIONAL {
                let levels = levels(cells);
                data.extend((levels.len() as u32).to_le_bytes());
                data.extend(levels);
            }
            data.extend(cells.iter().flatten().flat_map(|x| x.to_le_bytes()));
        }
        Cells::Texts(cells) => {
            for text in &cells[first..first + count] {
                data.extend((text.len() as u32).to_le_bytes());
                data.extend(text.as_bytes());
            }
        }
    }
    data
}

/// Definition levels as runs: 1 for a number, 0 for a missing one.
fn levels(cells: &[Option<f64>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for run in cells.chunk_by(|a, b| a.is_some() == b.is_some()) {
        // The lowest bit of a run's header is 0; it is 1 for packed bits.
        super::thrift::variable_length(&mut bytes, (run.len() as u64) << 1);
        bytes.push(u8::from(run[0].is_some()));
    }
    bytes
}

fn repetition(cells: &[Option<f64>]) -> i64 {
    if cells.iter().all(Option::is_some) { REQUIRED } else { OPTIONAL }
}

fn physical_type(cells: &Cells) -> i64 {
    match cells {
        Cells::Integers(_) => INT64,
        Cells::Numbers(_) => DOUBLE,
        Cells::Texts(_) => BYTE_ARRAY,
    }
}

/// The struct `FileMetaData`.
fn footer(columns: &[Column], chunks: Vec<Struct>, rows: usize, body: usize) -> Vec<u8> {
    let version = env!("CARGO_PKG_VERSION");
    let root = Struct::default().text(4, "table").int(5, columns.len() as i64);
    let schema = std::iter::once(root).chain(columns.iter().map(schema_of)).collect();
    let group = Struct::default().structs(1, chunks).long(2, body as i64).long(3, rows as i64);
    let entry = |key: &str, value: &str| Struct::default().text(1, key).text(2, value);
    let units = columns
        .iter()
        .filter_map(|column| Some(entry(&format!("unit:{}", column.name), column.unit.as_ref()?)));
    let metadata = std::iter::once(entry("lacuna", version)).chain(units).collect();
    Struct::default()
        .int(1, 2)
        .structs(2, schema)
        .long(3, rows as i64)
        .structs(4, vec![group])
        .structs(5, metadata)
        .text(6, &format!("lacuna version {version}"))
        .end()
}

/// The struct `SchemaElement` of a column.
fn schema_of(column: &Column) -> Struct {
    let repetition = match &column.cells {
        Cells::Numbers(cells) => repetition(cells),
        Cells::Integers(_) | Cells::Texts(_) => REQUIRED,
    };
    let element = Struct::default()
        .int(1, physical_type(&column.cells))
        .int(3, repetition)
        .text(4, &column.name);
    match column.cells {
        Cells::Texts(_) => {
            let string = Struct::default().inner(1, Struct::default());
            element.int(6, UTF8).inner(10, string)
        }
        Cells::Integers(_) | Cells::Numbers(_) => element,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::process::Command;

    use super::{Cells, Column, MAGIC, file_of_pages};

    fn columns() -> Vec<Column> {
        let missing = |i: usize| (i % 5 != 2 && i < 40).then_some(0.1 + i as f64);
        let odd = [f64::NAN, -0.0, f64::INFINITY, 5e-324, f64::MAX];
        let column = |name: &str, unit: Option<&str>, cells| Column {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
            cells,
        };
        vec![
            column("n", None, Cells::Integers((0..50).map(|i| i - (1 << 60)).collect())),
            column("x y", Some("m/s"), Cells::Numbers((0..50).map(missing).collect())),
            column("odd", Some("1"), Cells::Numbers((0..50).map(|i| Some(odd[i % 5])).collect())),
            column("Größe", None, Cells::Texts((0..50).map(|i| "µ,\"".repeat(i)).collect())),
        ]
    }

    const CHECK: &str = r#"
import math, struct, sys, pyarrow.parquet as pq
file = pq.ParquetFile(sys.argv[1])
table = file.read()
assert [str(t) for t in table.schema.types] == ["int64", "double", "double", "string"], table.schema
assert table.schema.names == ["n", "x y", "odd", "Größe"]
n, x, odd, text = (column.to_pylist() for column in table.columns)
assert n == [i - 2**60 for i in range(50)]
assert x == [0.1 + i if i % 5 != 2 and i < 40 else None for i in range(50)], x
right = [math.nan, -0.0, math.inf, 5e-324, sys.float_info.max] * 10
bits = lambda x: "nan" if math.isnan(x) else struct.pack("<d", x)
assert [bits(x) for x in odd] == [bits(x) for x in right], odd
assert text == ['µ,"' * i for i in range(50)]
found = {k.decode(): v.decode() for k, v in file.metadata.metadata.items()}
assert found == {"unit:x y": "m/s", "unit:odd": "1", "lacuna": sys.argv[2]}, found
"#;

    /// Pages of 7 rows, of which the last is shorter, and one page for all.
    #[test]
    fn every_kind_of_column_is_read_by_pyarrow() {
        let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
        let python = std::env::var_os("LACUNA_PYTHON");
        assert!(python.is_some() || !required, "LACUNA_PYTHON names no interpreter with pyarrow");
        let folder = tempfile::tempdir().unwrap();
        for page in [7, 1000] {
            let bytes = file_of_pages(&columns(), page);
            assert!(bytes.starts_with(MAGIC) && bytes.ends_with(MAGIC));
            let path = folder.path().join("table.parquet");
            std::fs::write(&path, bytes).unwrap();
            let Some(python) = &python else {
                println!("skipped: LACUNA_PYTHON names no interpreter with pyarrow");
                return;
            };
            let version = env!("CARGO_PKG_VERSION");
            let done =
                Command::new(python).args(["-c", CHECK]).arg(&path).arg(version).output().unwrap();
            assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        }
    }
}
