//! Studies: everything that `lacuna check` does.

use std::fs;
use std::path::Path;

use lacuna::text::emit;
use lacuna_engine::stage::contents;
use lacuna_engine::study::resolve::{self, Use};
use lacuna_plugins as _;
use toml::Value;

use super::shared::{LONGEST, in_folder, says_why};

/// Tables of the study that `lacuna new study` writes.
const TABLES: [(&str, &str); 3] = [
    ("runs.csv", include_str!("../../../../cli/src/new/runs.csv")),
    ("responses.csv", include_str!("../../../../cli/src/new/responses.csv")),
    ("measured.csv", include_str!("../../../../cli/src/new/measured.csv")),
];

/// Words of what asks servers and schedulers, which a target has no business with.
const OUTSIDE: [&str; 5] = ["um_bridge", "://", "hyperqueue", "slurm", "extends"];

/// A study is refused with a complaint, or is sound: then it is written with all defaults so that it reads back as written.
pub fn study(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if text.len() > LONGEST || OUTSIDE.iter().any(|word| text.contains(word)) {
        return;
    }
    comes_back(text);
    in_folder(|folder| {
        for (name, table) in TABLES {
            let path = folder.join(name);
            if !path.exists() {
                fs::write(&path, table).expect("a table can be written");
            }
        }
        check(&folder.join("study.toml"), text);
    });
}

fn check(path: &Path, text: &str) {
    let checked = resolve::load_text_for(path, text, Use::Check);
    let complaints = checked.complaints();
    let Some(study) = &checked.study else {
        assert!(!complaints.trim().is_empty(), "refused without a complaint");
        assert!(complaints.len() < 4_000_000, "complaints of {} bytes", complaints.len());
        return;
    };
    assert!(complaints.is_empty(), "accepted with a complaint: {complaints}");
    contents::check(study).err().iter().flatten().for_each(says_why);
    let written = emit::to_toml(&study.resolved).expect("a sound study can be written");
    let again = resolve::load_text_for(path, &written, Use::Check);
    let study = again.study.as_ref().unwrap_or_else(|| {
        panic!("the study with its defaults is refused:\n{}\n{written}", again.complaints())
    });
    let rewritten = emit::to_toml(&study.resolved).expect("it can be written again");
    assert_eq!(rewritten, written, "defaults change when they are written");
}

/// Any table of TOML is written so that it reads back as it was.
fn comes_back(text: &str) {
    let Ok(table) = text.parse::<toml::Table>() else { return };
    let written = emit::to_toml(&table).expect("a table can be written");
    let again: toml::Table = written.parse().unwrap_or_else(|error| panic!("{error}\n{written}"));
    assert!(same(&Value::Table(again), &Value::Table(table)), "{written}");
}

/// Equality of values for which NaN is equal to itself.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Float(a), Value::Float(b)) => {
            a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
        }
        (Value::Table(a), Value::Table(b)) => {
            let in_b = |(key, a): (&String, &Value)| b.get(key).is_some_and(|b| same(a, b));
            a.len() == b.len() && a.iter().all(in_b)
        }
        (a, b) => a == b,
    }
}
