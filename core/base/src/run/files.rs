//! Files that are written either completely or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, IntoInnerError, Read, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::Stop;

/// Writes a file so that a reader, or a later run, sees either the old content or the complete new one: temporary file
/// in the same folder, flushed to disk, renamed. A symbolic link of this name is replaced, so that nothing outside a run
/// directory is written through it; [`write_named`] is for files that a user names.
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
    replace(path, write).map_err(|error| cannot_write(path, &error))
}

fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let temporary = folder.join(format!(".{name}.part"));
    let result = File::create(&temporary).and_then(|file| {
        let mut file = BufWriter::new(file);
        write(&mut file)?;
        file.into_inner().map_err(IntoInnerError::into_error)?.sync_all()?;
        fs::rename(&temporary, path)
    });
    if result.is_err() {
        // The incomplete file is removed on a best-effort basis; the error worth reporting is the first one.
        let _ = fs::remove_file(&temporary);
    }
    result
}

/// Writes a file that a user names. Symbolic links are followed: what they lead to is written as by [`write_atomic`], beside
/// itself. Where something exists that is no regular file, such as a device or a FIFO, the bytes are written into it.
///
/// # Errors
/// If the file cannot be written.
pub fn write_named(path: &Path, bytes: &[u8]) -> Result<(), Stop> {
    write_named_with(path, |file| file.write_all(bytes))
}

/// Like [`write_named`], with a file that `write` fills.
pub fn write_named_with(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), Stop> {
    let written = match destination(path) {
        Ok(Destination::File(file)) => replace(&file, write),
        Ok(Destination::Stream) => into_stream(path, write),
        Err(error) => Err(error),
    };
    written.map_err(|error| cannot_write(path, &error))
}

/// Kind of place to which a path of a user leads.
enum Destination {
    /// A regular file, or none so far, without links.
    File(PathBuf),
    /// Something that is written straight into: a device, a FIFO, an open file of this process.
    Stream,
}

/// Largest number of symbolic links that lead to a file, as Linux has it.
const LINKS: usize = 40;

fn destination(path: &Path) -> io::Result<Destination> {
    // A folder is left to the renaming, which refuses it.
    if fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return Ok(Destination::Stream);
    }
    let mut place = path.to_owned();
    for _ in 0..LINKS {
        // The links of open files, such as that of `/dev/stdout`, do not lead to names that can be replaced.
        if ["/dev/fd", "/proc"].iter().any(|folder| place.starts_with(folder)) {
            return Ok(Destination::Stream);
        }
        let Ok(target) = fs::read_link(&place) else { return Ok(Destination::File(place)) };
        place = place.parent().map_or_else(|| target.clone(), |folder| folder.join(&target));
    }
    Err(io::Error::other("too many symbolic links"))
}

/// Writes into what exists. It is not waited for a disk, which a device or FIFO need not have.
fn into_stream(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut file = BufWriter::new(OpenOptions::new().write(true).truncate(true).open(path)?);
    write(&mut file)?;
    file.flush()
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
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => stop.help(
            "choose a folder that you may write to, where the command takes one with `--out DIR`",
        ),
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
pub fn hash_sources(paths: &[PathBuf]) -> Result<String, Stop> {
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

fn folder_files(folder: &Path) -> Result<Vec<PathBuf>, Stop> {
    let list = || -> io::Result<Vec<PathBuf>> {
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
    fn a_file_takes_the_place_of_no_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::create_dir(&path).unwrap();
        assert!(write_atomic(&path, b"x").is_err() && write_named(&path, b"x").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_for_a_user_and_replaced_in_a_run_directory() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("far")).unwrap();
        fs::write(at("far/target"), "old").unwrap();
        symlink("far/target", at("link")).unwrap();
        symlink(at("link"), at("far/second")).unwrap();
        symlink("far/none", at("dangling")).unwrap();
        symlink("loop", at("loop")).unwrap();
        for (path, target) in
            [("far/second", "far/target"), ("dangling", "far/none"), ("plain", "plain")]
        {
            write_named(&at(path), path.as_bytes()).unwrap();
            assert_eq!(fs::read(at(target)).unwrap(), path.as_bytes());
        }
        for link in ["link", "far/second", "dangling"] {
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
        }
        let error = write_named(&at("loop"), b"x").unwrap_err();
        assert!(error.message.ends_with("loop: too many symbolic links"), "{}", error.message);
        write_atomic(&at("link"), b"own").unwrap();
        assert!(!fs::symlink_metadata(at("link")).unwrap().is_symlink());
        assert_eq!(fs::read(at("far/target")).unwrap(), b"far/second");
    }

    #[cfg(unix)]
    #[test]
    fn a_fifo_is_written_into() {
        use std::os::unix::fs::{FileTypeExt as _, symlink};
        let folder = tempfile::tempdir().unwrap();
        let [fifo, link] = ["fifo", "link"].map(|name| folder.path().join(name));
        let made = std::process::Command::new("mkfifo").arg(&fifo).status().unwrap();
        assert!(made.success());
        symlink("fifo", &link).unwrap();
        for path in [&fifo, &link] {
            let reading = std::thread::spawn({
                let fifo = fifo.clone();
                move || fs::read(fifo).unwrap()
            });
            write_named(path, b"1,2\n").unwrap();
            assert_eq!(reading.join().unwrap(), b"1,2\n");
        }
        assert!(fs::symlink_metadata(&fifo).unwrap().file_type().is_fifo());
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn messages_say_what_and_where() {
        let error = read(Path::new("/nowhere/x.json")).unwrap_err();
        assert_eq!(error.message, "cannot read /nowhere/x.json: no such file or directory");
    }
}
