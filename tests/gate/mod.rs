//! The gate: every printed uncertainty is registered, with its coverage.
//!
//! The quick part runs with all tests. The full count, whose table is in `docs/coverage.md`:
//!
//! ```sh
//! LACUNA_GATE=1000 cargo test --release --workspace --test all -- --nocapture gate::
//! ```

mod counts;
mod lines;
mod printed;

use std::fs;

use crate::quick::root;
use counts::{Count, LINES, count};
use printed::{Registry, printed};

/// Number of truths of the quick part.
const QUICK: usize = 40;

/// No uncertainty is printed that the registry does not know, and it knows nothing that is not printed; each key once.
#[test]
fn every_printed_claim_is_registered() {
    let (printed, registry) = (printed(), Registry::read());
    let missing = registry.missing(&printed);
    assert!(
        missing.is_empty(),
        "printed in summary.json and unknown to tests/gate/printed.toml: {missing:?}; an uncertainty needs an entry that \
         counts it (tests/gate/counts.rs), any other number the type `Quantity`"
    );
    let gone = registry.gone(&printed);
    assert!(gone.is_empty(), "in tests/gate/printed.toml and not printed: {gone:?}");
    let mut known = registry.keys();
    known.sort_unstable();
    assert!(known.windows(2).all(|pair| pair[0] != pair[1]), "a key stands twice: {known:?}");
    let alias = known.iter().find(|path| registry.counts_as(path) != **path);
    assert!(alias.is_none(), "`{}` has an entry of its own and one under [same]", alias.unwrap());
}

/// The entries and test functions that the registry names exist.
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
    let reasons = registry.uncounted.values().chain(registry.plain.values());
    assert!(reasons.into_iter().all(|reason| !reason.is_empty()));
    // The list of what nobody has counted only becomes shorter.
    assert!(registry.uncounted.len() <= 4, "{:?}", registry.uncounted.keys());
}

/// Each entry has its nominal coverage, within a 99 % band, except for those with a known deviation.
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
    for (count, reason) in counts.iter().filter_map(|count| Some((count, count.open?))) {
        println!("known not to hold as often as it says: `{}`, since {reason}", count.name);
    }
    let wrong = counts.iter().filter(|count| !count.holds() && count.open.is_none());
    let wrong: Vec<&Count> = wrong.collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}
