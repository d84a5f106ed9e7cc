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
    for plugin in kind.plugins() {
        let title = plugin.manual().map(|manual| manual.title).unwrap_or_default();
        print(&format!("  {:<28} {title}", plugin.name));
    }
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
