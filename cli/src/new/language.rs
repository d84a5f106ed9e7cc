//! Skeletons of plugins in other languages than Rust: a file of its own, loaded by a study.

use std::path::Path;

use lacuna::run::files;

use super::plugin::{refuse_known, section, wrong};
use super::skeleton::{Skeleton, type_name};
use crate::print;

/// Language of a skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Language {
    /// In Lacuna's source or, with `--library`, as a crate of its own.
    Rust,
    /// A class in a file of its own.
    Python,
    /// A library in one file of C99, with the header.
    C,
}

/// Skeletons in Python, by kind.
pub const IN_PYTHON: [(&str, &str); 7] = [
    ("discrepancy", include_str!("python/discrepancy.py")),
    ("effect", include_str!("python/effect.py")),
    ("model", include_str!("python/model.py")),
    ("quantity", include_str!("python/quantity.py")),
    ("reader", include_str!("python/reader.py")),
    ("sampler", include_str!("python/sampler.py")),
    ("surrogate", include_str!("python/surrogate.py")),
];

/// Examples in C by kind, each with its name.
const IN_C: [(&str, &str, &str); 2] = [
    ("discrepancy", "plain_gaussian", include_str!("../../../examples/plugin_c/plain_gaussian.c")),
    ("model", "rod", include_str!("../../../examples/plugin_c/rod.c")),
];
const HEADER: &str = include_str!("../../../sdk/include/lacuna_plugin.h");

/// Writes a plugin into a file of the current folder.
pub fn write(kind: &str, name: &str, language: Language) -> anyhow::Result<()> {
    if let Some((text, help)) = Skeleton::of(kind).and_then(|skeleton| skeleton.fault(name)) {
        return Err(wrong(&text, help));
    }
    refuse_known(kind, name)?;
    match language {
        Language::C => in_c(kind, name),
        Language::Python | Language::Rust => in_python(kind, name),
    }
}

/// A plugin in Python under another name.
pub fn python(text: &str, name: &str) -> String {
    text.replace("Skeleton", &type_name(name)).replace("skeleton", name)
}

fn in_python(kind: &str, name: &str) -> anyhow::Result<()> {
    let kinds = IN_PYTHON.iter().map(|(kind, _)| *kind);
    let Some((_, text)) = IN_PYTHON.iter().find(|(known, _)| *known == kind) else {
        return Err(missing(kind, "Python", kinds));
    };
    let file = format!("{name}.py");
    create(Path::new(&file), &python(text, name))?;
    let section = section(kind);
    print(&format!(
        "wrote {file}

It works as it stands. Next:
  1. replace its behaviour with your own; the docstring of the class is its manual
  2. lacuna plugins test {file}
  3. load it in a study: `python = \"{file}\"` in `[plugins]`
  4. use it: `use = \"{name}\"` in `[{section}]`"
    ));
    Ok(())
}

fn in_c(kind: &str, name: &str) -> anyhow::Result<()> {
    let kinds = IN_C.iter().map(|(kind, ..)| *kind);
    let Some((_, example, text)) = IN_C.iter().find(|(known, ..)| *known == kind) else {
        return Err(missing(kind, "C", kinds));
    };
    let (file, library) = (format!("{name}.c"), format!("lib{name}.so"));
    create(Path::new(&file), &text.replace(&format!("\"{example}\""), &format!("\"{name}\"")))?;
    let header = Path::new("lacuna_plugin.h");
    if !header.exists() {
        create(header, HEADER)?;
    }
    let section = section(kind);
    print(&format!(
        "wrote {file} and lacuna_plugin.h

It works as it stands: the example `{example}`. Next:
  1. replace its behaviour with your own
  2. cc -std=c99 -O2 -fPIC -shared {file} -o {library} -lm
  3. lacuna plugins test {library}
  4. load it in a study: `load = [\"./{library}\"]` in `[plugins]`
  5. use it: `use = \"{name}\"` in `[{section}]`"
    ));
    Ok(())
}

fn missing<'a>(kind: &str, language: &str, kinds: impl Iterator<Item = &'a str>) -> anyhow::Error {
    let kinds: Vec<String> = kinds.map(|kind| format!("`{kind}`")).collect();
    let text = format!("there is no skeleton of the kind `{kind}` in {language}");
    wrong(&text, &format!("the kinds are {}", kinds.join(", ")))
}

fn create(file: &Path, text: &str) -> anyhow::Result<()> {
    if file.exists() {
        return Err(wrong(&format!("{} is there already", file.display()), "choose another name"));
    }
    Ok(files::write_atomic(file, text.as_bytes())?)
}
