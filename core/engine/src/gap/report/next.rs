//! The information that further data are expected to give, as a text for the terminal.

use crate::gap::next::{NextData, NextOption, Wanted};
use crate::page::number::{fixed, percent, significant};
use crate::page::table::Table;

/// The options as a table, the best first.
pub fn text(next: &NextData) -> String {
    let columns = Columns { name: next.has(Wanted::Name), quantity: next.has(Wanted::Quantity) };
    let mut table = Table::new(&["next"], &columns.heads());
    for option in &next.options {
        table.row(columns.cells(option, next.ranked_by));
    }
    let equal = if columns.name {
        "`=`: equal to the best within two standard errors (±) of the Monte Carlo estimate."
    } else {
        "`=`: equal to the best."
    };
    let nothing = next.without_data.iter().map(|name| {
        format!("`{name}` measures nothing: no curve of the response has its scenario, labels and interval.\n")
    });
    format!("{}\n\n{}\n{equal}\n{}", head(next), table.text(), nothing.collect::<String>())
}

fn head(next: &NextData) -> String {
    let on = match next.ranked_by {
        Wanted::Name => "on the name",
        Wanted::Parameters => "on the parameters",
        Wanted::Quantity => "on the quantity",
    };
    let names = next.hypotheses.iter().map(|own| format!("{} {}", own.kind, percent(own.weight)));
    let names: Vec<String> = names.collect();
    let known = match names.len() {
        0 => "There is no choice of a name.".to_owned(),
        _ => format!("Possible names: {}.", names.join(", ")),
    };
    format!("{known} Ranked by the bits {on} per cost.")
}

/// The columns that a table has beside those of every table.
struct Columns {
    name: bool,
    quantity: bool,
}

impl Columns {
    fn heads(&self) -> Vec<&'static str> {
        let mut heads = vec!["cost"];
        if self.name {
            heads.extend(["bits on the name", "±"]);
        }
        heads.push("on the parameters");
        if self.quantity {
            heads.push("on the quantity");
            heads.extend(self.name.then_some("±"));
        }
        heads.extend(["bits per cost", ""]);
        heads
    }

    fn cells(&self, option: &NextOption, by: Wanted) -> Vec<String> {
        let mut cells = vec![option.name.clone(), significant(option.cost, 3)];
        if self.name {
            cells.extend([fixed(option.name_bits, 3), fixed(option.name_error, 3)]);
        }
        cells.push(fixed(option.parameter_bits, 3));
        if self.quantity {
            let cell = |value: Option<f64>| value.map_or_else(String::new, |x| fixed(x, 3));
            cells.push(cell(option.quantity_bits));
            cells.extend(self.name.then(|| cell(option.quantity_error)));
        }
        cells.push(fixed(option.bits(by).0 / option.cost, 3));
        cells.push(if option.equal_to_best { "=".to_owned() } else { String::new() });
        cells
    }
}
