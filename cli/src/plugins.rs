//! Commands `plugins` and `schema`.

mod test;

use std::path::PathBuf;

use lacuna::plugin::Library;
use lacuna::plugin::registry::{self, KindEntry, Listing};
use lacuna::text::nearest::{nearest, one_of};
use lacuna_engine::host::library;
use lacuna_engine::study::language;
use lacuna_engine::study::libraries::Seen;

use crate::{misuse, print};

/// Libraries of plugins named on the command line.
#[derive(Default, clap::Args)]
pub struct Libraries {
    /// Load a library of plugins, or a Python file, in addition to those of the study; this executes its code; may be repeated
    #[arg(long = "plugin", value_name = "PATH")]
    pub files: Vec<PathBuf>,
}

/// A deed of `lacuna plugins` besides listing.
#[derive(clap::Subcommand)]
pub enum Deed {
    /// Test the plugins of a library or a Python file against the contracts of their kinds
    Test(test::Test),
}

/// Runs `lacuna plugins DEED`.
pub fn act(deed: &Deed) -> anyhow::Result<()> {
    match deed {
        Deed::Test(asked) => test::run(asked),
    }
}

/// Runs `lacuna plugins [KIND[.NAME]]`.
pub fn list(name: Option<&str>, markdown: bool, libraries: &Libraries) -> anyhow::Result<()> {
    load(libraries)?;
    if let Some(problem) = registry::audit().first() {
        return Err(misuse(format!("error: {}", problem.message)));
    }
    let kinds = registry::kinds();
    match name.map(|name| name.split_once('.').map_or((name, None), |(k, n)| (k, Some(n)))) {
        None => kinds.iter().for_each(|kind| overview(kind)),
        Some((kind, None)) => overview(find_kind(&kinds, kind)?),
        Some((kind, Some(name))) => {
            let kind = find_kind(&kinds, kind)?;
            let plugins = kind.plugins();
            let listing = plugins.iter().find(|p| p.name == name).ok_or_else(|| {
                let names = || plugins.iter().map(|p| p.name);
                unknown(kind.name, name, nearest(name, names()), &one_of(names()))
            })?;
            manual(listing, markdown);
        }
    }
    Ok(())
}

fn find_kind<'a>(kinds: &[&'a KindEntry], name: &str) -> anyhow::Result<&'a KindEntry> {
    let names = || kinds.iter().map(|kind| kind.name);
    let found = kinds.iter().find(|kind| kind.name == name).copied();
    found.ok_or_else(|| unknown("kind", name, nearest(name, names()), &one_of(names())))
}

fn unknown(what: &str, name: &str, near: Option<&str>, known: &str) -> anyhow::Error {
    let help = near.map_or(String::new(), |near| format!("\nhelp: did you mean `{near}`?"));
    misuse(format!("error: there is no {what} `{name}`: expected {known}{help}"))
}

/// Prints a kind with one line per plugin.
fn overview(kind: &KindEntry) {
    let sections: Vec<String> = kind.sections.iter().map(|s| format!("[{s}]")).collect();
    print(&format!("{}  {}", kind.name, sections.join(" ")));
    let plugins = kind.plugins();
    if plugins.is_empty() {
        print("  none is installed");
    }
    for plugin in plugins {
        let title = plugin.manual().map(|manual| manual.title).unwrap_or_default();
        for line in entry(plugin.name, &title, plugin.library.map(origin).as_deref()) {
            print(&line);
        }
    }
}

/// Lines of one plugin: the name, and beside it (below it, if the name is too long) title and origin.
fn entry(name: &str, title: &str, origin: Option<&str>) -> Vec<String> {
    let texts = [Some(title), origin].into_iter().flatten();
    let mut lines: Vec<String> = texts
        .flat_map(|text| wrapped(text, LINE - COLUMN))
        .map(|line| format!("{:COLUMN$}{line}", ""))
        .collect();
    let name = format!("  {name}");
    match lines.first_mut() {
        Some(first) if name.chars().count() < COLUMN => {
            *first = format!("{name:<COLUMN$}{}", first.trim_start());
        }
        _ => lines.insert(0, name),
    }
    lines
}

/// Longest line of the list, in characters, and start of its second column.
const LINE: usize = 100;
const COLUMN: usize = 30;

/// Wraps words to lines of at most `width` characters.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn manual(listing: &Listing, markdown: bool) {
    if let Some(manual) = listing.manual() {
        print(if markdown { manual.markdown() } else { manual.plain() }.trim_end());
    }
    if let Some(library) = listing.library {
        print(&format!("\n{}", origin(library)));
    }
}

/// Origin of a plugin that is not built in.
fn origin(library: &Library) -> String {
    let Library { path, sha256, name, version, abi, .. } = library;
    let path = path.display();
    match abi {
        Some((major, minor)) => {
            format!("from {path} ({name} {version}, abi {major}.{minor}, sha256 {sha256})")
        }
        None => format!("from {path} (Python, sha256 {sha256})"),
    }
}

/// Loads the libraries named on the command line.
pub fn load(libraries: &Libraries) -> anyhow::Result<()> {
    for path in &libraries.files {
        library::load(path, None).map_err(|reason| {
            let path = path.display();
            misuse(format!("error: the library of plugins {path} cannot be used: {reason}"))
        })?;
    }
    Ok(())
}

/// The libraries that a study would load, as its file lists them.
pub fn would_load(seen: &Seen) -> String {
    let path = seen.path.display();
    let sha256 = &seen.sha256;
    match &seen.record {
        None => format!("would load {path}: it says nothing of itself; sha256 {sha256}"),
        Some(record) => {
            let plugins: Vec<String> =
                record.plugins.iter().map(|(kind, name)| format!("{kind} `{name}`")).collect();
            let of = record.abi.map_or("Python".to_owned(), |(a, b)| format!("abi {a}.{b}"));
            format!(
                "would load {path}: {}, {of}, sha256 {sha256}; options are checked when it is loaded",
                plugins.join(", ")
            )
        }
    }
}

/// A file that a JSON Schema describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Described {
    /// A study, with the options of all installed plugins.
    Study,
    /// `summary.json` of a run.
    Summary,
}

/// Runs `lacuna schema [study|summary]`.
pub fn schema(of: Described, libraries: &Libraries) -> anyhow::Result<()> {
    load(libraries)?;
    let schema = match of {
        Described::Study => language::schema_text(),
        Described::Summary => format!("{:#}", lacuna_engine::report::schema()),
    };
    print(schema.trim_end());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::entry;

    #[test]
    fn a_name_that_is_too_long_stands_on_a_line_of_its_own() {
        assert_eq!(entry("gain", "A gain.", None), [format!("  gain{:24}A gain.", "")]);
        let long = "a".repeat(28);
        let beside = format!("{:30}A gain.", "");
        assert_eq!(entry(&long, "A gain.", None), [format!("  {long}"), beside]);
        assert_eq!(entry("bare", "", None), ["  bare"]);
    }
}
