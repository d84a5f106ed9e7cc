//! Processor time: the only reliable clock on a machine that also runs other programs.

use std::{fs, io};

/// Processor time of all threads so far, in seconds, as reported by Linux.
pub fn processor_seconds() -> io::Result<f64> {
    let mut nanoseconds = 0.0;
    for task in fs::read_dir("/proc/self/task")? {
        let text = fs::read_to_string(task?.path().join("schedstat"))?;
        let first = text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
        nanoseconds +=
            first.ok_or_else(|| io::Error::other("`schedstat` is no list of numbers"))?;
    }
    Ok(nanoseconds / 1e9)
}

/// Result of a call, and its processor time in seconds.
pub fn timed<T>(call: impl FnOnce() -> T) -> io::Result<(T, f64)> {
    let begun = processor_seconds()?;
    let value = call();
    Ok((value, processor_seconds()? - begun))
}

/// Processor time of a short call, in seconds: the smallest of several means, because other programs can only add time.
pub fn per_call(mut call: impl FnMut()) -> io::Result<f64> {
    let (mut calls, mut least) = (1, f64::INFINITY);
    let mut repeats = 0;
    while repeats < 5 {
        let ((), seconds) = timed(|| (0..calls).for_each(|_| call()))?;
        // The system counts in milliseconds.
        if seconds < 0.2 {
            calls *= 2;
        } else {
            least = least.min(seconds / f64::from(calls));
            repeats += 1;
        }
    }
    Ok(least)
}
