//! Contract of reliability methods.

use lacuna::math::random::Stream;
use lacuna::math::special::normal_cdf;
use lacuna::matrix::Matrix;
use lacuna::plugin::Reliability;
use lacuna::plugin::reliability::{Estimate, LimitState};
use lacuna::run::{Progress, Silent, Stop};

use crate::judge::{Check, calm, judge};

/// Tests a method against its contract: on a plane with the probability `Phi(-2)`.
///
/// - The probability is within a factor of two of the true one, with the calls counted, and the same stream gives the same bits.
/// - A model without any answer causes an error or an estimate without failures, and no panic.
/// - A method that needs standard normal variables refuses others.
pub fn reliability(name: &str, method: &dyn Reliability) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 3] = [
        ("finds the probability", Box::new(|| finds_the_probability(method))),
        ("bears a model without answers", Box::new(|| bears_no_answers(method))),
        ("refuses what it cannot use", Box::new(|| refuses_weights(method))),
    ];
    judge("reliability", name, &checks)
}

const DISTANCE: f64 = 2.0;

struct Plane {
    answers: bool,
    draws: Option<Matrix>,
}

impl LimitState for Plane {
    fn dimension(&self) -> usize {
        3
    }

    fn values(&self, points: &Matrix) -> Result<Vec<f64>, Stop> {
        let value = |u: &[f64]| if self.answers { DISTANCE - u[1] } else { f64::NAN };
        Ok(points.iter_rows().map(value).collect())
    }

    fn is_standard_normal(&self) -> bool {
        self.draws.is_none()
    }

    fn draws(&self) -> Option<&Matrix> {
        self.draws.as_ref()
    }
}

fn estimate(method: &dyn Reliability, state: &Plane) -> Result<Estimate, Stop> {
    method.estimate(state, &Stream::root(11), &Progress::new(&Silent))
}

fn finds_the_probability(method: &dyn Reliability) -> Result<(), String> {
    let state = Plane { answers: true, draws: None };
    let first = estimate(method, &state).map_err(|stop| stop.to_string())?;
    let ratio = first.probability / normal_cdf(-DISTANCE);
    if !(0.5..=2.0).contains(&ratio) {
        return Err(format!("the probability is {ratio} times the true one"));
    }
    if first.calls == 0 || first.undefined > 0 {
        return Err(format!("{} calls, {} without an answer", first.calls, first.undefined));
    }
    if let Some([low, high]) = first.interval
        && !(low <= first.probability && first.probability <= high)
    {
        return Err(format!("{} is outside its interval", first.probability));
    }
    let again = estimate(method, &state).map_err(|stop| stop.to_string())?;
    if again == first { Ok(()) } else { Err("the same stream gives another estimate".to_owned()) }
}

fn bears_no_answers(method: &dyn Reliability) -> Result<(), String> {
    let state = Plane { answers: false, draws: None };
    match calm("a model without answers", || estimate(method, &state))? {
        Err(_) => Ok(()),
        Ok(found) if found.probability == 0.0 && !found.converged => Ok(()),
        Ok(found) => Err(format!("a model without answers gives {found:?}")),
    }
}

fn refuses_weights(method: &dyn Reliability) -> Result<(), String> {
    let draws = Matrix::from_fn(500, 3, |i, j| ((37 * i + 11 * j) % 97) as f64 / 48.0 - 1.0);
    let state = Plane { answers: true, draws: Some(draws) };
    let found = calm("weighted variables", || estimate(method, &state))?;
    if method.needs_standard_normal() && found.is_ok() {
        return Err("the method needs standard normal variables and accepts others".to_owned());
    }
    Ok(())
}
