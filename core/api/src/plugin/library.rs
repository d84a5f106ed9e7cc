//! Description of a library of plugins.

use std::path::PathBuf;

/// A loaded library of plugins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Library {
    /// Path of the library.
    pub path: PathBuf,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Name that the library declares.
    pub name: String,
    /// Version that the library declares.
    pub version: String,
    /// Name and version of the development kit that built the library.
    pub sdk: String,
    /// Version of the plugin interface for which it was built, as (major, minor).
    pub abi: (u32, u32),
    /// Kind and name of each of its plugins.
    pub plugins: Vec<(String, String)>,
}

impl Library {
    /// File name of the library.
    pub fn file(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}
