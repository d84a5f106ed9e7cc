//! Progress on the terminal: one bar per stage, or plain lines if the output is not a terminal.

use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use lacuna::run::Observer;

use crate::events::{self, Events};
use crate::terminal::{clean, tell};

/// Interval between plain lines.
const INTERVAL: Duration = Duration::from_secs(10);

/// The observer of a command: it shows progress on the terminal, or writes events for programs.
pub fn observer() -> Box<dyn Observer> {
    if events::are_on() { Box::new(Events::default()) } else { Box::new(Terminal::new()) }
}

/// Shows the progress of a run on standard error.
struct Terminal {
    interactive: bool,
    current: Mutex<Option<Current>>,
}

struct Current {
    stage: String,
    unit: String,
    total: u64,
    /// True if the total is an estimate.
    about: bool,
    bar: Option<ProgressBar>,
    begun: Instant,
    /// Number of units done at the first report: taken from an earlier run, so they do not count for the rate.
    first: Option<u64>,
    spoken: Instant,
}

impl Terminal {
    /// A display that shows nothing yet.
    fn new() -> Self {
        let interactive = std::io::stderr().is_terminal();
        Self { interactive, current: Mutex::new(None) }
    }

    fn with<R>(&self, act: impl FnOnce(&mut Option<Current>) -> R) -> R {
        // A thread that panicked while it reported progress leaves the state usable, so a poisoned lock is accepted.
        let mut current = self.current.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        act(&mut current)
    }

    /// Prints a line above the bar.
    fn say(&self, text: &str) {
        self.with(|slot| match slot.as_ref().and_then(|current| current.bar.as_ref()) {
            Some(bar) => bar.println(clean(text)),
            None => tell(text),
        });
    }
}

impl Observer for Terminal {
    fn begin(&self, stage: &str, unit: &str, total: u64) {
        let bar = match total {
            _ if !self.interactive || unit.is_empty() => None,
            // The end of a search is not known beforehand.
            0 => Some(counter(stage, unit)),
            _ => Some(bar(stage, unit, total)),
        };
        let now = Instant::now();
        let current = Current {
            stage: stage.to_owned(),
            unit: unit.to_owned(),
            total,
            about: false,
            bar,
            begun: now,
            first: None,
            spoken: now,
        };
        self.with(|slot| *slot = Some(current));
    }

    fn advance(&self, done: u64) {
        self.with(|slot| {
            let Some(current) = slot else { return };
            let first = *current.first.get_or_insert(done);
            if let Some(bar) = &current.bar {
                bar.set_position(done);
            } else if !self.interactive && current.spoken.elapsed() > INTERVAL {
                current.spoken = Instant::now();
                tell(&plain_line(current, first, done));
            }
        });
    }

    fn expect(&self, total: u64) {
        self.with(|slot| {
            let Some(current) = slot else { return };
            (current.total, current.about) = (total, true);
            if let Some(bar) = &current.bar {
                bar.set_style(style(&current.stage, &current.unit, true));
                bar.set_length(total);
            }
        });
    }

    fn end(&self, stage: &str, note: &str) {
        let current = self.with(Option::take);
        let Some(current) = current else { return };
        if let Some(bar) = current.bar {
            bar.finish_and_clear();
        }
        let seconds = current.begun.elapsed().as_secs_f64();
        tell(&format!("{stage:<10} {seconds:>8.2} s   {note}"));
    }

    fn warn(&self, text: &str) {
        self.say(&format!("warning: {text}"));
    }

    fn note(&self, text: &str) {
        self.say(text);
    }
}

/// The line of a stage whose total is known, or about known.
fn style(stage: &str, unit: &str, about: bool) -> ProgressStyle {
    let template = if about {
        format!(
            "{stage:<10} [{{bar:30}}] {{pos}} of about {{len}} {unit}s, {{per_sec}}, about {{eta}} left"
        )
    } else {
        format!("{stage:<10} [{{bar:30}}] {{pos}}/{{len}} {unit}s, {{per_sec}}, {{eta}} left")
    };
    ProgressStyle::with_template(&template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .progress_chars("=> ")
}

fn bar(stage: &str, unit: &str, total: u64) -> ProgressBar {
    let bar = ProgressBar::new(total).with_style(style(stage, unit, false));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn counter(stage: &str, unit: &str) -> ProgressBar {
    let template = format!("{stage:<10} {{spinner}} {{pos}} {unit}s, {{per_sec}}, {{elapsed}}");
    let style = ProgressStyle::with_template(&template)
        .unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::no_length().with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn plain_line(current: &Current, first: u64, done: u64) -> String {
    let seconds = current.begun.elapsed().as_secs_f64();
    let rate = done.saturating_sub(first) as f64 / seconds.max(1e-9);
    let Current { stage, unit, total, about, .. } = current;
    if rate == 0.0 {
        return format!("{stage}: {done}/{total} {unit}s");
    }
    if done > *total {
        // A run that continues until it has enough draws has no known total.
        return format!("{stage}: {done} {unit}s, {rate:.1} {unit}s/s");
    }
    let left = (total - done) as f64 / rate;
    if *about {
        return format!(
            "{stage}: {done} of about {total} {unit}s, {rate:.1} {unit}s/s, about {left:.0} s left"
        );
    }
    format!("{stage}: {done}/{total} {unit}s, {rate:.1} {unit}s/s, {left:.0} s left")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_the_time_that_is_left_and_whether_that_is_an_estimate() {
        let begun =
            Instant::now().checked_sub(Duration::from_secs(10)).unwrap_or_else(Instant::now);
        let of = |total, about| Current {
            stage: "gap".to_owned(),
            unit: "evaluation".to_owned(),
            total,
            about,
            bar: None,
            begun,
            first: None,
            spoken: begun,
        };
        let line = |total, about, done| plain_line(&of(total, about), 0, done);
        assert!(line(300, false, 100).starts_with("gap: 100/300 evaluations, "));
        assert!(
            line(300, false, 100).ends_with("evaluations/s, 20 s left"),
            "{}",
            line(300, false, 100)
        );
        let about = line(300, true, 100);
        assert!(about.starts_with("gap: 100 of about 300 evaluations, "), "{about}");
        assert!(about.ends_with(", about 20 s left"), "{about}");
        // More than was estimated: nothing is known of the rest.
        assert!(line(300, true, 400).ends_with("evaluations/s"));
        assert!(line(0, false, 400).starts_with("gap: 400 evaluations, "));
    }
}
