//! A table of columns, and its form as CSV.

use lacuna::run::Stop;

/// A column: name, unit, and one cell per row.
pub struct Column {
    pub name: String,
    pub unit: Option<String>,
    pub cells: Cells,
}

/// The cells of a column.
pub enum Cells {
    Integers(Vec<i64>),
    /// Numbers; `None` is a missing one.
    Numbers(Vec<Option<f64>>),
    Texts(Vec<String>),
}

impl Cells {
    /// Number of rows.
    pub fn len(&self) -> usize {
        match self {
            Self::Integers(cells) => cells.len(),
            Self::Numbers(cells) => cells.len(),
            Self::Texts(cells) => cells.len(),
        }
    }

    /// The cell of a row as text; a missing number is a blank.
    fn text(&self, row: usize) -> String {
        match self {
            Self::Integers(cells) => cells[row].to_string(),
            Self::Numbers(cells) => cells[row].map_or(String::new(), |x| x.to_string()),
            Self::Texts(cells) => cells[row].clone(),
        }
    }
}

impl Column {
    /// The name, with the unit in brackets.
    pub fn heading(&self) -> String {
        let unit = self.unit.as_ref().map_or(String::new(), |unit| format!(" [{unit}]"));
        format!("{}{unit}", self.name)
    }
}

/// The table as CSV: a line of headings, a line per row.
pub fn csv(columns: &[Column]) -> String {
    let mut text = line(columns.iter().map(Column::heading));
    for row in 0..columns.first().map_or(0, |column| column.cells.len()) {
        text.push_str(&line(columns.iter().map(|column| column.cells.text(row))));
    }
    text
}

fn line(cells: impl Iterator<Item = String>) -> String {
    let cells: Vec<String> = cells.map(|cell| crate::inspect::quoted(&cell)).collect();
    cells.join(",") + "\n"
}

/// Fails if two columns have the same name, by which alone a format without headings tells them apart.
pub fn with_names_of_their_own(columns: &[Column]) -> Result<(), Stop> {
    for (i, column) in columns.iter().enumerate() {
        if columns[..i].iter().any(|other| other.name == column.name) {
            let text = format!("the table has two columns `{}`", column.name);
            return Err(Stop::new(text).help("rename the unknown or the axis, or write `.csv`"));
        }
    }
    Ok(())
}
