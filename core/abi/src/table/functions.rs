//! Tables of functions: what is declared once, and what follows from it on either side.

/// A table of functions: `must` be there, or `may` be null.
///
/// The functions of an object, `Table of object, served by Trait { must name(argument: Type); }`, are called with the object
/// and end with an `Answer`; they return a status. One that says what it returns, as in
/// `name() -> usize`, has no answer. From such a table follow
///
/// - the struct as C lays it out, and its description for the header;
/// - the trait, which whoever offers such objects implements, and `Table::of::<T>()`, the table of a type with that trait: each
///   function finds the object, reads its arguments (`Argument`), and lets nothing unwind;
/// - the calls of such an object of the other side: methods of `Object<Table>` of the same names.
///
/// Functions without an object are written with all their arguments: `Table { must name(argument: Type) -> i32; }`.
macro_rules! functions {
    ($(#[doc = $doc:literal])* $name:ident of $this:ident $(ended by $destroy:ident)?, served by $serve:ident {
        $( $(#[doc = $text:literal])* $need:ident $field:ident($($argument:ident: $of:ty),* $(,)?) $(-> $returns:tt)?; )*
    }) => {
        functions! {
            @table $(#[doc = $doc])* $name {
                $( #[doc = " Ends it."]
                must $destroy: unsafe extern "C" fn(*mut ::std::ffi::c_void),
                    &[(stringify!($this), "*mut c_void")], ""; )?
                $( $(#[doc = $text])*
                $need $field: functions!(@function ($($of),*) $($returns)?),
                    functions!(@arguments $this ($($argument: $of),*) $($returns)?),
                    functions!(@returns $($returns)?); )*
            }
        }

        #[doc = concat!("The functions of [`", stringify!($name), "`] as methods of an object that is served.")]
        pub trait $serve: Sized {
            $( functions! { @method $(#[doc = $text])* $field ($($argument: $of),*) $($returns)? } )*
        }

        impl $name {
            /// The table of the objects of a type.
            pub const fn of<T: $serve>() -> Self {
                Self {
                    size: size_of::<Self>(),
                    $( $destroy: Some($crate::guard::end::<T>), )?
                    $( $field: Some(functions!(@shim $serve $field ($($argument: $of),*) $($returns)?)), )*
                }
            }
        }

        impl $crate::Object<$name> {
            $( functions! { @call $(#[doc = $text])* $field ($($argument: $of),*) $($returns)? } )*
        }
    };
    ($(#[doc = $doc:literal])* $name:ident {
        $( $(#[doc = $text:literal])* $need:ident $field:ident($($argument:ident: $of:ty),* $(,)?) $(-> $returns:ty)?; )*
    }) => {
        functions! {
            @table $(#[doc = $doc])* $name {
                $( $(#[doc = $text])*
                $need $field: unsafe extern "C" fn($($argument: $of),*) $(-> $returns)?,
                    &[$((stringify!($argument), stringify!($of))),*], concat!($(stringify!($returns))?); )*
            }
        }
    };
    // The struct and what is said of it: each function with its type, its arguments and what it returns.
    (@table $(#[doc = $doc:literal])* $name:ident {
        $( $(#[doc = $text:literal])* $need:ident $field:ident: $function:ty, $arguments:expr, $returns:expr; )*
    }) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy)]
        pub struct $name {
            /// The size of this table in bytes.
            pub size: usize,
            $( $(#[doc = $text])*
            pub $field: Option<$function>, )*
        }

        impl $name {
            pub(super) const SHAPE: $crate::shape::Shape = $crate::shape::Shape {
                name: stringify!($name),
                docs: &[$($doc),*],
                fields: &[
                    $crate::shape::Field {
                        name: "size",
                        docs: &[" The size of this table in bytes."],
                        of: $crate::shape::Type::Value("usize"),
                    },
                    $( $crate::shape::Field {
                        name: stringify!($field),
                        docs: &[$($text),*],
                        of: $crate::shape::Type::Function {
                            optional: functions!(@optional $need),
                            arguments: $arguments,
                            returns: $returns,
                        },
                    } ),*
                ],
            };
        }

        impl $crate::shape::Table for $name {
            fn size(&self) -> usize {
                self.size
            }

            fn missing(&self) -> Option<&'static str> {
                $( if !functions!(@optional $need) && self.$field.is_none() {
                    return Some(stringify!($field));
                } )*
                None
            }
        }
    };
    (@optional must) => { false };
    (@optional may) => { true };
    // The parts of a function of an object: with an answer, or with what it returns.
    (@function ($($of:ty),*)) => {
        unsafe extern "C" fn(*mut ::std::ffi::c_void, $($of,)* *const $crate::basic::Answer) -> i32
    };
    (@function ($($of:ty),*) $returns:tt) => {
        unsafe extern "C" fn(*mut ::std::ffi::c_void, $($of),*) -> $returns
    };
    (@arguments $this:ident ($($argument:ident: $of:ty),*)) => {
        &[
            (stringify!($this), "*mut c_void"),
            $( (stringify!($argument), stringify!($of)), )*
            ("answer", "*const Answer"),
        ]
    };
    (@arguments $this:ident ($($argument:ident: $of:ty),*) $returns:tt) => {
        &[(stringify!($this), "*mut c_void"), $( (stringify!($argument), stringify!($of)) ),*]
    };
    (@returns) => { "i32" };
    (@returns ()) => { "" };
    (@returns $returns:tt) => { stringify!($returns) };
    // What a type must do that is served.
    (@method $(#[doc = $text:literal])* $field:ident ($($argument:ident: $of:ty),*)) => {
        $(#[doc = $text])*
        fn $field(
            &self,
            $( $argument: <$of as $crate::argument::Argument>::Given<'_>, )*
            out: &$crate::guard::Out,
        ) -> $crate::guard::Done;
    };
    (@method $(#[doc = $text:literal])* $field:ident ($($argument:ident: $of:ty),*) $returns:tt) => {
        $(#[doc = $text])*
        fn $field(&self, $( $argument: <$of as $crate::argument::Argument>::Given<'_> ),*) -> $returns;
    };
    // The function in the table of a type that is served.
    (@shim $serve:ident $field:ident ($($argument:ident: $of:ty),*)) => {{
        unsafe extern "C" fn shim<T: $serve>(
            this: *mut ::std::ffi::c_void,
            $( $argument: $of, )*
            answer: *const $crate::basic::Answer,
        ) -> i32 {
            $crate::guard::guard(answer, |out| {
                // SAFETY: the table belongs to objects of this type; what they are given is there until the call returns.
                let this = unsafe { $crate::guard::object::<T>(this) };
                $( // SAFETY: as above.
                let $argument = unsafe { $crate::argument::Argument::given($argument)? }; )*
                this.$field($( $argument, )* out)
            })
        }
        shim::<T>
    }};
    (@shim $serve:ident $field:ident ($($argument:ident: $of:ty),*) $returns:tt) => {{
        unsafe extern "C" fn shim<T: $serve>(this: *mut ::std::ffi::c_void, $( $argument: $of ),*) -> $returns {
            $crate::guard::guard_number(Default::default(), || {
                // SAFETY: the table belongs to objects of this type; what they are given is there until the call returns.
                let this = unsafe { $crate::guard::object::<T>(this) };
                let answered = || -> Result<$returns, $crate::Refusal> {
                    $( // SAFETY: as above.
                    let $argument = unsafe { $crate::argument::Argument::given($argument)? }; )*
                    Ok(this.$field($( $argument ),*))
                };
                answered().unwrap_or_default()
            })
        }
        shim::<T>
    }};
    // The call of an object of the other side.
    (@call $(#[doc = $text:literal])* $field:ident ($($argument:ident: $of:ty),*)) => {
        $(#[doc = $text])*
        ///
        /// # Safety
        /// Every pointer leads to as many values as are said here, which are there until the call returns.
        pub unsafe fn $field(&self, $( $argument: impl Into<$of> ),*) -> $crate::object::Asked {
            $( let $argument = $argument.into(); )*
            self.ask(stringify!($field), self.functions.$field, |function, answer| {
                // SAFETY: the function belongs to the object; the rest as the caller promises.
                unsafe { function(self.this, $( $argument, )* answer) }
            })
        }
    };
    (@call $(#[doc = $text:literal])* $field:ident ($($argument:ident: $of:ty),*) $returns:tt) => {
        $(#[doc = $text])*
        ///
        /// `None` where the object has no such function.
        ///
        /// # Safety
        /// Every pointer leads to as many values as are said here, which are there until the call returns.
        pub unsafe fn $field(&self, $( $argument: impl Into<$of> ),*) -> Option<$returns> {
            $( let $argument = $argument.into(); )*
            // SAFETY: the function belongs to the object; the rest as the caller promises.
            self.functions.$field.map(|function| unsafe { function(self.this, $( $argument ),*) })
        }
    };
}
