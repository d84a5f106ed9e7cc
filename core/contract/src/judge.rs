//! Functions that the suites share.

use std::panic::{AssertUnwindSafe, catch_unwind};

use lacuna::data::{Axis, Layout, Unit};

/// A check of a suite: its description and its implementation.
pub(super) type Check<'a> = (&'static str, Box<dyn Fn() -> Result<(), String> + 'a>);

/// Runs all checks; the message of every violation names the plugin and the check. A panic is a violation.
pub(super) fn judge(kind: &str, name: &str, checks: &[Check<'_>]) -> Result<(), Vec<String>> {
    let breach = |(what, check): &Check<'_>| {
        let breach = calm(what, check).and_then(|outcome| outcome).err()?;
        Some(format!("{kind} `{name}`, {what}: {breach}"))
    };
    let breaches: Vec<String> = checks.iter().filter_map(breach).collect();
    if breaches.is_empty() { Ok(()) } else { Err(breaches) }
}

/// The result of `act`, or an error if it panics.
pub(super) fn calm<T>(what: &str, act: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(act)).map_err(|_| format!("{what} makes it panic"))
}

/// Requires an error: neither a result nor a panic.
pub(super) fn refused<T, E>(what: &str, act: impl FnOnce() -> Result<T, E>) -> Result<(), String> {
    match calm(what, act)? {
        Ok(_) => Err(format!("{what} is accepted")),
        Err(_) => Ok(()),
    }
}

/// Requires that one and three threads give the same result.
pub(super) fn same_on_threads<T: PartialEq + Send>(
    act: impl Fn() -> Result<T, String> + Sync,
) -> Result<(), String> {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map_err(|error| format!("no pool of {threads} threads: {error}"))?.install(&act)
    };
    if on(1)? == on(3)? { Ok(()) } else { Err("one and three threads differ".into()) }
}

/// Derivatives of `f` by coordinate `j` at a point, by central differences of step `h`.
pub(super) fn slope(f: impl Fn(&[f64]) -> Vec<f64>, at: &[f64], j: usize, h: f64) -> Vec<f64> {
    let moved = |by: f64| {
        let mut point = at.to_vec();
        point[j] += by;
        f(&point)
    };
    moved(h).iter().zip(moved(-h)).map(|(above, below)| (above - below) / (2.0 * h)).collect()
}

/// Requires that derivatives agree with finite differences up to `tolerance` times the largest of them.
pub(super) fn agree(
    what: &str,
    given: &[f64],
    differences: &[f64],
    tolerance: f64,
) -> Result<(), String> {
    let largest = differences.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    if given.len() != differences.len() {
        let (given, expected) = (given.len(), differences.len());
        return Err(format!("{what} has {given} entries and not {expected}"));
    }
    let far = |(a, b): (&f64, &f64)| {
        let within = (a - b).abs() <= tolerance * largest.max(f64::MIN_POSITIVE);
        !within
    };
    match given.iter().zip(differences).position(far) {
        None => Ok(()),
        Some(i) => Err(format!(
            "{what} {} is {} where differences give {}",
            i + 1,
            given[i],
            differences[i]
        )),
    }
}

/// The first name that occurs twice.
pub(super) fn twice<'a>(names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut seen = std::collections::BTreeSet::new();
    names.into_iter().find(|name| !seen.insert(*name))
}

/// Layout of a strain of two sensors at five times.
pub(super) fn layout() -> Layout {
    let seconds = Unit::parse("s").unwrap_or_else(|_| unreachable!("`s` is a unit"));
    Layout {
        name: "strain".into(),
        unit: Unit::dimensionless(),
        axes: vec![
            Axis::labels("sensor", ["B", "C"]),
            Axis::grid("time", (1..=5).map(|i| f64::from(i) * 1e-4).collect(), seconds),
        ],
    }
}
