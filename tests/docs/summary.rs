//! The page of the reference on `summary.json`, from the schema of the summary.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use lacuna_engine::report::{Key, keys, schema};

const HEAD: &str = "\
# `summary.json`

The results of a run, for scripts; a key keeps its name and its meaning. Numbers are in the units of the study, unrounded; a number that is \
not finite is `null`. A key is absent where the run did not make it, and only where its type says so it is `null` instead. `<name>` stands for a \
name from the study, `[]` for each entry of a list. The JSON Schema of the file is [`summary.schema.json`](../summary.schema.json), which \
`lacuna schema summary` prints too.
";

/// The page, without the line that says that it is generated.
pub fn page() -> String {
    let keys = without_repetition(keys(&schema()));
    let mut groups: Vec<(&str, Vec<&Key>)> = Vec::new();
    for key in &keys {
        let head = key.path.split(['.', '[']).next().unwrap_or_default();
        match groups.last_mut().filter(|(name, _)| *name == head) {
            Some((_, group)) => group.push(key),
            None => groups.push((head, vec![key])),
        }
    }
    let (single, whole): (Vec<_>, Vec<_>) = groups.into_iter().partition(|(_, g)| g.len() == 1);
    let mut page = format!("{HEAD}\n## The run\n");
    table(&mut page, single.iter().map(|(_, group)| group[0]));
    for (name, group) in whole {
        let (about, rows) = match group.split_first() {
            Some((first, rest)) if first.path == name => (Some(first), rest),
            _ => (None, &group[..]),
        };
        writeln!(page, "\n## `{name}`").unwrap();
        if let Some(about) = about {
            writeln!(page, "\n{}", one_line(&about.meaning)).unwrap();
        }
        table(&mut page, rows.iter().copied());
    }
    page
}

/// The keys without those of an object whose like was listed before; it says where.
fn without_repetition(keys: Vec<Key>) -> Vec<Key> {
    let mut listed: BTreeMap<String, String> = BTreeMap::new();
    let mut repeated: Vec<String> = Vec::new();
    let mut kept = Vec::new();
    for mut key in keys {
        if repeated.iter().any(|object| key.path.starts_with(object)) {
            continue;
        }
        if let Some(definition) = key.definition.clone() {
            if let Some(first) = listed.get(&definition) {
                repeated.push(format!("{}.", key.path));
                key.meaning = format!("{} Its keys are those of `{first}`.", key.meaning);
            } else {
                listed.insert(definition, key.path.clone());
            }
        }
        kept.push(key);
    }
    kept
}

fn table<'a>(page: &mut String, keys: impl Iterator<Item = &'a Key>) {
    page.push_str("\n| key | type | meaning |\n|---|---|---|\n");
    for key in keys {
        let mut meaning = one_line(&key.meaning);
        for (word, text) in &key.choices {
            let colon = if text.is_empty() { "" } else { ": " };
            write!(meaning, "<br>• `{word}`{colon}{}", one_line(text)).unwrap();
        }
        let cells = [format!("`{}`", key.path), key.kind.clone(), meaning];
        let cells = cells.map(|cell| cell.replace('|', "\\|")).join(" | ");
        writeln!(page, "| {cells} |").unwrap();
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
