//! Libraries that end the program: `exit` and `abort` inside a call are told with the name of the plugin, and the program ends
//! with an error.

use std::cell::Cell;

thread_local! {
    /// Name of the plugin that this thread is calling: address and length, or null.
    static INSIDE: Cell<(*const u8, usize)> = const { Cell::new((std::ptr::null(), 0)) };
}

/// Calls a function of a plugin that messages call `who`.
pub fn inside<R>(who: &str, call: impl FnOnce() -> R) -> R {
    let before = INSIDE.replace((who.as_ptr(), who.len()));
    let result = call();
    INSIDE.set(before);
    result
}

/// From now on an end of the program inside a call is told. Nothing happens where the system has no such handlers.
pub fn ready() {
    #[cfg(unix)]
    system::ready();
}

#[cfg(unix)]
mod system {
    use std::ffi::c_void;
    use std::sync::Once;

    use super::INSIDE;

    /// Exit code of a program that a plugin has ended.
    const CODE: i32 = 1;
    const STANDARD_ERROR: i32 = 2;
    const SIGABRT: i32 = 6;

    unsafe extern "C" {
        fn atexit(handler: extern "C" fn()) -> i32;
        fn signal(number: i32, handler: extern "C" fn(i32)) -> usize;
        fn write(descriptor: i32, bytes: *const c_void, count: usize) -> isize;
        fn _exit(code: i32) -> !;
    }

    pub fn ready() {
        static ONCE: Once = Once::new();
        ONCE.call_once(|| {
            // SAFETY: the handlers are functions of this program, which stay, and call nothing but `write` and `_exit`.
            unsafe {
                atexit(at_exit);
                signal(SIGABRT, at_abort);
            }
        });
    }

    extern "C" fn at_exit() {
        if told(b" ended the program by `exit`\n") {
            // SAFETY: it ends the process without further handlers.
            unsafe { _exit(CODE) }
        }
    }

    extern "C" fn at_abort(_: i32) {
        told(b" aborted the program\n");
    }

    /// Tells which plugin this thread is calling, if any.
    fn told(what: &[u8]) -> bool {
        // A thread whose storage is gone calls no plugin.
        let (name, length) = INSIDE.try_with(std::cell::Cell::get).unwrap_or((std::ptr::null(), 0));
        if name.is_null() {
            return false;
        }
        for (bytes, count) in
            [(b"error: ".as_ptr(), 7), (name, length), (what.as_ptr(), what.len())]
        {
            // SAFETY: the bytes are there: a name lives until its call returns, and this is inside the call.
            unsafe { write(STANDARD_ERROR, bytes.cast(), count) };
        }
        true
    }
}
