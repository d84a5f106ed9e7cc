//! `plugins` and `schema`.

use lacuna::plugin::registry::{self, KindEntry, Listing};
use lacuna::study::language;
use lacuna::study::nearest::{nearest, one_of};

use crate::{Failure, print};

/// `lacuna plugins [KIND[.NAME]]`
pub fn list(name: Option<&str>, markdown: bool) -> Result<(), Failure> {
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
        let first = lines.first().map_or("", String::as_str);
        print(&format!("  {:<1$}{first}", plugin.name, COLUMN - 2));
        for line in lines.iter().skip(1) {
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
}

/// `lacuna schema`
#[expect(clippy::unnecessary_wraps, reason = "every verb has the same shape")]
pub fn schema() -> Result<(), Failure> {
    print(&format!("{:#}", language::schema()));
    Ok(())
}
