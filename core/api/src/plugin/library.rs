//! Description of a library of plugins.

use std::path::PathBuf;

/// A loaded file of plugins: a library, or a Python file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Library {
    /// Path of the file.
    pub path: PathBuf,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Name that the library declares; of a Python file, its name without the extension.
    pub name: String,
    /// Version that the library declares; of a Python file, that of this program.
    pub version: String,
    /// Name and version of the development kit that built the library; empty for a Python file.
    pub sdk: String,
    /// Version of the plugin interface for which it was built, as (major, minor); `None` for a Python file.
    pub abi: Option<(u32, u32)>,
    /// Kind and name of each of its plugins.
    pub plugins: Vec<(String, String)>,
}

impl Library {
    /// File name of the library.
    pub fn file(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}
