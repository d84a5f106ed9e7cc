//! Loads libraries of plugins: explicitly, once, and for as long as the process lives. Files of plugins in Python are
//! loaded by the crate that serves them.

use std::ffi::c_void;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use lacuna::plugin::Library;
use lacuna::plugin::registry::loaded;
use lacuna::run::files;
use lacuna_abi::status;
use lacuna_abi::table::{Declaration, Entry, Host, MAGIC, MAJOR, MINOR};
use lacuna_abi::watch;

use crate::host::offers;

/// Every library that was loaded.
static LOADED: Mutex<Vec<&'static Library>> = Mutex::new(Vec::new());

/// The symbol that a library exports.
const SYMBOL: &[u8] = b"lacuna_plugin\0";

/// The most plugins of one library: a number above is no number of plugins.
const MOST: u32 = 4096;

/// Loads a library, or finds that it is loaded. The error says what is wrong with it.
///
/// The file is `path`, never one that is searched for. With `pin` the file must have that SHA-256. Its code runs
/// from here on, and the library stays in the process. A file with the extension `py` is one of plugins in Python.
pub fn load(path: &Path, pin: Option<&str>) -> Result<&'static Library, String> {
    if is_python(path) {
        return load_python(path, pin, None, Path::new("."));
    }
    let bytes = std::fs::read(path).map_err(|error| files::in_words(&error))?;
    let sha256 = files::hash(&bytes);
    pinned(&sha256, pin)?;
    let path = path.canonicalize().map_err(|error| files::in_words(&error))?;
    // One at a time, so that no two libraries get the same name.
    let mut all = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(library) = all.iter().find(|library| library.sha256 == sha256) {
        return Ok(library);
    }
    if let Some(other) = all.iter().find(|library| library.path == path) {
        return Err(format!(
            "the process has loaded it with sha256 `{}` and cannot load it again as `{sha256}`",
            other.sha256
        ));
    }
    let library = bring(path, sha256)?;
    all.push(library);
    Ok(library)
}

/// True for a file of plugins in Python.
pub fn is_python(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "py")
}

/// Loads a file of plugins in Python, as [`load`] does. `interpreter` is a path relative to `directory`, a program or a
/// virtual environment.
pub fn load_python(
    path: &Path,
    pin: Option<&str>,
    interpreter: Option<&Path>,
    directory: &Path,
) -> Result<&'static Library, String> {
    let library = lacuna_script::load(path, interpreter, directory)?;
    pinned(&library.sha256, pin).map(|()| library)
}

/// True for a file that has the hash that it must have.
pub fn pinned(sha256: &str, pin: Option<&str>) -> Result<(), String> {
    match pin.filter(|pin| !pin.eq_ignore_ascii_case(sha256)) {
        Some(pin) => {
            Err(format!("it is not the pinned file: expected sha256 `{pin}`, found `{sha256}`"))
        }
        None => Ok(()),
    }
}

/// Loads, checks and registers a library.
fn bring(path: PathBuf, sha256: String) -> Result<&'static Library, String> {
    watch::ready();
    let declaration = declaration(&path)?;
    // SAFETY: the declaration belongs to a library that stays, and says how many entries it has.
    let entries = unsafe { entries(declaration)? };
    start(declaration)?;
    // SAFETY: texts of a declaration are constants of the library.
    let [name, version, sdk] = unsafe {
        [declaration.name.string(), declaration.version.string(), declaration.sdk.string()]
    };
    let plugins = entries
        .iter()
        // SAFETY: as above.
        .map(|entry| unsafe { (entry.kind.string(), entry.name.string()) })
        .collect();
    let abi = Some((declaration.major, declaration.minor));
    let library: &'static Library =
        Box::leak(Box::new(Library { path, sha256, name, version, sdk, abi, plugins }));
    // SAFETY: the entries are constants of a library that stays.
    let offered = unsafe { offers(entries, library)? };
    loaded::add(&library.path.display().to_string(), offered);
    Ok(library)
}

/// The declaration of a library, once it is sure that this program understands it; none of its functions was called.
fn declaration(path: &Path) -> Result<&'static Declaration, String> {
    // SAFETY: initialisers of the library run here; loading somebody's library means to trust it.
    let library = unsafe { open(path) }
        .map_err(|error| format!("it cannot be loaded: {}", reason(&error)))?;
    // SAFETY: the symbol's address alone is taken; what it is says its beginning.
    let symbol =
        unsafe { library.get::<*const c_void>(SYMBOL).map(|symbol| symbol.try_as_raw_ptr()) };
    // Threads and destructors of the library may outlive any use of it: it is never unloaded.
    std::mem::forget(library);
    let no_symbol = "it is no library of plugins: it has no symbol `lacuna_plugin`";
    let address = symbol.ok().flatten().filter(|address| !address.is_null()).ok_or(no_symbol)?;
    if !address.cast::<Declaration>().is_aligned() {
        return Err("its `lacuna_plugin` stands where no declaration can".to_owned());
    }
    // SAFETY: a symbol has at least the eight bytes of a number.
    let magic = unsafe { address.cast::<u64>().read() };
    if magic != MAGIC {
        return Err(
            "it is no library of plugins: its `lacuna_plugin` does not begin as a declaration does"
                .to_owned(),
        );
    }
    // SAFETY: what begins like this has the versions next, whatever they are.
    let [major, minor] = unsafe {
        let versions = address.cast::<u64>().add(1).cast::<u32>();
        [versions.read(), versions.add(1).read()]
    };
    if major != MAJOR || minor > MINOR {
        return Err(format!(
            "it is made for version {major}.{minor} of the boundary, and this program speaks {MAJOR}.{MINOR}; build it \
             anew with the SDK of this program"
        ));
    }
    let declaration = address.cast::<Declaration>();
    // SAFETY: declarations of this major version have their size next.
    let (found, least) =
        unsafe { ((&raw const (*declaration).size).read(), size_of::<Declaration>()) };
    if found < least {
        return Err(format!("its declaration has {found} bytes, expected at least {least}"));
    }
    // SAFETY: it is aligned, has all bytes of a declaration, and is a constant of a library that stays. Its fields are
    // numbers and pointers, for which any bytes will do.
    let declaration = unsafe { &*declaration };
    if declaration.unwinds != 1 {
        return Err("it is built with `panic = \"abort\"`, so that a panic in it would end the whole program; build it \
                    with `panic = \"unwind\"`".to_owned());
    }
    Ok(declaration)
}

/// Why the system cannot load a file.
fn reason(error: &libloading::Error) -> String {
    let source = std::error::Error::source(error);
    source.map_or_else(|| error.to_string(), ToString::to_string)
}

#[cfg(unix)]
unsafe fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // Everything is resolved now, so that no call fails later for want of a symbol.
    // SAFETY: as the caller promises.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
}

#[cfg(not(unix))]
unsafe fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    // SAFETY: as the caller promises.
    unsafe { libloading::Library::new(path) }
}

/// The entries of a declaration.
///
/// # Safety
/// The declaration is one of a library that stays.
unsafe fn entries(declaration: &Declaration) -> Result<&'static [Entry], String> {
    let count = declaration.count;
    if declaration.entries.is_null() || count == 0 || count > MOST {
        return Err(format!("its declaration has {count} entries"));
    }
    if !declaration.entries.is_aligned() {
        return Err("the entries of its declaration stand where none can".to_owned());
    }
    // SAFETY: as the caller promises.
    let entries = unsafe { std::slice::from_raw_parts(declaration.entries, count as usize) };
    match entries.iter().position(|entry| entry.size != size_of::<Entry>()) {
        None => Ok(entries),
        Some(i) => Err(format!("entry {} of its declaration has {} bytes", i + 1, entries[i].size)),
    }
}

/// Lets a library begin.
fn start(declaration: &Declaration) -> Result<(), String> {
    let Some(start) = declaration.start else { return Ok(()) };
    let threads = rayon::current_num_threads();
    let host = Host { size: size_of::<Host>(), major: MAJOR, minor: MINOR, threads };
    // SAFETY: the function belongs to the library.
    match unsafe { start(&raw const host) } {
        status::OK => Ok(()),
        other => Err(format!("it does not start: status {other}")),
    }
}
