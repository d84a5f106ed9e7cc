//! Structs of the boundary, declared once: as Rust, and as data from which the C header is written.

use crate::Refusal;

/// A struct of the boundary, as data.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// The name.
    pub name: &'static str,
    /// The documentation, line by line.
    pub docs: &'static [&'static str],
    /// The fields in order.
    pub fields: &'static [Field],
}

/// A field of a struct.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// The name.
    pub name: &'static str,
    /// The documentation, line by line.
    pub docs: &'static [&'static str],
    /// The type.
    pub of: Type,
}

/// The type of a field.
#[derive(Debug, Clone, Copy)]
pub enum Type {
    /// A value of this type, as Rust writes it.
    Value(&'static str),
    /// A function; one that is not needed may be null.
    Function {
        /// True where it may be null.
        optional: bool,
        /// Names and types of its arguments.
        arguments: &'static [(&'static str, &'static str)],
        /// The return type, as Rust writes it; empty for nothing.
        returns: &'static str,
    },
}

/// A table of functions that somebody else made.
pub trait Table: Copy {
    /// The size that it says it has.
    fn size(&self) -> usize;

    /// The first function that it must have and has not.
    fn missing(&self) -> Option<&'static str>;
}

/// A table of somebody else's as one's own, with all functions that it must have.
///
/// # Safety
/// As for [`read`].
pub unsafe fn copied<F: Table>(table: *const F) -> Result<F, Refusal> {
    // SAFETY: as the caller promises.
    let own = unsafe { read(table)? };
    whole(&own).map(|()| own)
}

/// A table of somebody else's as one's own, as far as it goes: functions of later versions than its own are null.
///
/// # Safety
/// The pointer is null or leads to a table that has the size that it says.
pub unsafe fn read<F: Table>(table: *const F) -> Result<F, Refusal> {
    if table.is_null() {
        return Err(Refusal::stop("has no functions"));
    }
    // SAFETY: every table begins with its size.
    let size = unsafe { table.cast::<usize>().read_unaligned() };
    // Half of a function would be an address that nobody gave.
    if size < size_of::<usize>() || size % size_of::<usize>() != 0 {
        return Err(Refusal::stop(format!("has a table of {size} bytes")));
    }
    // SAFETY: a table is a number and functions that may be null, for which zeros are right.
    let mut own: F = unsafe { std::mem::zeroed() };
    let count = size.min(size_of::<F>());
    // SAFETY: both have so many bytes, and what is copied is whole functions.
    unsafe { std::ptr::copy_nonoverlapping(table.cast::<u8>(), (&raw mut own).cast::<u8>(), count) }
    Ok(own)
}

/// Complains of the first function that a table must have and has not.
pub fn whole<F: Table>(table: &F) -> Result<(), Refusal> {
    let lacks = |name| Err(Refusal::stop(format!("has no function `{name}`")));
    table.missing().map_or(Ok(()), lacks)
}

/// A plain struct of the boundary.
macro_rules! record {
    ($(#[doc = $doc:literal])* $name:ident {
        $( $(#[doc = $text:literal])* $field:ident: $of:ty, )*
    }) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy)]
        pub struct $name {
            $( $(#[doc = $text])* pub $field: $of, )*
        }

        impl $name {
            pub(super) const SHAPE: $crate::shape::Shape = $crate::shape::Shape {
                name: stringify!($name),
                docs: &[$($doc),*],
                fields: &[$( $crate::shape::Field {
                    name: stringify!($field),
                    docs: &[$($text),*],
                    of: $crate::shape::Type::Value(stringify!($of)),
                } ),*],
            };
        }
    };
}
