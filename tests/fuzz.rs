//! Corpora of the fuzz targets and mutations of them, through the bodies of the targets (`fuzz/src/targets`).
//!
//! `cargo fuzz` searches with the coverage of the code as its guide, for as long as it is let; here the same functions get
//! every file that it has left, and a fixed number of seeded mutations of each.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use lacuna::math::random::{Stream, below};

use crate::quick::root;

#[path = "fuzz/src/targets/mod.rs"]
mod targets;

/// Numbers at which computations of sizes and places go wrong, as bytes and as text.
const NUMBERS: [&[u8]; 16] = [
    b"\0\0\0\0",
    b"\x01\0\0\0",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\x7f\xff\xff\xff",
    b"\0\0\0\0\0\0\0\x80",
    b"\xff\xff\xff\xff\xff\xff\xff\x7f",
    b"0",
    b"-1",
    b"nan",
    b"-inf",
    b"1e308",
    b"4e-320",
    b"2147483648",
    b"9223372036854775807",
    b"99999999999999999999",
];

/// Samples of other programs that are larger than files of a corpus should be.
const SAMPLES: [(&str, &[&str]); 2] = [
    ("exodus", &["hist_cdf2.h", "hist_cdf5.h", "hist_nc4.h"]),
    ("records", &["records.h5", "records_73.mat", "records.tdms", "types.tdms"]),
];

/// The files of a corpus in the order of their names, and samples.
fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = root().join("tests/fuzz/corpus").join(target);
    let mut paths: Vec<PathBuf> =
        fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    let samples = SAMPLES.iter().filter(|(of, _)| *of == target).flat_map(|(_, files)| *files);
    paths.extend(samples.map(|file| root().join("tests/samples").join(file)));
    paths.sort();
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    let files: Vec<_> = paths.iter().map(|path| (name(path), fs::read(path).unwrap())).collect();
    assert!(files.len() >= 5, "{}: {} files", folder.display(), files.len());
    files
}

/// Seeded changes of bytes: a stream, and how many numbers were drawn of it.
struct Mutator(Stream, u64);

impl Mutator {
    /// A number below a limit, and 0 where there is none.
    fn below(&mut self, limit: usize) -> usize {
        self.1 += 1;
        below(&mut self.0.at(self.1).generator(), limit.max(1))
    }

    /// A range of bytes, mostly short.
    fn range(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.below(length);
        let longest = [4, 32, length][self.below(3)].min(length - start);
        start..start + self.below(longest + 1)
    }

    /// One to three changes: a bit is flipped, bytes are deleted, repeated, replaced by those of another file or by a number.
    fn change(&mut self, bytes: &[u8], other: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        for _ in 0..=self.below(3) {
            let range = self.range(bytes.len());
            match self.below(5) {
                0 if !bytes.is_empty() => {
                    let at = self.below(bytes.len());
                    bytes[at] ^= 1 << self.below(8);
                }
                1 => drop(bytes.splice(range, [])),
                2 => {
                    let again = bytes[range.clone()].to_vec();
                    bytes.splice(range.end..range.end, again);
                }
                3 => {
                    let from = self.range(other.len());
                    bytes.splice(range, other[from].iter().copied());
                }
                _ => {
                    let number = NUMBERS[self.below(NUMBERS.len())];
                    let end = (range.start + number.len()).min(bytes.len());
                    let end = if self.below(2) == 0 { range.end } else { end };
                    bytes.splice(range.start..end.max(range.start), number.iter().copied());
                }
            }
        }
        bytes
    }
}

/// Runs a target on its corpus and on mutations of it.
fn holds(target: &str, mutations: usize) {
    let files = corpus(target);
    let attempt = |what: &str, bytes: &[u8]| {
        let ran = catch_unwind(AssertUnwindSafe(|| targets::run(target, bytes)));
        assert!(ran.is_ok(), "`{target}` panics: {what}: {}", bytes.escape_ascii());
    };
    attempt("nothing", b"");
    for (i, (name, bytes)) in files.iter().enumerate() {
        attempt(name, bytes);
        let mut mutator = Mutator(Stream::root(1).named(target).named(name), 0);
        for number in 0..mutations {
            let other = &files[(i + number + 1) % files.len()].1;
            attempt(&format!("{name}, mutation {number}"), &mutator.change(bytes, other));
        }
    }
}

#[test]
fn every_target_has_a_test_and_an_entry() {
    let here = include_str!("fuzz.rs");
    let manifest = include_str!("fuzz/Cargo.toml");
    for (name, _) in targets::TARGETS {
        assert!(here.contains(&format!("holds(\"{name}\"")), "no test of `{name}`");
        assert!(manifest.contains(&format!("path = \"fuzz_targets/{name}.rs\"")), "`{name}`");
        let text = fs::read_to_string(root().join(format!("tests/fuzz/fuzz_targets/{name}.rs")));
        assert!(text.unwrap().contains(&format!("run(\"{name}\"")), "`{name}`");
    }
}

#[test]
fn tables_of_csv() {
    holds("csv", 20);
}

#[test]
fn exodus_files() {
    holds("exodus", 20);
}

#[test]
fn expressions() {
    holds("expression", 100);
}

#[test]
fn heartbeat_files() {
    holds("heartbeat", 100);
}

#[test]
fn plugin_tables() {
    holds("plugin_table", 100);
}

#[test]
fn records() {
    holds("records", 20);
}

#[test]
fn run_directories() {
    holds("run_directory", 20);
}

#[test]
fn studies() {
    holds("study", 20);
}

#[test]
fn messages_of_um_bridge() {
    holds("um_bridge", 100);
}

#[test]
fn units() {
    holds("unit", 200);
}
