//! Windows of the last axis with equal information on the parameters, under each condition.

use crate::gap::experiment::Experiment;

/// A window of a condition.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Window {
    pub condition: usize,
    /// The first and the last place along the last axis.
    pub span: (f64, f64),
    /// The outputs that were measured in it.
    pub outputs: Vec<usize>,
}

/// At most `count` windows per condition, with equal sums of the weights of their outputs.
pub(super) fn windows(experiment: &Experiment<'_>, weight: &[f64], count: usize) -> Vec<Window> {
    let mut all = Vec::new();
    for (c, condition) in experiment.conditions.iter().enumerate() {
        let curves = &experiment.curves[condition.curves.clone()];
        let places = curves.iter().flat_map(|curve| curve.measured.iter().zip(&curve.at));
        let mut places: Vec<(f64, usize)> = places.map(|(&i, &at)| (at, i)).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let total: f64 = places.iter().map(|(_, i)| weight[*i]).sum();
        let mut before = 0.0;
        let mut number = usize::MAX;
        let mut last = f64::NEG_INFINITY;
        for (at, i) in places {
            // Values at the same place stay in one window.
            let due = ((before / total * count as f64) as usize).min(count.saturating_sub(1));
            if at > last && (number == usize::MAX || due > number) {
                number = due;
                all.push(Window { condition: c, span: (at, at), outputs: Vec::new() });
            }
            if let Some(window) = all.last_mut() {
                window.span.1 = at;
                window.outputs.push(i);
            }
            before += weight[i];
            last = at;
        }
    }
    all
}
