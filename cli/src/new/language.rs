//! Skeletons of plugins in other languages than Rust: a file of its own, loaded by a study.

use std::path::Path;

use lacuna::run::files;

use super::plugin::{refuse_known, section, wrong};
use super::skeleton::{Skeleton, misnamed, type_name};
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
    /// A library in one file of C++17, with the header.
    #[value(name = "c++", alias = "cpp")]
    Cpp,
}

macro_rules! skeletons {
    ($folder:literal $extension:literal: $($kind:literal)+) => {
        &[$(($kind, include_str!(concat!($folder, "/", $kind, ".", $extension)))),+]
    };
}

/// Skeletons of a language, by kind.
pub type Skeletons = &'static [(&'static str, &'static str)];

/// Skeletons in Python.
pub const IN_PYTHON: Skeletons = skeletons!("python" "py":
    "discrepancy" "effect" "model" "quantity" "reader" "sampler" "surrogate");

/// Skeletons in C.
pub const IN_C: Skeletons = skeletons!("c" "c":
    "design" "discrepancy" "effect" "model" "quantity" "reader" "sampler" "surrogate");

/// Skeletons in C++.
pub const IN_CPP: Skeletons = skeletons!("cpp" "cpp":
    "design" "discrepancy" "effect" "model" "quantity" "reader" "sampler" "surrogate");

const HEADER: &str = include_str!("../../../sdk/include/lacuna_plugin.h");

/// Writes a plugin into a file of the current folder.
pub fn write(kind: &str, name: &str, language: Language) -> anyhow::Result<()> {
    let fault = match language {
        // The code has the name in texts alone, so that it may be any word.
        Language::C | Language::Cpp => misnamed(name),
        Language::Python | Language::Rust => {
            Skeleton::of(kind).and_then(|skeleton| skeleton.fault(name))
        }
    };
    if let Some((text, help)) = fault {
        return Err(wrong(&text, help));
    }
    refuse_known(kind, name)?;
    match language {
        Language::C => {
            let file = format!("{name}.c");
            in_library(kind, name, &file, found(IN_C, kind, "C")?, "cc -std=c99", " -lm")
        }
        Language::Cpp => {
            let file = format!("{name}.cpp");
            in_library(kind, name, &file, found(IN_CPP, kind, "C++")?, "c++ -std=c++17", "")
        }
        Language::Python | Language::Rust => in_python(kind, name),
    }
}

/// The skeleton of a kind.
fn found(all: Skeletons, kind: &str, language: &str) -> anyhow::Result<&'static str> {
    all.iter().find(|(known, _)| *known == kind).map(|(_, text)| *text).ok_or_else(|| {
        let kinds: Vec<String> = all.iter().map(|(kind, _)| format!("`{kind}`")).collect();
        let text = format!("there is no skeleton of the kind `{kind}` in {language}");
        wrong(&text, &format!("the kinds are {}", kinds.join(", ")))
    })
}

/// A plugin in Python under another name.
pub fn python(text: &str, name: &str) -> String {
    text.replace("Skeleton", &type_name(name)).replace("skeleton", name)
}

fn in_python(kind: &str, name: &str) -> anyhow::Result<()> {
    let text = found(IN_PYTHON, kind, "Python")?;
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

/// A plugin that a compiler makes a library of.
fn in_library(
    kind: &str,
    name: &str,
    file: &str,
    text: &str,
    compiler: &str,
    libraries: &str,
) -> anyhow::Result<()> {
    create(Path::new(file), &text.replace("skeleton", name))?;
    let (header, library) = (Path::new("lacuna_plugin.h"), format!("lib{name}.so"));
    let beside = if header.exists() {
        ""
    } else {
        create(header, HEADER)?;
        " and lacuna_plugin.h"
    };
    let section = section(kind);
    print(&format!(
        "wrote {file}{beside}

It works as it stands. Next:
  1. replace its behaviour with your own; the descriptions in its schema are its manual
  2. {compiler} -O2 -fPIC -shared {file} -o {library}{libraries}
  3. lacuna plugins test {library}
  4. load it in a study: `load = [\"./{library}\"]` in `[plugins]`
  5. use it: `use = \"{name}\"` in `[{section}]`"
    ));
    Ok(())
}

fn create(file: &Path, text: &str) -> anyhow::Result<()> {
    if file.exists() {
        return Err(wrong(&format!("{} is there already", file.display()), "choose another name"));
    }
    Ok(files::write_atomic(file, text.as_bytes())?)
}
