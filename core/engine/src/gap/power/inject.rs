//! The injected effects, and the response with them.

use lacuna::math::random::{Stream, below, uniform};
use lacuna::plugin::effect::{On, Reach, Situation};
use serde::{Deserialize, Serialize};

use super::{PowerDesign, PowerSetting};
use crate::gap::candidates::{Candidate, Placement, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::system::System;
use crate::gap::test::Region;

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
    /// A change that no candidate can reproduce.
    Unlisted(UnlistedShape, f64),
}

/// A shape that no effect of the library has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnlistedShape {
    /// Time runs faster from the middle of the record on, on all curves of one condition.
    Stretch,
    /// Each curve has a part of its own reversed copy.
    Reversed,
    /// A swelling and fading oscillation whose frequency rises, on half of the curves.
    Chirp,
}

impl UnlistedShape {
    const ALL: [Self; 3] = [Self::Stretch, Self::Reversed, Self::Chirp];
}

/// The injection of a case.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Injected {
    /// The injection in words: `nothing`, `bump`, or the types.
    pub what: String,
    /// The effects: type, place and values of the unknowns.
    pub effects: Vec<(String, On, Vec<f64>)>,
    /// The distance of the first unknown of each effect from its absent value, in its unit.
    pub sizes: Vec<f64>,
    /// The root mean square change of each over the standard deviation of the noise of one replicate.
    pub ratio: f64,
    /// The bump, if there is one.
    pub bump: Option<Bump>,
}

/// A bump on one curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bump {
    /// The index of the curve.
    pub curve: usize,
    /// The indices of the first and the last of its measured values.
    pub window: (usize, usize),
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
    all.extend(
        (0..design.unlisted).map(|i| Injection::Unlisted(UnlistedShape::ALL[i % 3], largest)),
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
        Injection::Unlisted(shape, ratio) => {
            planted.what = "unlisted".into();
            planted.ratio = *ratio;
            let change = unlisted(setting.experiment, *shape, &response, stream);
            let scale = ratio / ratio_of(setting, &change)?;
            response.iter_mut().zip(&change).for_each(|(y, c)| *y += scale * c);
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
        (low..=high).contains(&size).then_some((reached, values, next))
    };
    // The change grows with the size: the size is doubled until the change is large enough, then the interval is
    // bisected.
    let (mut small, mut large) = (0.0, SMALLEST);
    while at(large)?.0 < ratio {
        (small, large) = (large, 2.0 * large);
        if large > LARGEST {
            return None;
        }
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (small + large);
        if at(middle)?.0 < ratio {
            small = middle;
        } else {
            large = middle;
        }
    }
    let (_, values, next) = at(large)?;
    next.response.iter().all(|y| y.is_finite()).then_some((on, values, next))
}

/// The smallest size that is tried, relative to a start of the effect.
const SMALLEST: f64 = 1e-3;
/// The largest size that is tried, relative to a start of the effect.
const LARGEST: f64 = 1e6;
/// The number of bisections of the interval that holds the size.
const HALVINGS: usize = 30;

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

/// A half sine over a tenth to a third of one curve; its size is the root mean square over itself.
fn add_bump(
    setting: &PowerSetting<'_>,
    ratio: f64,
    response: &mut [f64],
    stream: &Stream,
) -> Option<Bump> {
    let mut rng = stream.generator();
    let long: Vec<usize> = (0..setting.experiment.curves.len())
        .filter(|&s| setting.experiment.curves[s].measured.len() >= 20)
        .collect();
    if long.is_empty() {
        return None;
    }
    let curve = long[below(&mut rng, long.len())];
    let measured = &setting.experiment.curves[curve].measured;
    let share = 0.1 + 0.25 * uniform(&mut rng);
    let width = ((share * measured.len() as f64) as usize).max(4);
    let begin = below(&mut rng, measured.len() - width);
    let noise = setting.noise.sd(setting.experiment, &setting.fit.at.response);
    for (k, &i) in measured[begin..begin + width].iter().enumerate() {
        let phase = std::f64::consts::PI * (k as f64 + 0.5) / width as f64;
        response[i] += ratio * std::f64::consts::SQRT_2 * noise[i] * phase.sin();
    }
    Some(Bump { curve, window: (begin, begin + width - 1) })
}

impl Bump {
    /// The intersection over union of the bump with the regions, zero to one.
    pub fn overlap(&self, experiment: &Experiment<'_>, regions: &[Region]) -> f64 {
        let (mut found, mut both) = (0, 0);
        for (s, curve) in experiment.curves.iter().enumerate() {
            for k in 0..curve.measured.len() {
                let inside = |r: &Region| {
                    r.curves.contains(&s) && (r.span.0..=r.span.1).contains(&curve.at[k])
                };
                let is_found = regions.iter().any(inside);
                found += usize::from(is_found);
                let is_bump = s == self.curve && (self.window.0..=self.window.1).contains(&k);
                both += usize::from(is_found && is_bump);
            }
        }
        let bump = self.window.1 - self.window.0 + 1;
        both as f64 / (found + bump - both) as f64
    }
}

/// The change that a shape makes, of arbitrary size.
fn unlisted(
    experiment: &Experiment<'_>,
    shape: UnlistedShape,
    response: &[f64],
    stream: &Stream,
) -> Vec<f64> {
    let mut rng = stream.generator();
    let condition = below(&mut rng, experiment.conditions.len());
    let (middle, turns) = (0.3 + 0.4 * uniform(&mut rng), 2.0 + 4.0 * uniform(&mut rng));
    let mut change = vec![0.0; response.len()];
    for (s, curve) in experiment.curves.iter().enumerate() {
        let length = curve.measured.len();
        if length < 3 {
            continue;
        }
        let value = |k: usize| response[curve.measured[k]];
        let largest = (0..length).map(|k| value(k).abs()).fold(0.0, f64::max).max(1e-300);
        for k in 0..length {
            let share = k as f64 / (length - 1) as f64;
            let moved = match shape {
                UnlistedShape::Stretch if curve.condition == condition && share > middle => {
                    let slope = value((k + 1).min(length - 1)) - value(k - 1);
                    (share - middle) * slope
                }
                UnlistedShape::Reversed => value(length - 1 - k),
                UnlistedShape::Chirp if s % 2 == 0 => {
                    let envelope = (std::f64::consts::PI * share).sin().powi(2);
                    largest * envelope * (std::f64::consts::TAU * turns * share * share).sin()
                }
                _ => 0.0,
            };
            change[curve.measured[k]] = moved;
        }
    }
    change
}
