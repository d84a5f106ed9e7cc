//! Counts of cases, confidence intervals of rates, and tests against chance.

use std::collections::BTreeMap;
use std::fmt::Write;

/// Events among trials.
#[derive(Debug, Clone, Copy, Default)]
pub struct Rate {
    pub events: u64,
    pub trials: u64,
}

impl Rate {
    /// Rate at which a condition holds.
    pub fn of<T>(all: &[T], holds: impl Fn(&T) -> bool) -> Self {
        Self { events: all.iter().filter(|x| holds(x)).count() as u64, trials: all.len() as u64 }
    }

    /// 95 % confidence interval of Clopper and Pearson (Biometrika 26 (1934) 404).
    fn interval(self) -> [f64; 2] {
        let Self { events, trials } = self;
        let lower = if events == 0 {
            0.0
        } else {
            bisected(|p| 1.0 - at_most(events - 1, trials, p) < 0.025)
        };
        let upper =
            if events == trials { 1.0 } else { bisected(|p| at_most(events, trials, p) > 0.025) };
        [lower, upper]
    }

    /// A row of a table.
    pub fn row(self, what: &str) -> String {
        let [lower, upper] = self.interval().map(|p| 100.0 * p);
        let rate = 100.0 * self.events as f64 / self.trials.max(1) as f64;
        let Self { events, trials } = self;
        format!("| {what} | {events}/{trials} | {rate:.1} % | {lower:.1} to {upper:.1} % |")
    }

    /// Asserts that the events are not more than expected for a probability: tolerance of four standard deviations,
    /// plus one event for the discreteness.
    pub fn assert_below(self, what: &str, probability: f64) {
        let n = self.trials as f64;
        let most = n * probability + 4.0 * (n * probability * (1.0 - probability)).sqrt() + 1.0;
        assert!(self.events as f64 <= most, "{what}: {self:?}, at most {most:.1}");
    }

    /// Asserts that the events are not fewer than expected for a probability, with the same tolerance.
    pub fn assert_above(self, what: &str, probability: f64) {
        let without = Self { events: self.trials - self.events, ..self };
        without.assert_below(&format!("not {what}"), 1.0 - probability);
    }
}

/// Probability of at most this many events.
fn at_most(events: u64, trials: u64, p: f64) -> f64 {
    let mut term = (trials as f64 * (-p).ln_1p()).exp();
    let mut sum = term;
    for k in 0..events {
        term *= (trials - k) as f64 / (k + 1) as f64 * p / (1.0 - p);
        sum += term;
    }
    sum
}

/// The largest number between zero and one for which a monotone condition holds.
fn bisected(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Confusion table: how often each truth was given each name.
pub fn confusion(pairs: &[(String, String)]) -> String {
    let mut counts: BTreeMap<&str, BTreeMap<&str, u64>> = BTreeMap::new();
    for (truth, said) in pairs {
        *counts.entry(truth).or_default().entry(said).or_default() += 1;
    }
    let mut table = "| hidden | said |\n| --- | --- |\n".to_owned();
    for (truth, said) in counts {
        let each: Vec<String> = said.iter().map(|(name, n)| format!("{name} {n}")).collect();
        let _ = writeln!(table, "| {truth} | {} |", each.join(", "));
    }
    table
}

/// Clopper and Pearson's interval of 9 events in 200 is 2.1 to 8.4 % (their chart; also R's `binom.test`).
#[test]
fn intervals_are_those_of_the_tables() {
    let [lower, upper] = Rate { events: 9, trials: 200 }.interval();
    assert!((lower - 0.0208).abs() < 1e-4 && (upper - 0.0837).abs() < 1e-4, "{lower} {upper}");
    let [lower, upper] = Rate { events: 0, trials: 10 }.interval();
    assert!(lower == 0.0 && (upper - 0.3085).abs() < 1e-4, "{upper}");
}
