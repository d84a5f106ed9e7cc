//! Files that are written either completely or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, IntoInnerError, Read, Write};
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::Stop;

/// Writes a file so that a reader, or a later run, sees either the old content or the complete new one: temporary file
/// in the same folder, flushed to disk, renamed.
///
/// # Errors
/// If the file cannot be written; the temporary file is removed.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), Stop> {
    write_atomic_with(path, |file| file.write_all(bytes))
}

/// Like [`write_atomic`], with a file that `write` fills: for contents that need not be in memory as a whole.
pub fn write_atomic_with(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), Stop> {
    let write = || -> io::Result<()> {
        let folder = path.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let temporary = folder.join(format!(".{name}.part"));
        let result = File::create(&temporary).and_then(|file| {
            let mut file = BufWriter::new(file);
            write(&mut file)?;
            file.into_inner().map_err(IntoInnerError::into_error)?.sync_all()
        });
        if let Err(error) = result {
            // The incomplete file is removed on a best-effort basis; the error worth reporting is the first one.
            let _ = fs::remove_file(&temporary);
            return Err(error);
        }
        fs::rename(&temporary, path)
    };
    write().map_err(|error| cannot_write(path, &error))
}

/// Like [`write_atomic_with`]; returns the SHA-256 of the file, in hexadecimal, which another thread computes while pieces
/// are written.
pub fn write_atomic_hashed(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<String, Stop> {
    let mut hasher = Sha256::new();
    write_atomic_with(path, |file| write(&mut Hashing { file, hasher: &mut hasher }))?;
    Ok(in_hexadecimal(hasher.finalize().as_slice()))
}

/// A file and the hash of what is written to it.
struct Hashing<'a> {
    file: &'a mut BufWriter<File>,
    hasher: &'a mut Sha256,
}

impl Write for Hashing<'_> {
    fn write(&mut self, piece: &[u8]) -> io::Result<usize> {
        let (file, hasher) = (&mut *self.file, &mut *self.hasher);
        rayon::join(|| file.write_all(piece), || hasher.update(piece)).0?;
        Ok(piece.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// The error for a file that cannot be written.
pub fn cannot_write(path: &Path, error: &io::Error) -> Stop {
    let stop = Stop::new(format!("cannot write {}: {}", path.display(), in_words(error)));
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            stop.help("free some space and run the same command again: finished work is kept")
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            stop.help("choose a folder that you may write to with `--out DIR`")
        }
        _ => stop,
    }
}

/// The error for a file that cannot be read.
pub fn cannot_read(path: &Path, error: &io::Error) -> Stop {
    Stop::new(format!("cannot read {}: {}", path.display(), in_words(error)))
}

/// Message of an error of the operating system, without its number.
pub fn in_words(error: &io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or(&text);
    let mut letters = text.chars();
    letters
        .next()
        .map_or(String::new(), |first| first.to_lowercase().collect::<String>() + letters.as_str())
}

/// Reads a complete file.
pub fn read(path: &Path) -> Result<Vec<u8>, Stop> {
    fs::read(path).map_err(|error| cannot_read(path, &error))
}

/// Writes a value as indented JSON, atomically.
pub fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), Stop> {
    let mut text = serde_json::to_string_pretty(value)
        .map_err(|error| Stop::new(format!("cannot write {}: {error}", path.display())))?;
    text.push('\n');
    write_atomic(path, text.as_bytes())
}

/// Reads a value from a JSON file.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, Stop> {
    serde_json::from_slice(&read(path)?)
        .map_err(|error| Stop::new(format!("cannot read {}: {error}", path.display())))
}

/// Writes a value as TOML, atomically; unlike JSON, TOML can represent numbers that are not finite.
pub fn write_toml<T: Serialize>(path: &Path, value: &T) -> Result<(), Stop> {
    let text = toml::to_string(value)
        .map_err(|error| Stop::new(format!("cannot write {}: {error}", path.display())))?;
    write_atomic(path, text.as_bytes())
}

/// Reads a value from a TOML file.
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, Stop> {
    toml::from_slice(&read(path)?)
        .map_err(|error| Stop::new(format!("cannot read {}: {error}", path.display())))
}

/// SHA-256 of bytes, in hexadecimal.
pub fn hash(bytes: &[u8]) -> String {
    in_hexadecimal(Sha256::digest(bytes).as_slice())
}

/// SHA-256 of bytes that follow each other, in hexadecimal.
pub fn hash_parts<const N: usize>(parts: [&[u8]; N]) -> String {
    let mut hasher = Sha256::new();
    for part in parts {
        hasher.update(part);
    }
    in_hexadecimal(hasher.finalize().as_slice())
}

/// SHA-256 of a text and of arrays of numbers, in hexadecimal; the text states the sizes of the arrays.
pub fn hash_numbers(text: &str, arrays: &[&[f64]]) -> String {
    let mut hasher = Sha256::new();
    hasher.update(text.as_bytes());
    hashed(hasher, arrays.iter().copied().flatten().copied())
}

/// SHA-256 of numbers, in hexadecimal.
pub fn hash_of(numbers: impl Iterator<Item = f64>) -> String {
    hashed(Sha256::new(), numbers)
}

fn hashed(mut hasher: Sha256, numbers: impl Iterator<Item = f64>) -> String {
    numbers.for_each(|number| hasher.update(number.to_le_bytes()));
    in_hexadecimal(hasher.finalize().as_slice())
}

/// SHA-256 of a file, in hexadecimal.
pub fn hash_file(path: &Path) -> Result<String, Stop> {
    let digest = || -> io::Result<String> {
        let mut file = File::open(path)?;
        let mut hasher = Sha256::new();
        let mut buffer = vec![0; 1 << 16];
        loop {
            match file.read(&mut buffer)? {
                0 => return Ok(in_hexadecimal(hasher.finalize().as_slice())),
                n => hasher.update(&buffer[..n]),
            }
        }
    };
    digest().map_err(|error| cannot_read(path, &error))
}

/// SHA-256 over names and contents of files, and of the files directly inside folders.
pub fn hash_sources(paths: &[std::path::PathBuf]) -> Result<String, Stop> {
    let mut lines = String::new();
    for path in paths {
        let files = if path.is_dir() { folder_files(path)? } else { vec![path.clone()] };
        for file in files {
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            lines.push_str(&format!("{} {name}\n", hash_file(&file)?));
        }
    }
    Ok(hash(lines.as_bytes()))
}

fn folder_files(folder: &Path) -> Result<Vec<std::path::PathBuf>, Stop> {
    let list = || -> io::Result<Vec<std::path::PathBuf>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_file() {
                files.push(path);
            }
        }
        files.sort();
        Ok(files)
    };
    list().map_err(|error| cannot_read(folder, &error))
}

fn in_hexadecimal(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hash_is_the_published_one() {
        // FIPS 180-4 example: SHA-256 of "abc".
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(hash(b"abc"), expected);
        assert_eq!(hash_parts([b"a", b"", b"bc"]), expected);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in_pieces");
        let pieces = |to: &mut dyn Write| {
            to.write_all(b"ab")?;
            to.write_all(b"c")
        };
        assert_eq!(write_atomic_hashed(&path, pieces).unwrap(), expected);
        assert_eq!(read(&path).unwrap(), b"abc");
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        write_json(&path, &[1, 2]).unwrap();
        fs::create_dir(folder.path().join(".a.json.part")).unwrap();
        assert!(write_json(&path, &[3]).is_err());
        assert_eq!(read_json::<Vec<i32>>(&path).unwrap(), [1, 2]);
    }

    #[test]
    fn messages_say_what_and_where() {
        let error = read(Path::new("/nowhere/x.json")).unwrap_err();
        assert_eq!(error.message, "cannot read /nowhere/x.json: no such file or directory");
    }
}
