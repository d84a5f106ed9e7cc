//! Worlds: simulators with a table of runs, replicates measured on them, and what is hidden in the measurements: faults
//! of the measuring chain, and physics inside the simulator.

use crate::hidden::{Kind, distorted, random_shape};
use crate::noise::{Source, replicate};

/// A simulator whose curves are sampled finely.
pub trait World: Sync {
    /// Physics that the model lacks, with its size.
    type Inside: Copy + Send + Sync + std::fmt::Debug;

    /// The name of each parameter, its range, and its value at the middle of the cases.
    fn parameters(&self) -> Vec<(&'static str, [f64; 2], f64)>;

    /// The names of the sensors.
    fn sensors(&self) -> Vec<&'static str>;

    /// The number of conditions.
    fn conditions(&self) -> usize {
        1
    }

    /// The number of fine steps between samples.
    fn fine(&self) -> usize;

    /// The length of a fine step, s.
    fn step(&self) -> f64;

    /// The number of samples of a curve.
    fn samples(&self) -> usize;

    /// The standard deviation of the noise over the root mean square of all curves about their own means.
    fn noise_share(&self) -> f64;

    /// The curves of all sensors at fine sampling.
    fn curves(
        &self,
        parameters: &[f64],
        inside: &[Self::Inside],
        condition: usize,
    ) -> Vec<Vec<f64>>;

    /// The physics that can be hidden.
    fn changes(&self) -> Vec<Change<Self::Inside>>;

    /// The times of the samples, s.
    fn times(&self) -> Vec<f64> {
        (0..self.samples()).map(|i| self.step() * (self.fine() * i) as f64).collect()
    }

    /// The model's response: the samples of all conditions and sensors in turn.
    fn response(&self, parameters: &[f64]) -> Vec<f64> {
        let each = |c| self.sampled(&self.curves(parameters, &[], c)).concat();
        (0..self.conditions()).flat_map(each).collect()
    }

    /// The samples of fine curves.
    fn sampled(&self, fine: &[Vec<f64>]) -> Vec<Vec<f64>> {
        fine.iter().map(|curve| curve.iter().step_by(self.fine()).copied().collect()).collect()
    }

    /// The standard deviation of one replicate's noise, the same on all sensors.
    fn noise(&self) -> f64 {
        let centre: Vec<f64> = self.parameters().iter().map(|p| p.2).collect();
        let response = self.response(&centre);
        let square: f64 = response
            .chunks(self.samples())
            .map(|curve| {
                let mean = curve.iter().sum::<f64>() / curve.len() as f64;
                curve.iter().map(|y| (y - mean).powi(2)).sum::<f64>()
            })
            .sum();
        self.noise_share() * (square / response.len() as f64).sqrt()
    }
}

/// Physics that can be hidden: its name, and how a size makes it.
#[derive(Debug, Clone, Copy)]
pub struct Change<P> {
    /// The name.
    pub name: &'static str,
    /// The physics of a size.
    pub of: fn(f64) -> P,
    /// The range of sizes.
    pub range: [f64; 2],
}

impl<P> Change<P> {
    /// The physics `of` a size between these.
    pub fn new(name: &'static str, of: fn(f64) -> P, low: f64, high: f64) -> Self {
        Self { name, of, range: [low, high] }
    }
}

/// A hidden cause.
#[derive(Debug, Clone, PartialEq)]
pub enum Secret {
    /// A fault of the measuring chain on these sensors.
    Fault(Kind, Vec<usize>),
    /// Physics inside the simulator: an index of [`World::changes`].
    Inside(usize),
}

/// A hidden cause with its size.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The cause.
    pub secret: Secret,
    /// The size, in the unit of its kind.
    pub size: f64,
    /// Times or frequencies of a fault.
    pub shape: [f64; 3],
}

/// Measurements with the answer.
#[derive(Debug, Clone)]
pub struct Measured {
    /// True parameters.
    pub truth: Vec<f64>,
    /// The hidden causes.
    pub hidden: Vec<Found>,
    /// Replicates by condition; each holds the curves of all sensors, concatenated.
    pub replicates: Vec<Vec<Vec<f64>>>,
}

/// Replicates of a world in which causes are hidden, each of a size that changes the curves on which it acts by `ratio`
/// times the noise of one replicate (root mean square, before any calibration).
pub fn measured<W: World>(
    world: &W,
    seed: u64,
    secrets: &[Secret],
    ratio: f64,
    replicates: usize,
) -> Measured {
    let mut random = Source::new(seed);
    let truth: Vec<f64> = world
        .parameters()
        .iter()
        .map(|(_, [low, high], centre)| {
            centre + 0.12 * (high - low) * random.normal().clamp(-2.0, 2.0)
        })
        .collect();
    let sd = world.noise();
    let hidden: Vec<Found> =
        secrets.iter().map(|s| sized(world, s, &truth, sd, ratio, &mut random)).collect();
    let all = vec![sd; world.sensors().len()];
    let of_condition = |condition: usize, random: &mut Source| {
        let curves = world.sampled(&curves(world, &hidden, &truth, condition));
        (0..replicates).map(|_| replicate(&curves, &all, random)).collect()
    };
    let replicates = (0..world.conditions()).map(|c| of_condition(c, &mut random)).collect();
    Measured { truth, hidden, replicates }
}

fn sized<W: World>(
    world: &W,
    secret: &Secret,
    truth: &[f64],
    sd: f64,
    ratio: f64,
    random: &mut Source,
) -> Found {
    let duration = world.step() * (world.fine() * (world.samples() - 1)) as f64;
    let (shape, sign, [mut low, mut high]) = match secret {
        Secret::Fault(kind, _) => {
            // The shapes are drawn for records of 9.9 s.
            let shape = random_shape(*kind, random, duration / 9.9);
            let sign = if kind.one_sided() { 1.0 } else { random.sign() };
            (shape, sign, [0.0, 1e-9])
        }
        Secret::Inside(i) => ([0.0; 3], 1.0, world.changes()[*i].range),
    };
    let mut found = Found { secret: secret.clone(), size: 0.0, shape };
    let change = |found: &mut Found, size: f64| {
        found.size = sign * size;
        change(world, found, truth, sd)
    };
    if matches!(secret, Secret::Fault(..)) {
        while change(&mut found, high) < ratio && high < 1e9 {
            low = high;
            high *= 4.0;
        }
    }
    for _ in 0..40 {
        // Sizes of unknown order: the middle of the logarithms.
        let middle = if low > 0.0 { (low * high).sqrt() } else { 0.5 * high };
        if change(&mut found, middle) < ratio {
            low = middle;
        } else {
            high = middle;
        }
    }
    found
}

/// The root mean square change of the affected curves by a cause, in units of the noise.
fn change<W: World>(world: &W, found: &Found, truth: &[f64], sd: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for condition in 0..world.conditions() {
        let without = world.sampled(&world.curves(truth, &[], condition));
        let with = world.sampled(&curves(world, std::slice::from_ref(found), truth, condition));
        for (s, (a, b)) in with.iter().zip(&without).enumerate() {
            let acts = match &found.secret {
                Secret::Fault(_, sensors) => sensors.contains(&s),
                Secret::Inside(_) => a.iter().zip(b).any(|(x, y)| x != y),
            };
            if acts {
                sum += a.iter().zip(b).map(|(x, y)| ((x - y) / sd).powi(2)).sum::<f64>();
                count += a.len() as f64;
            }
        }
    }
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Fine curves of a condition with everything that is hidden.
fn curves<W: World>(world: &W, hidden: &[Found], truth: &[f64], condition: usize) -> Vec<Vec<f64>> {
    let inside: Vec<W::Inside> = hidden
        .iter()
        .filter_map(|found| match found.secret {
            Secret::Inside(i) => Some((world.changes()[i].of)(found.size)),
            Secret::Fault(..) => None,
        })
        .collect();
    let mut curves = world.curves(truth, &inside, condition);
    for found in hidden {
        let Secret::Fault(kind, sensors) = &found.secret else { continue };
        let all = curves.clone();
        for &s in sensors {
            let other = &all[(s + 1) % all.len()];
            curves[s] = distorted(*kind, found.size, found.shape, &all[s], other, world.step());
        }
    }
    curves
}
