//! The SDK for libraries of plugins for Lacuna.
//!
//! A plugin outside the tree is written as one inside: a struct of options and the trait of its kind, from the crate
//! `lacuna`, which this one re-exports. In the place of `register!` stands one [`export!`] for the whole library, a
//! `cdylib`:
//!
//! ```ignore
//! lacuna_plugin::export! {
//!     Discrepancy "laplace" Laplace,
//!     Sampler "difference_walk" DifferenceWalk,
//! }
//! ```
//!
//! A study loads it with `[plugins] load = ["./libmine.so"]`. `docs/abi.md` tells what holds at the boundary.

pub use lacuna;
pub use lacuna::{data, expression, math, plugin, run, text};

#[cfg(not(feature = "linalg"))]
pub use lacuna::matrix as linalg;
#[cfg(feature = "linalg")]
pub use lacuna_linalg as linalg;

#[doc(hidden)]
pub mod declaration;
mod guest;
#[cfg(test)]
mod tests;

/// Exports plugins from a library: for each its kind, its name in a study and its options, which implement the kind.
///
/// It may stand once in a library. The kinds are those that [`kind_name!`](crate::kind_name) knows. A plugin whose results
/// change gets a higher revision, which is 1 when left out: `Sampler "difference_walk" DifferenceWalk as revision 2`.
#[macro_export]
macro_rules! export {
    ($($kind:ident $name:literal $options:ty $(as revision $revision:literal)?),+ $(,)?) => {
        #[doc(hidden)]
        #[allow(unsafe_code, reason = "the one symbol that the program looks for")]
        const _: () = {
            const RECORD: &str = concat!(
                "lacuna-plugin-record:", $crate::abi_version!(), "\n",
                $($crate::kind_name!($kind), "=", $name, "\n",)+
                "end\n"
            );
            static ENTRIES: &[$crate::declaration::Entry] = &[
                $($crate::declaration::entry::<
                    dyn $crate::plugin::$kind, $options, { $crate::revision!($($revision)?) },
                >($crate::kind_name!($kind), $name)),+
            ];
            #[used]
            #[unsafe(no_mangle)]
            static lacuna_plugin: $crate::declaration::Declaration = $crate::declaration::declaration(
                env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"), RECORD, ENTRIES,
            );
        };
    };
}

/// The version of the boundary, for the record in a library's file.
#[doc(hidden)]
#[macro_export]
macro_rules! abi_version {
    () => {
        "1.2"
    };
}

/// A revision as a library gives it.
#[doc(hidden)]
#[macro_export]
macro_rules! revision {
    () => {
        1
    };
    ($revision:literal) => {{
        assert!($revision > 0, "a revision is a number from 1");
        $revision
    }};
}

/// The name in a study of the kind of a trait.
#[macro_export]
macro_rules! kind_name {
    (Design) => {
        "design"
    };
    (Discrepancy) => {
        "discrepancy"
    };
    (Effect) => {
        "effect"
    };
    (Model) => {
        "model"
    };
    (Quantity) => {
        "quantity"
    };
    (Reader) => {
        "reader"
    };
    (Sampler) => {
        "sampler"
    };
    (Surrogate) => {
        "surrogate"
    };
}
