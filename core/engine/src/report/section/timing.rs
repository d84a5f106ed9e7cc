//! The time of each stage.

use crate::page::chart::{Row, row_chart};
use crate::page::number::{duration, percent};
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::Findings;

/// The times; `None` if none is known.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    if findings.seconds.is_empty() {
        return None;
    }
    let total: f64 = findings.seconds.iter().map(|(_, seconds)| seconds).sum();
    let mut rows: Vec<Row> = findings
        .seconds
        .iter()
        .map(|(stage, seconds)| Row {
            name: stage.clone(),
            value: *seconds,
            text: format!(
                "{} · {}{}",
                duration(*seconds),
                percent(seconds / total),
                made_by(findings, stage)
            ),
        })
        .collect();
    rows.push(Row { name: String::from("together"), value: total, text: duration(total) });
    let caption = Caption::new(
        "Wall-clock time of each stage when its result was made; a result that was kept from an \
         earlier run counts with the time it took then.",
        "",
        "",
    );
    let drawing = row_chart(&rows, "bar s-time", "time of every stage");
    Some(Section {
        id: "timing",
        title: "Time",
        content: numbers.figure("time", &[drawing], &[], &caption),
    })
}

/// The version that computed the result of a stage; empty if it is the version that wrote the report.
fn made_by(findings: &Findings, stage: &str) -> String {
    let made = findings.made_by.iter().find(|(name, _)| name == stage);
    let other = made.filter(|(_, version)| *version != findings.version);
    other.map_or(String::new(), |(_, version)| format!(" · by lacuna {version}"))
}
