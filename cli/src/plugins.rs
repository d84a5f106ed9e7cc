//! `plugins` and `schema`.

use lacuna::plugin::abi::library::{self, Library};
use lacuna::plugin::registry::{self, KindEntry, Listing};
use lacuna::study::language;
use lacuna::study::libraries::Seen;
use lacuna::study::nearest::{nearest, one_of};

use crate::study::Libraries;
use crate::{Failure, print};

/// `lacuna plugins [KIND[.NAME]]`
pub fn list(name: Option<&str>, markdown: bool, libraries: &Libraries) -> Result<(), Failure> {
    load(libraries)?;
    if let Some(problem) = registry::audit().first() {
        return Err(Failure::wrong(format!("error: {}", problem.message)));
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

fn find_kind<'a>(kinds: &[&'a KindEntry], name: &str) -> Result<&'a KindEntry, Failure> {
    let names = || kinds.iter().map(|kind| kind.name);
    let found = kinds.iter().find(|kind| kind.name == name).copied();
    found.ok_or_else(|| unknown("kind", name, nearest(name, names()), &one_of(names())))
}

fn unknown(what: &str, name: &str, near: Option<&str>, known: &str) -> Failure {
    let help = near.map_or(String::new(), |near| format!("\nhelp: did you mean `{near}`?"));
    Failure::wrong(format!("error: there is no {what} `{name}`: expected {known}{help}"))
}

/// A kind with one line a plugin.
fn overview(kind: &KindEntry) {
    let sections: Vec<String> = kind.sections.iter().map(|s| format!("[{s}]")).collect();
    print(&format!("{}  {}", kind.name, sections.join(" ")));
    let plugins = kind.plugins();
    if plugins.is_empty() {
        print("  none is installed");
    }
    for plugin in plugins {
        let title = plugin.manual().map(|manual| manual.title).unwrap_or_default();
        let lines = wrapped(&title, LINE - COLUMN);
        let first = lines.first().cloned().unwrap_or_default();
        print(&format!("  {:<1$}{first}", plugin.name, COLUMN - 2));
        let library = plugin.library.map(origin);
        let origin = library.iter().flat_map(|origin| wrapped(origin, LINE - COLUMN));
        for line in lines.into_iter().skip(1).chain(origin) {
            print(&format!("{:COLUMN$}{line}", ""));
        }
    }
}

/// The longest line of the list, and where the second column begins.
const LINE: usize = 100;
const COLUMN: usize = 30;

/// Words on lines of at most `width` characters.
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

/// Where a plugin comes from that is no part of the program.
fn origin(library: &Library) -> String {
    let Library { path, sha256, name, version, abi: (major, minor), .. } = library;
    format!("from {} ({name} {version}, abi {major}.{minor}, sha256 {sha256})", path.display())
}

/// Loads the libraries that the command line names.
pub fn load(libraries: &Libraries) -> Result<(), Failure> {
    for path in &libraries.files {
        library::load(path, None).map_err(|reason| {
            let path = path.display();
            Failure::wrong(format!("error: the library of plugins {path} cannot be used: {reason}"))
        })?;
    }
    Ok(())
}

/// What a study would load, as its file shows it.
pub fn would_load(seen: &Seen) -> String {
    let path = seen.path.display();
    let sha256 = &seen.sha256;
    match &seen.record {
        None => format!("would load {path}: it says nothing of itself; sha256 {sha256}"),
        Some(record) => {
            let (major, minor) = record.abi;
            let plugins: Vec<String> =
                record.plugins.iter().map(|(kind, name)| format!("{kind} `{name}`")).collect();
            format!(
                "would load {path}: {}, abi {major}.{minor}, sha256 {sha256}; options are checked when it is loaded",
                plugins.join(", ")
            )
        }
    }
}

/// `lacuna schema`
pub fn schema(libraries: &Libraries) -> Result<(), Failure> {
    load(libraries)?;
    print(&format!("{:#}", language::schema()));
    Ok(())
}
