//! Builds of libraries outside this workspace, with the crates that it has compiled.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use super::quick;

/// Folder of this test's profile, such as `target/debug`.
pub fn profile() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().to_owned()
}

/// File of a built library.
pub fn product(name: &str) -> PathBuf {
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    profile().join(format!("{prefix}{name}{suffix}"))
}

/// Runs cargo in the folder of a library and returns what it prints; a warning of the compiler is a failure.
pub fn cargo(verb: &str, folder: &Path) -> String {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut cargo = Command::new(cargo);
    cargo.args([verb, "--config", settings()]);
    cargo.arg("--target-dir").arg(profile().parent().unwrap()).current_dir(folder);
    if profile().ends_with("release") {
        cargo.arg("--release");
    }
    let output = cargo.output().unwrap();
    let [out, error] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let is_clean = output.status.success() && !error.contains(" generated ");
    assert!(is_clean, "cargo {verb} in {}\n{out}\n{error}", folder.display());
    out
}

/// File with the profile of all these libraries, so that they share compiled crates: that of the workspace, except that
/// Lacuna's crates are not optimised. Those cannot be shared with the workspace, whose paths they do not have, and the
/// interface must hold between such builds.
fn settings() -> &'static str {
    static PROFILE: OnceLock<String> = OnceLock::new();
    PROFILE.get_or_init(|| {
        let manifest = fs::read_to_string(quick::root().join("Cargo.toml")).unwrap();
        let mut manifest: toml::Table = manifest.parse().unwrap();
        let mut profile = manifest.remove("profile").unwrap();
        let packages = profile["dev"]["package"].as_table_mut().unwrap();
        for part in ["lacuna-base", "lacuna-api", "lacuna-abi", "lacuna-linalg"] {
            packages.insert(part.to_owned(), toml::Value::from(toml::toml! { opt-level = 0 }));
        }
        let all = toml::Table::from_iter([("profile".to_owned(), profile)]);
        let path = std::env::current_exe().unwrap().with_file_name("profile_of_libraries.toml");
        lacuna::run::files::write_atomic(&path, all.to_string().as_bytes()).unwrap();
        path.to_str().unwrap().to_owned()
    })
}

/// Features that the workspace requests of crates that a library has too. Where they differ, these crates and all that need
/// them are compiled once more.
const FEATURES: &str = r#"
[build-dependencies]
syn2 = { package = "syn", version = "2", features = ["extra-traits", "full"] }
syn3 = { package = "syn", version = "3", features = ["extra-traits", "full", "visit-mut"] }

[dependencies.bitflags]
version = "2"
features = ["std"]
[dependencies.num-complex]
version = "0.4"
[dependencies.num-traits]
version = "0.2"
[dependencies.once_cell]
version = "1"
[dependencies.serde_core]
version = "1"
"#;

/// The same for a library that uses the linear algebra.
const OF_LINEAR_ALGEBRA: &str = r#"
[dependencies.faer]
version = "0.24"
default-features = false
features = ["sparse-linalg"]
[dependencies.faer-traits]
version = "0.24"
"#;

/// Lets a library use the third-party crates that the workspace has compiled: their versions, and, unless
/// `LACUNA_SKELETONS` asks for the library as it is, their features.
pub fn share_crates(folder: &Path) {
    fs::copy(quick::root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    if std::env::var_os("LACUNA_SKELETONS").is_some() {
        return;
    }
    let path = folder.join("Cargo.toml");
    let mut manifest = fs::read_to_string(&path).unwrap();
    let more = if manifest.contains("linalg") { OF_LINEAR_ALGEBRA } else { "" };
    manifest.extend([FEATURES, more]);
    fs::write(path, manifest).unwrap();
}
