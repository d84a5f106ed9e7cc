//! The book: `book/SUMMARY.md` has every page, and what the pages tell to type exists.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::markdown::Page;
use super::{compare, reference, root};
use crate::quick::command;
use crate::readme::Walk;

const SUMMARY: &str = "book/SUMMARY.md";

/// A path from the root of the project, with forward slashes.
fn from_root(path: &Path) -> String {
    let whole = |path: &Path| {
        path.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let inside = whole(path).strip_prefix(whole(&root())).unwrap().to_owned();
    inside.to_string_lossy().replace('\\', "/")
}

/// The list of the reference in the summary: its pages with their own titles.
fn reference_list() -> String {
    let mut list = String::new();
    for (path, text) in reference() {
        let title = text.lines().find_map(|line| line.strip_prefix("# ")).expect("a title");
        let indent = if path.ends_with("README.md") { "" } else { "  " };
        writeln!(list, "{indent}- [{title}](../{path})").unwrap();
    }
    list
}

/// Returns true if the manual of a command has this option.
fn has(manual: &str, option: &str) -> bool {
    manual.split(|c: char| !c.is_alphanumeric() && c != '-').any(|known| known == option)
}

/// Returns true if the manual of a command lists this one below it.
fn lists(manual: &str, verb: &str) -> bool {
    let Some((_, list)) = manual.split_once("\nCommands:\n") else { return false };
    let entries = list.lines().take_while(|line| line.starts_with("  "));
    entries.filter_map(|line| line[2..].split(' ').next()).any(|known| known == verb)
}

/// Manuals of commands, by their verbs.
#[derive(Default)]
struct Manuals(BTreeMap<Vec<String>, String>);

impl Manuals {
    fn of(&mut self, verbs: &[&str]) -> &str {
        let key: Vec<String> = verbs.iter().map(|verb| (*verb).to_owned()).collect();
        self.0.entry(key).or_insert_with(|| {
            let output = command().args(verbs).arg("--help").output().unwrap();
            String::from_utf8(output.stdout).unwrap()
        })
    }

    /// Fault of a line of a shell, if it calls the command and names what does not exist.
    fn fault(&mut self, line: &str) -> Option<String> {
        let ends = ["|", "||", "&&", ";", ">", "#", "&"];
        let words = line.split_whitespace().take_while(|word| !ends.contains(word));
        let words: Vec<&str> = words.collect();
        let (first, rest) = words.split_first()?;
        if *first != "lacuna" {
            return None;
        }
        let mut verbs: Vec<&str> = Vec::new();
        for verb in rest {
            if !lists(self.of(&verbs), verb) {
                break;
            }
            verbs.push(*verb);
        }
        let next = rest.get(verbs.len()).filter(|word| !word.starts_with('-'));
        let manual = self.of(&verbs);
        // `lacuna plugins` has a command below it, and takes a name as well.
        let asks_verb = manual.contains("\nCommands:\n") && !manual.contains("\nArguments:\n");
        if let Some(verb) = next.filter(|_| asks_verb) {
            return Some(format!("there is no command `{verb}`"));
        }
        let options = rest.iter().filter(|word| word.starts_with("--"));
        let mut options = options.filter_map(|word| word.split('=').next());
        let unknown = options.find(|option| !has(manual, option))?;
        Some(format!("there is no option `{unknown}`"))
    }
}

#[test]
fn every_page_is_in_the_book_once() {
    let summary = root().join(SUMMARY);
    let links = Page::read(&summary).links();
    let folder = summary.parent().unwrap();
    let listed: Vec<String> = links.iter().map(|link| from_root(&folder.join(link))).collect();
    let mut wrong = String::new();
    for page in Page::all(&root()) {
        let page = from_root(&page.path);
        let times = listed.iter().filter(|listed| **listed == page).count();
        if page != SUMMARY && times != 1 {
            writeln!(wrong, "{page}: {times} times").unwrap();
        }
    }
    assert!(wrong.is_empty(), "pages that {SUMMARY} does not have once:\n{wrong}");
}

#[test]
fn the_reference_in_the_book_is_as_generated() {
    let summary = fs::read_to_string(root().join(SUMMARY)).unwrap();
    let mark = "\n# Reference\n\n";
    let (before, _) = summary.split_once(mark).expect("the part of the reference, the last one");
    let whole = format!("{before}{mark}{}", reference_list());
    compare(&BTreeMap::from([(SUMMARY.to_owned(), whole)]));
}

#[test]
fn commands_of_the_pages_exist() {
    let (mut manuals, mut wrong, mut count) = (Manuals::default(), String::new(), 0);
    for page in Page::all(&root()) {
        for block in page.blocks("sh") {
            for line in block.text.replace("\\\n", " ").lines() {
                count += usize::from(line.starts_with("lacuna "));
                if let Some(fault) = manuals.fault(line) {
                    let place = format!("{}:{}", page.path.display(), block.line);
                    writeln!(wrong, "{place}: {line}: {fault}").unwrap();
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert!(count >= 50, "{count} commands in the pages");
    for line in
        ["lacuna walk study.toml", "lacuna run study.toml --step 3", "lacuna campaign stop runs/a"]
    {
        assert!(manuals.fault(line).is_some(), "{line}");
    }
}

#[test]
fn the_tutorial_goes_as_it_says() {
    let mut walk = Walk::guide("docs/tutorial.md");
    for heading in ["A study and its data", "The calibration", "One change", "Something is missing"]
    {
        walk.follow(heading);
    }
}

#[test]
fn the_guide_to_finished_runs_goes_as_it_says() {
    let mut walk = Walk::guide("docs/my_runs.md");
    walk.follow("Files");
    walk.follow("The study");
}

#[test]
fn the_citation_has_the_version_of_the_program() {
    let citation = fs::read_to_string(root().join("CITATION.cff")).unwrap();
    let version = concat!("version: ", env!("CARGO_PKG_VERSION"));
    assert!(citation.lines().any(|line| line == version), "CITATION.cff lacks `{version}`");
}
