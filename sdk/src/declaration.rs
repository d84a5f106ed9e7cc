//! The declaration that [`export!`](crate::export) writes into a library.

use lacuna_abi::table::{MAGIC, MAJOR, MINOR, Text};

use crate::guest::{Export, start};

pub use lacuna_abi::table::{Declaration, Entry};

/// With what a library was made.
const SDK: &str = concat!("lacuna-plugin ", env!("CARGO_PKG_VERSION"));

/// One plugin of a library, with its revision.
pub const fn entry<K: Export<T, REVISION> + ?Sized, T, const REVISION: u32>(
    kind: &'static str,
    name: &'static str,
) -> Entry {
    Entry {
        size: size_of::<Entry>(),
        kind: Text::of(kind),
        name: Text::of(name),
        component: K::COMPONENT,
        functions: K::FUNCTIONS,
    }
}

/// The declaration of a library.
pub const fn declaration(
    name: &'static str,
    version: &'static str,
    record: &'static str,
    entries: &'static [Entry],
) -> Declaration {
    Declaration {
        magic: MAGIC,
        major: MAJOR,
        minor: MINOR,
        size: size_of::<Declaration>(),
        unwinds: cfg!(panic = "unwind") as u32,
        count: entries.len() as u32,
        name: Text::of(name),
        version: Text::of(version),
        sdk: Text::of(SDK),
        entries: entries.as_ptr(),
        record: Text::of(record),
        start: Some(start),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_in_the_record_is_that_of_the_boundary() {
        assert_eq!(crate::abi_version!(), format!("{MAJOR}.{MINOR}"));
    }
}
