//! Commands quoted in the documentation are valid commands of this program.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use clap::{CommandFactory as _, Parser as _};

use crate::Arguments;

/// All pages of the documentation.
fn pages() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut folders = vec![root.clone(), root.join("docs"), root.join("docs/reference")];
    for cases in ["configs", "examples"] {
        let cases = fs::read_dir(root.join(cases)).unwrap();
        folders.extend(cases.map(|case| case.unwrap().path()).filter(|path| path.is_dir()));
    }
    let files = folders.iter().flat_map(|folder| fs::read_dir(folder).unwrap());
    let mut pages: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    pages.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    pages
}

/// The commands on a line: text that begins with `lacuna` on a line of its own or between backticks, and `cargo run`
/// commands.
fn commands(line: &str) -> Vec<String> {
    const CARGO: &str = "-p lacuna-cli -- ";
    let line = line.split(" # ").next().unwrap_or(line);
    if let Some((_, rest)) = line.split_once(CARGO) {
        return vec![rest.split('`').next().unwrap_or(rest).to_owned()];
    }
    let quoted = line.split('`').skip(1).step_by(2);
    let all = std::iter::once(line).chain(quoted);
    all.filter_map(|text| text.strip_prefix("lacuna ")).map(str::to_owned).collect()
}

/// Splits a command into words, as a shell does.
fn words(command: &str) -> Vec<String> {
    let (mut words, mut quote) = (vec![String::new()], None);
    for c in command.chars() {
        match (quote, c) {
            (None, '\'' | '"') => quote = Some(c),
            (Some(open), c) if c == open => quote = None,
            (None, c) if c.is_whitespace() => words.push(String::new()),
            (_, c) => words.last_mut().unwrap().push(c),
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[test]
fn quoted_commands_are_understood() {
    let (mut found, mut refused) = (0, Vec::new());
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap().replace("\\\n", " ");
        for command in text.lines().flat_map(commands) {
            let words = std::iter::once("lacuna".to_owned()).chain(words(&command));
            let parsed = Arguments::try_parse_from(words);
            if let Err(error) = parsed {
                refused.push(format!("{}: `lacuna {command}`: {error}", page.display()));
            }
            found += 1;
        }
    }
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    assert!(found > 20, "{found} commands");
}

#[test]
fn every_verb_stands_in_the_readme() {
    let readme = concat!(env!("CARGO_MANIFEST_DIR"), "/../README.md");
    let readme = fs::read_to_string(readme).unwrap();
    for verb in Arguments::command().get_subcommands() {
        let verb = verb.get_name();
        assert!(readme.contains(&format!("| `lacuna {verb}")), "`{verb}` is not in README.md");
    }
}

#[test]
fn arguments_are_sound() {
    Arguments::command().debug_assert();
}
