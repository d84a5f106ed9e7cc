//! The noise of single replicates as a study states it.

use lacuna::plugin::discrepancy::StatedNoise;

use crate::study::noise::OutputNoise;

/// Noise of one replicate at each output, as a study states it. What is `None` is estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// The noise of each output.
    pub outputs: Vec<OutputNoise>,
    /// The place in the study that states it, in words.
    pub by: &'static str,
}

impl Statement {
    /// A statement of size and correlation together.
    pub fn complete(stated: StatedNoise, by: &'static str) -> Self {
        let times = stated.correlation_time;
        let of = |(i, sd): (usize, f64)| OutputNoise {
            sd: Some(sd),
            memory: Some(times.as_ref().map_or(0.0, |times| times[i])),
        };
        Self { outputs: stated.sd.into_iter().enumerate().map(of).collect(), by }
    }

    /// Returns true if size and memory of all outputs are stated.
    pub fn is_complete(&self) -> bool {
        self.outputs.iter().all(|own| own.sd.is_some() && own.memory.is_some())
    }
}
