//! The injected effects, and the response with them.

mod bump;
pub mod outside;
mod sized;

use lacuna::math::random::{Stream, below, uniform};
use lacuna::plugin::effect::{On, Reach, Situation};
use serde::{Deserialize, Serialize};

use self::bump::add_bump;
use self::outside::{Nearest, OutsideKind, outside};
use self::sized::sized;
use super::{PowerDesign, PowerSetting};
use crate::gap::candidates::{Candidate, Placement, sensors};
use crate::gap::system::System;

pub use bump::Bump;

/// The requested injection of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Injection {
    /// Nothing.
    Nothing,
    /// An effect of this type and size.
    Effect(String, f64),
    /// Two effects of these types and this size.
    Pair([String; 2], f64),
    /// A half sine on one curve.
    Bump(f64),
    /// A change of another form than those of the candidates.
    Outside(OutsideKind, f64),
}

/// The injection of a case.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Injected {
    /// The injection in words: `nothing`, `bump`, `unlisted`, or the types.
    pub what: String,
    /// The effects: type, place and values of the unknowns.
    pub effects: Vec<(String, On, Vec<f64>)>,
    /// The distance of the first unknown of each effect from its absent value, in its unit.
    pub sizes: Vec<f64>,
    /// The root mean square change of each over the standard deviation of the noise of one replicate.
    pub ratio: f64,
    /// The bump, if there is one.
    pub bump: Option<Bump>,
    /// The change of another form, if there is one.
    pub outside: Option<Outside>,
}

/// A change of another form than those of the candidates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outside {
    /// The kind.
    pub kind: OutsideKind,
    /// The form in words.
    pub form: String,
    /// The candidates that come nearest to it.
    pub nearest: Nearest,
    /// The number of forms that were drawn before and rejected.
    pub rejected: u64,
}

/// The cases of a design, in their order.
pub fn plan(design: &PowerDesign, candidates: &[Candidate]) -> Vec<Injection> {
    let mut kinds: Vec<&str> = candidates.iter().map(|c| c.kind.as_str()).collect();
    kinds.dedup();
    let largest = design.ratios.iter().copied().fold(0.0, f64::max).min(1.0);
    let mut all = vec![Injection::Nothing; design.nothing];
    for &ratio in &design.ratios {
        for _ in 0..design.repeats {
            all.extend(kinds.iter().map(|kind| Injection::Effect((*kind).to_owned(), ratio)));
        }
        all.extend((0..design.bumps).map(|_| Injection::Bump(ratio)));
    }
    for i in 0..design.pairs.min(if kinds.len() > 1 { usize::MAX } else { 0 }) {
        // Every distance between two types occurs in turn.
        let (first, apart) = (i % kinds.len(), 1 + (i / kinds.len() + i) % (kinds.len() - 1));
        let second = (first + apart) % kinds.len();
        all.push(Injection::Pair([kinds[first], kinds[second]].map(str::to_owned), largest));
    }
    let outside = OutsideKind::all();
    all.extend(
        (0..design.outside).map(|i| Injection::Outside(outside[i % outside.len()], largest)),
    );
    all
}

/// Makes an injection; returns it with the true response, one value per output. `None` if it cannot be made as large as
/// requested.
pub fn inject(
    setting: &PowerSetting<'_>,
    wanted: &Injection,
    stream: &Stream,
) -> Option<(Injected, Vec<f64>)> {
    let mut response = setting.fit.at.response.clone();
    let mut planted = Injected::default();
    match wanted {
        Injection::Nothing => planted.what = "nothing".into(),
        Injection::Effect(kind, ratio) => {
            planted.ratio = *ratio;
            response = effects(setting, &[kind], *ratio, &mut planted, stream)?;
        }
        Injection::Pair(kinds, ratio) => {
            planted.ratio = *ratio;
            let kinds: Vec<&String> = kinds.iter().collect();
            response = effects(setting, &kinds, *ratio, &mut planted, stream)?;
        }
        Injection::Bump(ratio) => {
            planted.what = "bump".into();
            planted.ratio = *ratio;
            planted.bump = Some(add_bump(setting, *ratio, &mut response, stream)?);
        }
        Injection::Outside(kind, ratio) => {
            planted.what = "unlisted".into();
            planted.ratio = *ratio;
            let made = outside(setting, *kind, *ratio, stream)?;
            (planted.outside, response) = (Some(made.0), made.1);
        }
    }
    Some((planted, response))
}

/// The number of tries to draw a variant, a placement and other unknowns that can be made large enough.
const TRIES: u64 = 20;

/// Effects of these types one after another, each with a change of this size; the response with all.
fn effects(
    setting: &PowerSetting<'_>,
    kinds: &[&String],
    ratio: f64,
    planted: &mut Injected,
    stream: &Stream,
) -> Option<Vec<f64>> {
    planted.what = kinds.iter().map(|kind| kind.as_str()).collect::<Vec<_>>().join("+");
    let mut truth = Truth {
        system: System::new(setting.experiment, Vec::new()),
        point: setting.fit.at.point[..setting.experiment.parameters.len()].to_vec(),
        response: setting.fit.at.response.clone(),
    };
    for (i, kind) in kinds.iter().enumerate() {
        let stream = stream.at(i as u64);
        let (on, values, next) =
            (0..TRIES).find_map(|i| with_effect(setting, &truth, kind, ratio, &stream.at(i)))?;
        let (layout, known) =
            (&setting.experiment.layouts.blocks[0], &next.system.effects[i].effect);
        planted.sizes.push((values[0] - known.absent(layout)[0]).abs());
        planted.effects.push(((*kind).clone(), on, values));
        truth = next;
    }
    Some(truth.response)
}

/// The calibrated model with the injected effects.
struct Truth<'a> {
    system: System<'a>,
    point: Vec<f64>,
    response: Vec<f64>,
}

/// The truth with an effect of random place and indices whose change has this size.
fn with_effect<'a>(
    setting: &PowerSetting<'a>,
    truth: &Truth<'a>,
    kind: &str,
    ratio: f64,
    stream: &Stream,
) -> Option<(On, Vec<f64>, Truth<'a>)> {
    let mut rng = stream.generator();
    let experiment = setting.experiment;
    let versions: Vec<usize> =
        (0..setting.candidates.len()).filter(|&c| setting.candidates[c].kind == kind).collect();
    let candidate = versions[below(&mut rng, versions.len())];
    let known = &setting.candidates[candidate].effect;
    let places = sensors(experiment);
    let everywhere = match known.reach() {
        _ if places.len() < 2 => true,
        Reach::Whole => true,
        Reach::Single => false,
        Reach::Any => uniform(&mut rng) < 0.3,
    };
    let on = if everywhere { On::new() } else { places[below(&mut rng, places.len())].clone() };
    let placement = Placement { candidate, on: on.clone() };
    let name = format!("planted_{}", truth.system.effects.len());
    let system = truth.system.with(placement.placed(experiment, setting.candidates, &name));
    let layout = &experiment.layouts.blocks[0];
    let noise = setting.noise.sd(experiment, &truth.response);
    let response = &truth.response;
    let situation = Situation { layouts: experiment.layouts, response, noise: &noise };
    let starts = known.starts(layout, &situation);
    let mut values: Vec<f64> = starts.get(below(&mut rng, starts.len().max(1)))?.clone();
    let absent = known.absent(layout)[0];
    let step = values[0] - absent;
    let parameters = known.parameters(layout);
    // Indices are drawn from their priors, because effects at the start values of the fits would be easier to find.
    for (value, parameter) in values.iter_mut().zip(&parameters).skip(1) {
        *value = parameter.prior.quantile(0.05 + 0.9 * uniform(&mut rng));
    }
    let (low, high) = parameters[0].prior.support();
    let at = |share: f64| {
        let size = absent + share * step;
        let values: Vec<f64> = std::iter::once(size).chain(values[1..].iter().copied()).collect();
        let point: Vec<f64> = truth.point.iter().chain(&values).copied().collect();
        let response = system.response(&point);
        let change: Vec<f64> = response.iter().zip(&truth.response).map(|(a, b)| a - b).collect();
        let reached = ratio_of(setting, &change).unwrap_or(0.0);
        let next = Truth { system: system.clone(), point, response };
        (low..=high).contains(&size).then_some((reached, (values, next)))
    };
    let (values, next) = sized(ratio, at)?;
    next.response.iter().all(|y| y.is_finite()).then_some((on, values, next))
}

/// The root mean square of a change over the noise, on the curves that it touches.
fn ratio_of(setting: &PowerSetting<'_>, change: &[f64]) -> Option<f64> {
    let experiment = setting.experiment;
    let noise = setting.noise.sd(experiment, &setting.fit.at.response);
    let (mut sum, mut count) = (0.0, 0.0);
    for curve in &experiment.curves {
        if curve.measured.iter().all(|&i| change[i] == 0.0) {
            continue;
        }
        for &i in curve.measured.iter().filter(|&&i| noise[i] > 0.0) {
            sum += (change[i] / noise[i]).powi(2);
            count += 1.0;
        }
    }
    let ratio = f64::sqrt(sum / f64::max(count, 1.0));
    (ratio > 0.0 && ratio.is_finite()).then_some(ratio)
}
