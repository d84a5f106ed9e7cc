//! Memory that sizes in a study would need.

/// Largest amount of memory, in bytes, that a study may ask for on any machine: one tebibyte.
pub const MOST: f64 = 1_099_511_627_776.0;
/// Size of a number in bytes.
pub const NUMBER: f64 = 8.0;

/// Memory that each position along an axis needs at least, in bytes: reading a study takes about ninety, and the responses at
/// fifty draws the rest.
const POSITION: f64 = 500.0;

/// An amount of memory as text.
pub fn amount(bytes: f64) -> String {
    const UNITS: [&str; 9] = ["bytes", "kB", "MB", "GB", "TB", "PB", "EB", "ZB", "YB"];
    let thousands = (bytes.max(1.0).log10() / 3.0).floor().clamp(0.0, UNITS.len() as f64 - 1.0);
    let value = bytes / 1000.0_f64.powf(thousands);
    let digits = usize::from(value < 10.0);
    format!("{value:.digits$} {}", UNITS[thousands as usize])
}

/// Memory of this machine, in bytes; `None` where it does not say.
pub fn of_machine() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kibibytes)
}

/// Checks the number of positions along an axis, which are made when a study is read.
///
/// # Errors
/// Reason why the axis cannot have this many positions.
pub fn axis(count: usize) -> Result<(), String> {
    axis_within(count, of_machine().map_or(MOST, |memory| MOST.min(memory / 4.0)))
}

fn axis_within(count: usize, memory: f64) -> Result<(), String> {
    let bytes = POSITION * count as f64;
    if bytes <= memory {
        return Ok(());
    }
    let (needed, most) = (amount(bytes), (memory / POSITION).floor());
    Err(format!(
        "expected a `count` of at most {most}, found {count}, which needs {needed} of memory"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_written_for_people() {
        for (bytes, text) in [
            (1.0, "1.0 bytes"),
            (8e3, "8.0 kB"),
            (2.5e10, "25 GB"),
            (1.1e12, "1.1 TB"),
            (4e27, "4000 YB"),
        ] {
            assert_eq!(amount(bytes), text);
        }
    }

    #[test]
    fn axes_have_an_end() {
        assert_eq!(axis(1_000_000), Ok(()));
        assert_eq!(axis_within(2_000_000_000, MOST), Ok(()));
        assert_eq!(
            axis_within(1_000_000_000_000, MOST),
            Err("expected a `count` of at most 2199023255, found 1000000000000, \
                 which needs 500 TB of memory"
                .to_owned())
        );
    }
}
