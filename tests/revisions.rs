//! A change of the results of a stage or plugin requires a new revision: small artifacts of each are computed and
//! compared with the hashes in `revisions/golden.json`, which records the revision beside them.
//!
//! `LACUNA_BLESS=1` writes the file; it refuses a hash that has changed while its revision has not. Hashes are valid on
//! one kind of machine, which the file names: on others the test reports that it compares nothing.

mod artifacts;
mod stages;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::run::files;
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

/// Hash of a result, with the revision that computed it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Made {
    revision: u32,
    hash: String,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Golden {
    /// Kind of machine on which all hashes were computed.
    machine: String,
    plugins: BTreeMap<String, Made>,
    stages: BTreeMap<String, Made>,
}

/// Kind of this machine: the instruction sets from which the linear algebra chooses, because they determine the last
/// bits.
fn machine() -> String {
    let mut machine = format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS);
    #[cfg(target_arch = "x86_64")]
    for (name, there) in [
        ("avx2", std::arch::is_x86_feature_detected!("avx2")),
        ("fma", std::arch::is_x86_feature_detected!("fma")),
        ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
    ] {
        if there {
            machine = format!("{machine} {name}");
        }
    }
    machine
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("revisions/golden.json")
}

/// Numbers that are hashed bit for bit.
#[derive(Default)]
struct Bits(Vec<u8>);

impl Bits {
    fn add(&mut self, numbers: &[f64]) {
        for x in numbers {
            self.0.extend(x.to_bits().to_le_bytes());
        }
    }

    fn matrix(&mut self, matrix: &Matrix) {
        self.text(&format!("{}x{}", matrix.rows(), matrix.columns()));
        self.add(matrix.as_slice());
    }

    fn text(&mut self, text: &str) {
        self.0.extend(text.as_bytes());
    }

    fn hash(&self) -> String {
        files::hash(&self.0)
    }
}

/// Violations of the revision rule, one per line; `found` becomes valid if there are none.
fn judge(what: &str, golden: &BTreeMap<String, Made>, found: &BTreeMap<String, Made>) -> String {
    let mut wrong = String::new();
    for (name, made) in found {
        let line = match golden.get(name) {
            None => format!("the {what} `{name}` is not recorded: bless"),
            Some(old) if old == made => continue,
            Some(old) if old.hash != made.hash && old.revision == made.revision => format!(
                "the numbers of the {what} `{name}` have changed: raise its revision, which is {}, and bless",
                made.revision
            ),
            Some(old) if made.revision < old.revision => {
                format!("the revision of the {what} `{name}` has gone back from {}", old.revision)
            }
            Some(_) => format!("the {what} `{name}` has another revision than is recorded: bless"),
        };
        wrong.push_str(&line);
        wrong.push('\n');
    }
    for name in golden.keys().filter(|name| !found.contains_key(*name)) {
        wrong.push_str(&format!("the {what} `{name}` is recorded and not there: bless\n"));
    }
    wrong
}

#[test]
fn numbers_that_change_have_a_new_revision() {
    let bless = std::env::var_os("LACUNA_BLESS").is_some_and(|value| value == "1");
    let golden: Golden = files::read_json(&path()).unwrap_or_default();
    if golden.machine != machine() && !bless {
        println!(
            "skipped: the hashes are those of a machine with {}, and this one has {}",
            golden.machine,
            machine()
        );
        return;
    }
    let found = Golden { machine: machine(), plugins: artifacts::all(), stages: stages::all() };
    // On another kind of machine all hashes differ, and a change cannot be detected.
    let comparable = golden.machine == found.machine;
    let wrong = judge("plugin", &golden.plugins, &found.plugins)
        + &judge("stage", &golden.stages, &found.stages);
    if !bless {
        assert!(wrong.is_empty(), "{wrong}");
        return;
    }
    let unmoved: Vec<&str> = wrong.lines().filter(|line| line.contains("raise its")).collect();
    assert!(unmoved.is_empty() || !comparable, "{}", unmoved.join("\n"));
    let text = serde_json::to_string_pretty(&found).unwrap() + "\n";
    std::fs::write(path(), text).unwrap();
}

#[test]
fn a_change_without_a_new_revision_is_found() {
    let of = |revision: u32, hash: &str| {
        BTreeMap::from([("sampler.x".to_owned(), Made { revision, hash: hash.to_owned() })])
    };
    assert_eq!(judge("plugin", &of(1, "a"), &of(1, "a")), "");
    let said = judge("plugin", &of(1, "a"), &of(1, "b"));
    assert!(said.contains("raise its revision, which is 1, and bless"), "{said}");
    assert!(judge("plugin", &of(1, "a"), &of(2, "b")).ends_with("recorded: bless\n"));
    assert!(judge("plugin", &of(2, "a"), &of(1, "a")).contains("has gone back from 2"));
    assert!(judge("plugin", &BTreeMap::new(), &of(1, "a")).contains("is not recorded: bless"));
    assert!(judge("plugin", &of(1, "a"), &BTreeMap::new()).contains("not there: bless"));
}
