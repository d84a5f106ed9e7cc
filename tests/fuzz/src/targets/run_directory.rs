//! Run directories that others wrote or that were damaged.

use std::fs;
use std::path::Path;

use lacuna::run::{Silent, Stop, files as run_files};
use lacuna_engine::compare::{self, Finished};
use lacuna_engine::stage::manifest;
use lacuna_engine::view::{Answer, RunRow, ServedFolder, Watched};
use lacuna_run::arrays;
use lacuna_run::progress::Present;
use lacuna_run::work::{Marker, Order};
use lacuna_run::{Artifact, RunDirectory, Stage, seen};

use super::shared::{LONGEST, in_folder, says_why};

/// Beginning of a line that names the file to which what follows belongs.
const FILE: &[u8] = b"@@ ";
/// Markup that no page may hold as such, however it gets into a file.
const MARKUP: &str = "<x9";
/// Most files of one directory.
const MOST: usize = 12;

/// Bytes are the files of a directory: whoever looks at it answers or says why not, and a stage is made whatever stands
/// in its folder.
pub fn run_directory(bytes: &[u8]) {
    if bytes.len() > LONGEST {
        return;
    }
    in_folder(|folder| {
        let root = folder.join("run");
        let _ = fs::remove_dir_all(&root);
        fs::create_dir_all(&root).expect("a folder can be made");
        for (path, content) in files(bytes) {
            let path = root.join(path);
            // A file may stand where a folder is needed.
            if fs::create_dir_all(path.parent().unwrap_or(&root)).is_ok() {
                let _ = fs::write(&path, content);
            }
        }
        looked_at(&root);
        shown(&root);
        compared(&root);
        numbers(&root);
        kept(&root);
    });
}

/// The files that bytes describe: lines `@@ NAME`, each followed by what stands in the file.
fn files(bytes: &[u8]) -> Vec<(String, &[u8])> {
    let mut found: Vec<(String, &[u8])> = Vec::new();
    let mut rest = bytes;
    while let Some(named) = rest.strip_prefix(FILE) {
        let end = named.iter().position(|&b| b == b'\n').unwrap_or(named.len());
        let name = String::from_utf8_lossy(&named[..end]).into_owned();
        let after = &named[(end + 1).min(named.len())..];
        let next = (0..after.len())
            .find(|&i| (i == 0 || after[i - 1] == b'\n') && after[i..].starts_with(FILE));
        let (content, remaining) = after.split_at(next.unwrap_or(after.len()));
        if is_inside(&name) && found.len() < MOST {
            found.push((name, content));
        }
        rest = remaining;
    }
    found
}

/// Names that stay in the directory.
fn is_inside(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    let part = |part: &str| !part.is_empty() && part.len() < 60 && part != "." && part != "..";
    name.split('/').count() < 5 && name.split('/').all(|p| part(p) && p.chars().all(is_plain))
}

fn looked_at(root: &Path) {
    seen::stages(root);
    let _ = Present::read(root);
    let _ = manifest::origin(root);
    RunRow::read(root, "run");
    let watched = Watched::read(root, "run");
    serde_json::to_string(&watched).expect("what is seen of a run is JSON");
    for folder in [root.to_owned(), root.join("2-simulate")] {
        for name in Marker::names(&folder) {
            let _ = Marker::look(&folder, &name);
        }
        if let Err(stop) = Order::read(&folder) {
            says_why(&stop);
        }
    }
}

/// Pages hold no markup of files.
fn shown(root: &Path) {
    let served = ServedFolder::open(root.parent().unwrap_or(root)).expect("the folder is there");
    for path in ["/", "/api/runs", "/runs/run/", "/part/runs/run", "/api/runs/run"] {
        match served.answer(path, "") {
            Answer::Page(page) => assert!(!page.contains(MARKUP), "{page}"),
            Answer::Refused(status, reason) => assert!(status >= 400 && !reason.is_empty()),
            _ => {}
        }
    }
}

fn compared(root: &Path) {
    match Finished::read(root) {
        Ok(run) => {
            let again = Finished::read(root).expect("what was read reads again");
            compare::text(&compare::compare(&[run, again]));
        }
        Err(stop) => says_why(&stop),
    }
}

/// Arrays that are read are written so that they read back to the bit.
fn numbers(root: &Path) {
    for entry in fs::read_dir(root).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|extension| extension != "nc") {
            continue;
        }
        for name in ["x", "points", "draws"] {
            match arrays::read_some(&path, name) {
                Ok(Some(array)) => {
                    let expected = array.dimensions.iter().map(|d| d.1).product::<usize>();
                    assert_eq!(array.values.len(), expected);
                    let copy = root.join("copy.nc");
                    if arrays::write(&copy, &[], std::slice::from_ref(&array)).is_ok() {
                        let again = arrays::read(&copy, name).expect("what was written");
                        let bits = |a: &arrays::Array| {
                            a.values.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
                        };
                        assert_eq!(bits(&again), bits(&array));
                    }
                }
                Ok(None) => {}
                Err(stop) => says_why(&stop),
            }
        }
    }
}

/// A result of one number.
struct Number(u64);

impl Artifact for Number {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        run_files::write_json(&folder.join("number.json"), &self.0)?;
        Ok(vec!["number.json".to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        run_files::read_json(&folder.join("number.json")).map(Self)
    }
}

/// A stage gives its result, whatever stands in its folder, or says why it cannot; then the result is found again.
fn kept(root: &Path) {
    let mut directory = match RunDirectory::open(root) {
        Ok(directory) => directory,
        Err(stop) => return says_why(&stop),
    };
    let stage = Stage::Design.folder();
    let _ = directory.has(&stage, &"inputs");
    match directory.keep(&stage, &"inputs", &Silent, |_| Ok(Number(7))) {
        Ok(kept) => {
            let again = directory.keep(&stage, &"inputs", &Silent, |_| Ok(Number(8)));
            let again = again.unwrap_or_else(|stop| panic!("{stop}"));
            assert_eq!(again.value.0, kept.value.0, "a finished stage is found again");
            assert!(!again.fresh, "a finished stage is made again");
        }
        Err(stop) => says_why(&stop),
    }
}
