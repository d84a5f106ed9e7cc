//! Parts shared by samplers with several chains: checks of their size and of their starting points.

use lacuna::plugin::Target;
use lacuna::plugin::sampler::State;
use lacuna::run::Stop;
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use serde_json::Value;

/// Reports fewer than two chains, because convergence is judged by comparing chains.
pub(super) fn check_count(chains: usize, complaints: &mut Complaints<'_>) {
    if chains < 2 {
        complaints
            .at("chains")
            .say("a single chain cannot show that it has converged")
            .expected("at least 2")
            .found(chains);
    }
}

/// Reports a run that has no steps after its warm-up.
pub(super) fn check_steps(steps: usize, warm_up: usize, complaints: &mut Complaints<'_>) {
    if steps == 0 {
        complaints.at("steps").say("no steps").expected("at least 1").found(0);
    } else if warm_up >= steps {
        complaints
            .at("warm_up")
            .say("no step is left after the warm-up")
            .expected(format!("fewer than the {steps} steps of the run"))
            .found(warm_up);
    }
}

/// Reports a value that is not above zero.
pub(super) fn check_positive(field: &str, value: f64, complaints: &mut Complaints<'_>) {
    if !(value > 0.0 && value.is_finite()) {
        complaints.at(field).say("chains would not move").expected("a number above 0").found(value);
    }
}

/// Checks number, dimension and finiteness of the starting points of `count` chains; `kind` is the user's word for a
/// chain.
pub(super) fn check_points(
    points: &Matrix,
    count: usize,
    dimension: usize,
    kind: &str,
) -> Result<(), Stop> {
    let (rows, columns) = (points.rows(), points.columns());
    if dimension == 0 {
        return Err(Stop::new("there is nothing to sample: no parameter is unknown"));
    }
    if count == 0 {
        return Err(Stop::new(format!("there are no {kind} to sample with")));
    }
    if (rows, columns) != (count, dimension) {
        return Err(Stop::new(format!(
            "expected a starting point of {dimension} coordinates for each of {count} {kind}, \
             found {rows} points of {columns}"
        )));
    }
    if points.as_slice().iter().any(|x| !x.is_finite()) {
        return Err(Stop::new(format!("a starting point of the {kind} is not finite")));
    }
    Ok(())
}

/// Returns the log density at the starting points, one per row; fails if any is zero or has no value.
pub(super) fn log_density(
    target: &dyn Target,
    points: &Matrix,
    kind: &str,
) -> Result<Vec<f64>, Stop> {
    let log_density = target.log_density(points);
    let numbered = log_density.iter().enumerate();
    let outside: Vec<String> = numbered
        .filter(|(_, value)| !value.is_finite())
        .map(|(chain, _)| (chain + 1).to_string())
        .collect();
    if outside.is_empty() {
        return Ok(log_density);
    }
    let named = outside.iter().take(5).map(String::as_str).collect::<Vec<_>>().join(", ");
    let more = if outside.len() > 5 { ", and more" } else { "" };
    Err(Stop::new(format!(
        "{} of {} {kind} start where the posterior density is zero or has no value: \
         number {named}{more}",
        outside.len(),
        log_density.len()
    )))
}

/// Returns the state before the first step.
pub(super) fn state(points: Matrix, log_density: Vec<f64>, memory: Value) -> State {
    let count = points.rows();
    let (accepted, evaluations) = (vec![false; count], count as u64);
    State { points, log_density, accepted, evaluations, memory }
}

/// Returns the numbers of a JSON array; empty if `memory` is not an array.
pub(super) fn numbers(memory: &Value) -> Vec<f64> {
    let list = memory.as_array().map_or(&[][..], Vec::as_slice);
    list.iter().filter_map(Value::as_f64).collect()
}

/// Moves a chain to `point` if the proposal was accepted; otherwise the chain stays.
pub(super) fn decide(
    state: &mut State,
    chain: usize,
    accepted: bool,
    point: &[f64],
    log_density: f64,
) {
    state.accepted[chain] = accepted;
    if accepted {
        state.points.row_mut(chain).copy_from_slice(point);
        state.log_density[chain] = log_density;
    }
}
