//! Noise of one instrument in a single record.

use crate::noise::Source;

/// Correlation of neighbouring values of an instrument with memory.
const MEMORY: f64 = 0.7;

/// Correlation of neighbouring values of a drift.
const SLOW: f64 = 0.98;

/// An instrument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Instrument {
    /// Independent errors.
    White,
    /// Errors of first order.
    Coloured,
    /// Independent errors and a reading in whole steps of three standard deviations.
    Rounded,
    /// A slow drift, twice as large as the errors of the others.
    Drifting,
    /// Independent errors; the first values, so many, are far off.
    Settling(usize),
}

/// The data sheet of an instrument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated {
    /// The standard deviation of one value.
    pub sd: f64,
    /// The step of its reading; zero if there is none.
    pub resolution: f64,
    /// The time over which the correlation falls to 1/e.
    pub memory: f64,
}

impl Instrument {
    /// The instrument number `index`; the number of values that are off is drawn.
    pub fn drawn(index: usize, random: &mut Source) -> Self {
        match index % 6 {
            0 | 3 => Self::White,
            1 => Self::Coloured,
            2 => Self::Rounded,
            4 => Self::Drifting,
            _ => Self::Settling(1 + (random.uniform(0.0, 3.0) as usize)),
        }
    }

    /// Name.
    pub fn name(self) -> &'static str {
        match self {
            Self::White => "white",
            Self::Coloured => "coloured",
            Self::Rounded => "rounded",
            Self::Drifting => "drifting",
            Self::Settling(_) => "settling",
        }
    }

    /// The data sheet, if errors have this standard deviation and values this distance in time.
    pub fn stated(self, sd: f64, step: f64) -> Stated {
        let of = |sd, memory| Stated { sd, resolution: 0.0, memory };
        match self {
            Self::White | Self::Settling(_) => of(sd, 0.0),
            Self::Coloured => of(sd, -step / MEMORY.ln()),
            Self::Rounded => Stated { sd, resolution: 3.0 * sd, memory: 0.0 },
            Self::Drifting => of(2.0 * sd, -step / SLOW.ln()),
        }
    }

    /// The record of a curve with this standard deviation of its own.
    pub fn measured(
        self,
        exact: &[f64],
        sd: f64,
        spread: f64,
        step: f64,
        random: &mut Source,
    ) -> Vec<f64> {
        let resolution = self.stated(sd, step).resolution;
        let correlation: f64 = match self {
            Self::Coloured => MEMORY,
            Self::Drifting => SLOW,
            _ => 0.0,
        };
        let mut state = random.normal();
        let mut all = Vec::with_capacity(exact.len());
        for (i, y) in exact.iter().enumerate() {
            let error = match self {
                Self::Drifting => 2.0 * state,
                _ => state,
            };
            let off = match self {
                Self::Settling(count) if i < count => (spread + 30.0 * sd) / (i + 1) as f64,
                _ => 0.0,
            };
            let value = y + sd * error + off;
            let rounded =
                if resolution > 0.0 { (value / resolution).round() * resolution } else { value };
            all.push(rounded);
            state =
                correlation * state + (1.0 - correlation * correlation).sqrt() * random.normal();
        }
        all
    }
}
