//! The statuses that a function of a table returns.

/// All is well.
pub const OK: i32 = 0;
/// No answer for these arguments; others may do. The text of the answer says why.
pub const REJECTED: i32 = 1;
/// No answer for any arguments. The text of the answer says why.
pub const FATAL: i32 = 2;
/// The stage cannot go on. The text of the answer says why.
pub const STOP: i32 = 3;
/// The code panicked. The text of the answer is its message.
pub const PANIC: i32 = 4;
/// The plugin does not have this; all is well.
pub const ABSENT: i32 = 5;

/// Every status with its meaning.
pub const ALL: [(&str, i32, &str); 6] = [
    ("OK", OK, "All is well."),
    ("REJECTED", REJECTED, "No answer for these arguments; others may do. The text says why."),
    ("FATAL", FATAL, "No answer for any arguments. The text says why."),
    ("STOP", STOP, "The stage cannot go on. The text says why."),
    ("PANIC", PANIC, "The code panicked. The text is its message."),
    ("ABSENT", ABSENT, "The plugin does not have this; all is well."),
];
