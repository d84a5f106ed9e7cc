//! Skeleton of a working plugin.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::fs;
use std::path::{Path, PathBuf};

use lacuna::plugin::registry;
use lacuna::run::files;

use super::skeleton::{ALL, Skeleton, kinds};
use super::{library, tree};
use crate::{misuse, print};

/// Writes a plugin into the source around the current folder, or into a library of its own.
pub fn write(
    kind: &str,
    name: &str,
    folder: Option<&Path>,
    source: Option<&Path>,
) -> anyhow::Result<()> {
    let skeleton = Skeleton::of(kind).ok_or_else(|| {
        let kinds = quoted(kinds());
        wrong(&format!("there is no kind `{kind}` of plugins"), &format!("the kinds are {kinds}"))
    })?;
    if let Some((text, help)) = skeleton.fault(name) {
        return Err(wrong(&text, help));
    }
    let here = std::env::current_dir().map_err(|error| wrong(&error.to_string(), ""))?;
    let tree = tree::around(&here);
    match (folder, &tree) {
        (Some(folder), _) => as_library(skeleton, name, folder, source.or(tree.as_deref())),
        (None, Some(tree)) => in_tree(skeleton, name, tree),
        (None, None) => {
            let text = format!("{} is not in Lacuna's source", here.display());
            let library = if skeleton.in_libraries {
                format!(
                    ", or make a library with `lacuna new plugin {kind} {name} --library {name}`"
                )
            } else {
                String::new()
            };
            Err(wrong(&text, &format!("run the command in a clone of it{library}")))
        }
    }
}

/// Absolute folder of the SDK: in the given source, or in that from which this program was built.
fn sdk(source: Option<&Path>) -> anyhow::Result<PathBuf> {
    let text = match source {
        Some(source) => format!("{} is not in Lacuna's source", source.display()),
        None => "Lacuna's source, which holds the SDK, is not found".to_owned(),
    };
    let found = tree::around(source.unwrap_or(Path::new(env!("CARGO_MANIFEST_DIR"))));
    let help = "name a clone of it with `--source FOLDER`";
    let sdk = found.ok_or_else(|| wrong(&text, help))?.join("sdk");
    Ok(sdk.canonicalize().map_err(|error| files::cannot_read(&sdk, &error))?)
}

pub(super) fn wrong(text: &str, help: &str) -> anyhow::Error {
    let help = if help.is_empty() { String::new() } else { format!("\nhelp: {help}") };
    misuse(format!("error: {text}{help}"))
}

fn quoted(names: Vec<&str>) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

fn in_tree(skeleton: &Skeleton, name: &str, tree: &Path) -> anyhow::Result<()> {
    let kind = skeleton.kind;
    refuse_known(kind, name)?;
    let folder = Path::new("plugins").join(skeleton.folder);
    let (file, list) = (folder.join(format!("{name}.rs")), folder.join("mod.rs"));
    for taken in [&file, &folder.join(name)] {
        if tree.join(taken).exists() {
            return Err(wrong(
                &format!("{} is there already", taken.display()),
                "choose another name",
            ));
        }
    }
    let listed = fs::read_to_string(tree.join(&list))
        .map_err(|error| files::cannot_read(&tree.join(&list), &error))?;
    let longer = tree::with_module(&listed, name).ok_or_else(|| {
        let text = format!("{} has no place for the module `{name}`", list.display());
        wrong(&text, "choose another name")
    })?;
    files::write_atomic(&tree.join(&file), skeleton.named(name).as_bytes())?;
    files::write_atomic(&tree.join(&list), longer.as_bytes())?;
    print(&format!(
        "wrote {file}, and its line in {list}

It works as it stands. Next:
  1. replace its behaviour with your own; its doc comments are its manual
  2. cargo fmt --all
  3. cargo test --workspace -- {name}
     cargo test --workspace --test contracts
  4. LACUNA_BLESS=1 cargo test -p lacuna-tests docs    writes docs/reference/{kind}.{name}.md
  5. use it in a study: `use = \"{name}\"` in `[{section}]`",
        file = file.display(),
        list = list.display(),
        section = section(kind),
    ));
    Ok(())
}

/// Rejects the name of an existing plugin.
pub(super) fn refuse_known(kind: &str, name: &str) -> anyhow::Result<()> {
    let known = registry::kinds().into_iter().find(|other| other.name == kind);
    if known.is_some_and(|kind| kind.plugins().iter().any(|plugin| plugin.name == name)) {
        return Err(wrong(&format!("there is a {kind} `{name}` already"), "choose another name"));
    }
    Ok(())
}

/// Section of a study that chooses a plugin of this kind.
pub(super) fn section(kind: &str) -> String {
    let known = registry::kinds().into_iter().find(|other| other.name == kind);
    known.and_then(|kind| kind.sections.last()).copied().unwrap_or(kind).to_owned()
}

fn as_library(
    skeleton: &Skeleton,
    name: &str,
    folder: &Path,
    tree: Option<&Path>,
) -> anyhow::Result<()> {
    let kind = skeleton.kind;
    if !skeleton.in_libraries {
        let kinds = ALL.iter().filter(|other| other.in_libraries).map(|other| other.kind);
        let kinds = quoted(kinds.collect());
        let text = format!("a library cannot bring plugins of the kind `{kind}`");
        let help = format!("it can bring {kinds}; this one has to be in Lacuna's source");
        return Err(wrong(&text, &help));
    }
    refuse_known(kind, name)?;
    if folder.exists() {
        return Err(wrong(
            &format!("{} is there already", folder.display()),
            "choose another folder",
        ));
    }
    let source = library::source(skeleton, name);
    let manifest = library::manifest(name, &source, &sdk(tree)?);
    files::write_atomic(&folder.join("Cargo.toml"), manifest.as_bytes())?;
    files::write_atomic(&folder.join("src/lib.rs"), source.as_bytes())?;
    let built = PathBuf::from("target/release").join(format!("{DLL_PREFIX}{name}{DLL_SUFFIX}"));
    print(&format!(
        "wrote {folder}/Cargo.toml and {folder}/src/lib.rs

It works as it stands. Next, in {folder}:
  1. replace its behaviour with your own; its doc comments are its manual
  2. cargo test
  3. cargo build --release
  4. load it in a study: `load = [\"{folder}/{built}\"]` in `[plugins]`
  5. use it: `use = \"{name}\"` in `[{section}]`",
        folder = folder.display(),
        built = built.display(),
        section = section(kind),
    ));
    Ok(())
}
