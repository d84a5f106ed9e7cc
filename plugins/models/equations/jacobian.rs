//! Rates of the sensitivities from the derivatives of the rates: `ds/dt = (∂f/∂y) s + ∂f/∂p`.

use lacuna::expression::Evaluator;

use super::flow::defined;
use super::system::System;

/// Derivatives of the rates by channels and states, without those that are always zero.
pub(super) struct Jacobian {
    rows: Vec<Row>,
    entries: Vec<f64>,
}

/// Derivatives of one rate.
struct Row {
    /// Channels on which it depends.
    channels: Vec<usize>,
    /// States on which it depends.
    states: Vec<usize>,
}

impl Jacobian {
    /// `None` if slopes along the sensitivities take fewer operations.
    pub fn new(rates: &mut Evaluator<'_>, system: &System, channels: &[usize]) -> Option<Self> {
        if channels.is_empty() {
            return None;
        }
        let (inputs, count) = (system.variables.len(), system.states.len());
        let states = system.coordinates() - count;
        let mut wanted = vec![false; system.coordinates()];
        wanted[states..].fill(true);
        for &input in channels {
            wanted[inputs + input] = true;
        }
        let pattern = rates.prepare(&wanted, channels.len())?;
        let row = |unknowns: &Vec<usize>| {
            let split = unknowns.partition_point(|&i| i < states);
            let channel = |&i: &usize| channels.iter().position(|&input| inputs + input == i);
            Row {
                channels: unknowns[..split].iter().filter_map(channel).collect(),
                states: unknowns[split..].iter().map(|i| i - states).collect(),
            }
        };
        let entries = vec![0.0; pattern.iter().map(Vec::len).sum()];
        Some(Self { rows: pattern.iter().map(row).collect(), entries })
    }

    /// Computes the rates of the sensitivities, channel by channel, at the point of the evaluator; false if a derivative is
    /// not finite.
    pub fn apply(
        &mut self,
        rates: &mut Evaluator<'_>,
        sensitivities: &[f64],
        their_rates: &mut [f64],
    ) -> bool {
        rates.derivatives(&mut self.entries);
        // The sum is finite only if each entry is; one that overflows takes the other way for nothing.
        if !self.entries.iter().sum::<f64>().is_finite() {
            return false;
        }
        let count = self.rows.len();
        for (s, rates) in sensitivities.chunks(count).zip(their_rates.chunks_mut(count)) {
            let mut entries = &self.entries[..];
            for (row, rate) in self.rows.iter().zip(rates) {
                let (by_state, rest) = entries[row.channels.len()..].split_at(row.states.len());
                let sum: f64 = by_state.iter().zip(&row.states).map(|(g, &j)| g * s[j]).sum();
                *rate = defined(sum);
                entries = rest;
            }
        }
        let mut entries = self.entries.iter();
        for (i, row) in self.rows.iter().enumerate() {
            for (&channel, slope) in row.channels.iter().zip(entries.by_ref()) {
                their_rates[channel * count + i] += slope;
            }
            entries.by_ref().take(row.states.len()).for_each(drop);
        }
        true
    }
}
