//! The power of the workflow in a study, as a text for the terminal.

use super::reliability::reliability_text;
use crate::gap::power::Rates;
use crate::page::number::{fixed, percent};
use crate::page::table::Table;

/// The rates as tables.
pub fn power_text(rates: &Rates) -> String {
    let mut parts = Vec::new();
    let alarms = &rates.alarms;
    if alarms.cases > 0 {
        let [low, high] = alarms.interval;
        parts.push(format!(
            "Without an injection: {} alarms in {} cases, {} (95 % interval {} to {}).\n",
            alarms.alarms,
            alarms.cases,
            percent(alarms.alarms as f64 / alarms.cases as f64),
            percent(low),
            percent(high)
        ));
    }
    parts.push(kinds(rates).text());
    if rates.kinds.iter().flat_map(|kind| &kind.sizes).any(|size| size.absorbed > 0) {
        parts.push(
            "In parentheses: cases of which the calibrated parameters absorb more than 99 %, so that nothing is left to be \
             found; the sizes in the last columns are those of the others.\n"
                .to_owned(),
        );
    }
    if rates.named[0] > 0 {
        parts.push(format!(
            "Names that were given: {}; right: {}.\n",
            rates.named[0], rates.named[1]
        ));
    }
    let wrong = rates.confusion.iter().filter(|(planted, named, _)| planted != named);
    let wrong: Vec<String> =
        wrong.map(|(planted, named, n)| format!("{planted} as {named} ({n})")).collect();
    if !wrong.is_empty() {
        parts.push(format!("Wrong names: {}.\n", wrong.join(", ")));
    }
    if rates.pairs[0] > 0 {
        parts.push(format!("Pairs: {} of {} with both found.\n", rates.pairs[1], rates.pairs[0]));
    }
    if !rates.outside.is_empty() {
        parts.push(outside(rates).text());
    }
    parts.extend(reliability_text(rates));
    for (ratio, cases, found, overlap) in &rates.bumps {
        parts.push(format!(
            "Bumps on one curve of {} times the noise: {found} of {cases} found; places overlap by {}.\n",
            fixed(*ratio, 2),
            percent(*overlap)
        ));
    }
    parts.join("\n")
}

fn kinds(rates: &Rates) -> Table {
    let mut ratios: Vec<f64> =
        rates.kinds.iter().flat_map(|kind| &kind.sizes).map(|size| size.ratio).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.dedup();
    let heads: Vec<String> = ratios.iter().map(|r| format!("{} x noise", fixed(*r, 2))).collect();
    let mut heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    heads.push("found in 80 % from");
    heads.push("its size there");
    let mut table = Table::new(&["injected: in class / named alone / cases"], &heads);
    for kind in &rates.kinds {
        let at =
            |ratio: f64| kind.sizes.iter().find(|size| size.ratio.to_bits() == ratio.to_bits());
        let mut cells = vec![kind.kind.clone()];
        cells.extend(ratios.iter().map(|&ratio| {
            at(ratio).map_or_else(String::new, |s| match s.absorbed {
                0 => format!("{}/{}/{}", s.in_class, s.named, s.cases),
                n => format!("{}/{}/{} ({n})", s.in_class, s.named, s.cases),
            })
        }));
        let smallest = kind.smallest.and_then(at);
        cells.push(smallest.map_or_else(|| "none".to_owned(), |s| fixed(s.ratio, 2)));
        cells.push(
            smallest.map_or_else(String::new, |s| crate::page::number::significant(s.size, 2)),
        );
        table.row(cells);
    }
    table
}

/// The answers to changes of another form than those of the candidates.
fn outside(rates: &Rates) -> Table {
    let columns =
        ["cases", "unnoticed", "`unlisted`", "nearest type", "wrong name", "of these exact"];
    let mut table = Table::new(&["injected: of no candidate's form", "sort"], &columns);
    for own in &rates.outside {
        let counts = [own.cases, own.unnoticed, own.unlisted, own.nearest, own.wrong, own.named];
        let mut cells = vec![own.kind.clone(), own.sort.clone()];
        cells.extend(counts.map(|count| count.to_string()));
        table.row(cells);
    }
    table
}
