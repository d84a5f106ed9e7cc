//! The printed keys: those of `summary.json`, from its schema, so that a key which no run of the tests makes is found too.

use std::collections::BTreeMap;
use std::fs;

use lacuna_engine::report::{Key, keys, schema};
use serde::Deserialize;

use crate::quick::root;

/// The entries of `tests/gate/printed.toml`, by the path of the key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Registry {
    /// The entry of the gate that counts the key.
    pub counted: BTreeMap<String, String>,
    /// The file and function of another test that counts the key.
    pub elsewhere: BTreeMap<String, String>,
    /// The reason why nobody has counted the key.
    pub uncounted: BTreeMap<String, String>,
    /// The reason why a number that is not declared a quantity claims nothing.
    pub plain: BTreeMap<String, String>,
    /// An object and the object with the same keys whose entries count for it.
    pub same: BTreeMap<String, String>,
}

impl Registry {
    /// The file.
    pub fn read() -> Self {
        let text = fs::read_to_string(root().join("tests/gate/printed.toml")).unwrap();
        toml::from_str(&text).unwrap()
    }

    /// All keys that have an entry; one that has two stands twice.
    pub fn keys(&self) -> Vec<&str> {
        let lists = [&self.counted, &self.elsewhere, &self.uncounted, &self.plain];
        lists.into_iter().flat_map(BTreeMap::keys).map(String::as_str).collect()
    }

    /// The path whose entry counts for a key.
    pub fn counts_as(&self, path: &str) -> String {
        let below = |object: &str| path.strip_prefix(object)?.strip_prefix('.').map(str::to_owned);
        let mut same = self.same.iter().filter_map(|(object, as_in)| Some((below(object)?, as_in)));
        match same.next() {
            Some((key, as_in)) => self.counts_as(&format!("{as_in}.{key}")),
            None => path.to_owned(),
        }
    }

    /// The printed claims that have no entry.
    pub fn missing(&self, printed: &[Key]) -> Vec<String> {
        let known = self.keys();
        let claims = printed.iter().filter(|key| key.is_claim).map(|key| self.counts_as(&key.path));
        claims.filter(|path| !known.contains(&&**path)).collect()
    }

    /// The entries, and the objects of `same`, that are printed no longer.
    pub fn gone(&self, printed: &[Key]) -> Vec<String> {
        let is_there = |path: &str| printed.iter().any(|key| key.path == path);
        let of_keys = self.keys().into_iter().filter(|path| !is_there(path));
        let objects = self.same.iter().flat_map(|(object, as_in)| [object, as_in]);
        let of_objects = objects.map(String::as_str).filter(|path| !is_there(path));
        of_keys.chain(of_objects).map(str::to_owned).collect()
    }
}

/// All keys that `summary.json` can have.
pub fn printed() -> Vec<Key> {
    keys(&schema())
}

#[test]
fn a_new_claim_needs_an_entry_and_a_new_quantity_none() {
    let registry = Registry::read();
    let key = |path: &str, is_claim: bool| Key {
        path: path.to_owned(),
        kind: "number".to_owned(),
        meaning: "A new key.".to_owned(),
        choices: Vec::new(),
        is_claim,
        definition: None,
    };
    let new = [key("gap.p.new", true), key("gap.p_after.new", true), key("gap.size", false)];
    assert_eq!(registry.missing(&new), ["gap.p.new", "gap.p.new"]);
    assert_eq!(registry.missing(&[key("gap.p_after.score", true)]), Vec::<String>::new());
    let twice = "gap.held_out_further[].conditions.<scenario>.lower";
    assert_eq!(registry.counts_as(twice), "gap.held_out.lower");
}
