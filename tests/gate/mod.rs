//! The standing gate: everything that is printed as an uncertainty is known here, with how often it holds the truth.
//!
//! The quick part runs with all tests. The whole, whose table stands in `docs/coverage.md`:
//!
//! ```sh
//! LACUNA_GATE=1000 cargo test --release -p lacuna-tests --test coverage -- --nocapture gate
//! ```

mod counts;
mod lines;
mod printed;

use std::collections::BTreeMap;
use std::fs;

use serde::Deserialize;

use crate::quick::root;
use counts::{Count, LINES, count};

/// The truths of the quick part.
const QUICK: usize = 40;

/// What the registry says of each printed key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Registry {
    counted: BTreeMap<String, String>,
    elsewhere: BTreeMap<String, String>,
    uncounted: BTreeMap<String, String>,
    plain: BTreeMap<String, Vec<String>>,
}

impl Registry {
    fn read() -> Self {
        let text = fs::read_to_string(root().join("tests/gate/printed.toml")).unwrap();
        toml::from_str(&text).unwrap()
    }

    fn keys(&self) -> Vec<String> {
        let plain = |(file, keys): (&String, &Vec<String>)| -> Vec<String> {
            keys.iter().map(|key| format!("{file}.{key}")).collect()
        };
        let lists = [&self.counted, &self.elsewhere, &self.uncounted];
        let listed = lists.into_iter().flat_map(BTreeMap::keys).cloned();
        listed.chain(self.plain.iter().flat_map(plain)).collect()
    }
}

/// Nothing is printed that the registry does not know, and it knows nothing that is not printed; each key once.
#[test]
fn every_printed_key_is_registered() {
    let printed = printed::keys();
    let known = Registry::read().keys();
    let missing: Vec<&String> = printed.iter().filter(|key| !known.contains(key)).collect();
    assert!(
        missing.is_empty(),
        "printed in summary.json and unknown to tests/gate/printed.toml: {missing:?}; an uncertainty needs an entry that \
         counts it (tests/gate/counts.rs), anything else a place under [plain]"
    );
    let gone: Vec<&String> = known.iter().filter(|key| !printed.contains(*key)).collect();
    assert!(gone.is_empty(), "in tests/gate/printed.toml and no longer printed: {gone:?}");
    assert_eq!(known.len(), printed.len(), "a key stands twice in tests/gate/printed.toml");
}

/// What the registry names is there: entries, and functions of other tests.
#[test]
fn what_the_registry_names_is_there() {
    let registry = Registry::read();
    for (key, entry) in &registry.counted {
        assert!(LINES.iter().any(|e| e.name == entry), "`{key}`: no entry `{entry}`");
    }
    for (key, place) in &registry.elsewhere {
        let (file, function) = place.split_once("::").unwrap();
        let text = fs::read_to_string(root().join(file)).unwrap();
        assert!(text.contains(&format!("fn {function}()")), "`{key}`: no `{place}`");
    }
    assert!(registry.uncounted.values().all(|reason| !reason.is_empty()));
    // The list of what nobody has counted only becomes shorter.
    assert!(registry.uncounted.len() <= 15, "{:?}", registry.uncounted.keys());
}

/// Each entry holds the truth as often as it says, within what chance allows in 99 % of such counts.
#[test]
fn printed_uncertainties_hold_the_truth() {
    let asked = std::env::var("LACUNA_GATE").ok();
    let number = asked.map_or(QUICK, |text| text.parse().unwrap());
    let cases = lines::cases(number, 20_260);
    let counts: Vec<Count> = LINES.iter().map(|entry| count(entry, &cases)).collect();
    println!("| entry | what is counted | nominal | counted | 99 % band |\n|---|---|---|---|---|");
    for count in &counts {
        let percent = |k: usize| 100.0 * k as f64 / count.of.max(1) as f64;
        let [low, high] = count.band().map(percent);
        println!(
            "| `{}` | {} | {:.1} % | {} of {}, {:.1} % | {low:.1} to {high:.1} % |",
            count.name,
            count.what,
            100.0 * count.nominal,
            count.inside,
            count.of,
            percent(count.inside)
        );
    }
    let wrong: Vec<&Count> = counts.iter().filter(|count| !count.holds()).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}
