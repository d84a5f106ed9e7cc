//! Changes of another form than those of the candidates: an open world in the user's own study.
//!
//! A candidate that is merely near such a change must not be named as if it were the cause. Each change is compared with
//! the library by a [`Screen`], which tells the candidates that come nearest; the right answers follow from it.

mod distributed;
mod forms;
mod grammar;
mod record;
mod screen;
mod shapes;

use lacuna::math::random::{Stream, below, uniform};
use rand::Rng;
use serde::{Deserialize, Serialize};

use self::grammar::Expression;
use self::record::Record;
use super::sized::sized;
use super::{Outside, ratio_of};
use crate::gap::candidates::{place, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::power::{ABSORBED, PowerSetting, absorbed};

pub use distributed::Distributed;
pub use forms::OtherForm;
pub use screen::{NEAR, Nearest, Screen};
pub use shapes::UnlistedShape;

/// A kind of changes outside the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutsideKind {
    /// A fixed shape.
    Shape(UnlistedShape),
    /// A random term of a grammar.
    Grammar,
    /// Listed physics in another form.
    Form(OtherForm),
    /// Physics that varies along the sensors.
    Distributed(Distributed),
}

impl OutsideKind {
    /// All kinds in a cycle, terms of the grammar several times; each beginning of it holds all sorts.
    pub fn all() -> Vec<Self> {
        let shapes = UnlistedShape::ALL.map(Self::Shape);
        let forms = OtherForm::ALL.map(Self::Form);
        let along = Distributed::ALL.map(Self::Distributed);
        let mut all = Vec::new();
        for (i, form) in forms.into_iter().enumerate() {
            all.push(Self::Grammar);
            all.push(form);
            all.extend(along.get(i));
            all.extend(shapes.get(i));
        }
        all
    }

    /// The kind in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Shape(UnlistedShape::Stretch) => "time that runs faster",
            Self::Shape(UnlistedShape::Reversed) => "reversed copy",
            Self::Shape(UnlistedShape::Chirp) => "rising frequency",
            Self::Grammar => "random term",
            Self::Form(OtherForm::Drag) => "drag of another power",
            Self::Form(OtherForm::StretchedExponential) => "stretched exponential",
            Self::Form(OtherForm::OneSidedClip) => "one-sided clip",
            Self::Form(OtherForm::DeadZone) => "dead zone",
            Self::Form(OtherForm::SecondOrder) => "filter of second order",
            Self::Form(OtherForm::DispersiveDelay) => "delay by frequency",
            Self::Distributed(Distributed::Damping) => "damping along the sensors",
            Self::Distributed(Distributed::Gain) => "gain along the sensors",
            Self::Distributed(Distributed::Delay) => "delay along the sensors",
            Self::Distributed(Distributed::Echo) => "echo along the sensors",
            Self::Distributed(Distributed::Pulse) => "travelling pulse",
        }
    }

    /// The sort in words.
    pub const fn sort(self) -> &'static str {
        match self {
            Self::Shape(_) => "fixed shape",
            Self::Grammar => "term of a grammar",
            Self::Form(_) => "other form",
            Self::Distributed(_) => "distributed",
        }
    }
}

/// The curves on which a change acts.
struct Curves<'a> {
    experiment: &'a Experiment<'a>,
    records: Vec<Record>,
    /// The index of the sensor of each curve.
    sensor: Vec<usize>,
}

impl<'a> Curves<'a> {
    fn of(setting: &PowerSetting<'a>) -> Self {
        let experiment = setting.experiment;
        let response = &setting.fit.at.response;
        let places = sensors(experiment);
        let each = experiment.curves.iter().zip(setting.places);
        let records = each.map(|(curve, place)| Record::of(curve, response, *place)).collect();
        let sensor = |curve| places.iter().position(|on| *on == place(curve)).unwrap_or(0);
        Self { experiment, records, sensor: experiment.curves.iter().map(sensor).collect() }
    }

    fn sensors(&self) -> usize {
        self.sensor.iter().max().map_or(0, |last| last + 1)
    }

    /// Random curves: all of them, or those of some sensors, or of one condition.
    fn some(&self, rng: &mut impl Rng) -> Vec<bool> {
        let (sensors, conditions) = (self.sensors(), self.experiment.conditions.len());
        let count = if uniform(rng) < 0.3 {
            sensors
        } else {
            1 + (uniform(rng).powi(2) * sensors as f64) as usize
        };
        let first = below(rng, sensors.max(1));
        let condition = (uniform(rng) < 0.3).then(|| below(rng, conditions));
        let near = |s: usize| (s + sensors - first) % sensors.max(1) < count;
        let acts = |(curve, s): (&crate::gap::experiment::MeasuredCurve, &usize)| {
            near(*s) && condition.is_none_or(|c| c == curve.condition)
        };
        self.experiment.curves.iter().zip(&self.sensor).map(acts).collect()
    }
}

/// The values of a record with a change of some size: from none at zero.
type Change = Box<dyn Fn(&Record, f64) -> Vec<f64>>;

/// A change that was drawn.
struct Drawn {
    /// The form in words.
    form: String,
    /// True for the curves on which it acts.
    acts: Vec<bool>,
    /// The values with it.
    change: Change,
}

impl Drawn {
    fn of(
        form: String,
        acts: Vec<bool>,
        change: impl Fn(&Record, f64) -> Vec<f64> + 'static,
    ) -> Self {
        Self { form, acts, change: Box::new(change) }
    }

    /// A change that adds its size times a curve.
    fn sum(form: String, acts: Vec<bool>, curve: impl Fn(&Record) -> Vec<f64> + 'static) -> Self {
        Self::of(form, acts, move |record, size| {
            let added = curve(record);
            record.y.iter().zip(added).map(|(y, add)| y + size * add).collect()
        })
    }

    fn random(kind: OutsideKind, curves: &Curves<'_>, rng: &mut impl Rng) -> Option<Self> {
        match kind {
            OutsideKind::Shape(shape) => Some(shape.drawn(curves, rng)),
            OutsideKind::Form(form) => Some(form.drawn(curves, rng)),
            OutsideKind::Distributed(distributed) => distributed.drawn(curves, rng),
            OutsideKind::Grammar => {
                let acts = curves.some(rng);
                let term = Expression::random(rng);
                Some(Self::sum(term.text(), acts, move |record| term.values(record)))
            }
        }
    }

    /// The response with the change at this size; `None` where it is not finite.
    fn response(&self, curves: &Curves<'_>, base: &[f64], size: f64) -> Option<Vec<f64>> {
        let mut response = base.to_vec();
        let each = curves.experiment.curves.iter().zip(&curves.records).zip(&self.acts);
        for ((curve, record), _) in each.filter(|((_, record), acts)| **acts && record.len() > 2) {
            for (&i, y) in curve.measured.iter().zip((self.change)(record, size)) {
                response[i] = record.scale * y;
            }
        }
        response.iter().all(|y| y.is_finite()).then_some(response)
    }
}

/// The number of draws until a form is accepted.
const DRAWS: u64 = 60;

/// A change of this kind and size, and the response with it; `None` if none can be made so large, if the parameters
/// absorb all that are drawn, or, for terms of the grammar, if a candidate explains all that are drawn.
pub(super) fn outside(
    setting: &PowerSetting<'_>,
    kind: OutsideKind,
    ratio: f64,
    stream: &Stream,
) -> Option<(Outside, Vec<f64>)> {
    let curves = Curves::of(setting);
    let base = &setting.fit.at.response;
    (0..DRAWS).find_map(|rejected| {
        let mut rng = stream.at(rejected).generator();
        let drawn = Drawn::random(kind, &curves, &mut rng)?;
        let change = |response: &[f64]| -> Vec<f64> {
            response.iter().zip(base).map(|(a, b)| a - b).collect()
        };
        let response = sized(ratio, |size| {
            let response = drawn.response(&curves, base, size)?;
            Some((ratio_of(setting, &change(&response)).unwrap_or(0.0), response))
        })?;
        if absorbed(setting, &response) > ABSORBED {
            return None;
        }
        let nearest = setting.screen.nearest(&change(&response), &drawn.acts)?;
        let is_listed = kind == OutsideKind::Grammar && nearest.explained >= NEAR;
        let form = drawn.form;
        (!is_listed).then_some((Outside { kind, form, nearest, rejected }, response))
    })
}
