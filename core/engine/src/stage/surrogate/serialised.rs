//! An emulator in its serialised form.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};

/// Number of bytes from which on a form is not held beside the emulator that was made of it.
const LARGE: usize = 1 << 26;

/// The serialised form of an emulator.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Serialised {
    /// Bytes in memory.
    Held(Vec<u8>),
    /// Bytes in this file.
    InFile(PathBuf),
}

impl Serialised {
    /// The bytes.
    ///
    /// # Errors
    /// If their file cannot be read.
    pub fn bytes(&self) -> Result<Cow<'_, [u8]>, Stop> {
        Ok(match self {
            Self::Held(bytes) => Cow::Borrowed(bytes),
            Self::InFile(path) => Cow::Owned(files::read(path)?),
        })
    }

    /// The same form, a large one without its bytes, which are in this file too.
    #[must_use]
    pub fn kept_in(self, file: &Path) -> Self {
        match self {
            Self::Held(bytes) if bytes.len() >= LARGE => Self::InFile(file.to_path_buf()),
            small => small,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn large_forms_are_read_from_their_file_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("emulator.bin");
        let large: Vec<u8> = (0..LARGE).map(|i| (i % 251) as u8).collect();
        std::fs::write(&file, &large).unwrap();
        let kept = Serialised::Held(large.clone()).kept_in(&file);
        assert_eq!(kept, Serialised::InFile(file.clone()));
        assert!(kept.bytes().unwrap() == large);
        let small = Serialised::Held(vec![1, 2, 3]).kept_in(&file);
        assert_eq!(&*small.bytes().unwrap(), [1, 2, 3]);
        std::fs::remove_file(&file).unwrap();
        assert!(kept.bytes().unwrap_err().to_string().contains("emulator.bin"));
    }
}
