//! A correct sampler passes; each planted fault is found.

use std::sync::atomic::{AtomicU64, Ordering};

use lacuna::math::random::{below, normal, uniform};
use lacuna::matrix::Matrix;
use lacuna::plugin::Component;
use lacuna::plugin::sampler::{Evidence, Plan};
use lacuna::run::Stop;

use super::*;

/// Faults of a random-walk Metropolis sampler.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    AcceptsAll,
    NarrowDensity,
    HiddenState,
    AcceptsAnyStart,
    StaleDensity,
    DependsOnThreads,
    ForgetsItsScale,
    NoDraws,
    Panics,
}

struct Walk {
    fault: Fault,
    calls: AtomicU64,
}

impl Component for Walk {}

impl Sampler for Walk {
    fn plan(&self, _: usize) -> Plan {
        let warm_up = match self.fault {
            Fault::NoDraws => 3000,
            Fault::ForgetsItsScale | Fault::None => 300,
            _ => 0,
        };
        Plan { chains: 30, steps: 3000, warm_up, ensemble: false }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        let log_density = target.log_density(&points);
        let sound = points.rows() == 30 && log_density.iter().all(|l| l.is_finite());
        if !sound && self.fault != Fault::AcceptsAnyStart {
            return Err(Stop::new("bad starting points"));
        }
        let count = points.rows();
        let memory = serde_json::Value::Null;
        Ok(State { points, log_density, accepted: vec![false; count], evaluations: 30, memory })
    }

    fn step(&self, target: &dyn Target, state: &mut State, stream: &Stream) -> Result<(), Stop> {
        let calls = self.calls.fetch_add(1, Ordering::Relaxed);
        assert!(self.fault != Fault::Panics, "as planted");
        // The warm-up of the correct sampler does not move: its steps are not draws.
        let warm = state.memory.as_u64().unwrap_or(0);
        state.memory = (warm + 1).into();
        if self.fault == Fault::None && warm < 300 {
            state.accepted.fill(false);
            return Ok(());
        }
        let forgotten = self.fault == Fault::ForgetsItsScale && calls > 310;
        let stream = match self.fault {
            Fault::HiddenState => stream.at(calls),
            Fault::DependsOnThreads => stream.at(rayon::current_num_threads() as u64),
            _ => stream.clone(),
        };
        let stream = if forgotten { stream.at(calls) } else { stream };
        for chain in 0..state.points.rows() {
            let mut rng = stream.at(chain as u64).generator();
            let point: Vec<f64> = state.points.row(chain).to_vec();
            // Step sizes in proportion to the scales of both test densities.
            let scale = if target.bounds()[1].1 == 1.0 { [1.0, 0.3] } else { [0.8, 48.0] };
            let next: Vec<f64> =
                point.iter().zip(scale).map(|(x, s)| x + s * normal(&mut rng)).collect();
            let next = Matrix::from_rows(2, [next]);
            let new = target.log_density(&next)[0];
            let mut ratio = new - state.log_density[chain];
            if self.fault == Fault::NarrowDensity {
                ratio *= 1.2;
            }
            state.accepted[chain] =
                self.fault == Fault::AcceptsAll || uniform(&mut rng).ln() < ratio;
            if state.accepted[chain] {
                state.points.row_mut(chain).copy_from_slice(next.row(0));
                if self.fault != Fault::StaleDensity {
                    state.log_density[chain] = new;
                }
            }
        }
        Ok(())
    }
}

fn breaches(fault: Fault) -> Vec<String> {
    let walk = Walk { fault, calls: AtomicU64::new(0) };
    sampler("walk", &walk).err().unwrap_or_default()
}

#[test]
fn a_sound_sampler_passes() {
    assert_eq!(breaches(Fault::None), Vec::<String>::new());
}

#[test]
fn each_fault_is_found() {
    for (fault, expected) in [
        (Fault::AcceptsAll, "a chain is outside the support"),
        (Fault::NarrowDensity, "draws a normal law: the sd of coordinate"),
        (Fault::HiddenState, "the continued chain is another one"),
        (Fault::AcceptsAnyStart, "a point outside the support is accepted"),
        (Fault::StaleDensity, "a log density is not that of its point"),
        (Fault::DependsOnThreads, "one and three threads differ"),
        // The state is lost only at the end of the warm-up.
        (Fault::ForgetsItsScale, "the continued chain is another one"),
        (Fault::NoDraws, "a warm-up of 3000 leaves no draws of 3000 steps"),
        (Fault::Panics, "makes it panic"),
    ] {
        let found = breaches(fault);
        assert!(found.iter().any(|b| b.contains(expected)), "{expected}: {found:?}");
        assert!(found[0].starts_with("sampler `walk`, "));
    }
}

/// Faults of a sampler that weights and resamples draws of the prior.
#[derive(Clone, Copy, PartialEq)]
enum Slip {
    None,
    Unweighted,
    WrongEvidence,
    WildEvidence,
    InOrder,
    WorthTooMany,
    StaleDensity,
    DependsOnThreads,
    NeverFinishes,
}

struct Weighted(Slip);

const POPULATION: usize = 20_000;
const KEPT: usize = 4000;

impl Component for Weighted {}

impl Sampler for Weighted {
    fn plan(&self, _: usize) -> Plan {
        Plan { chains: 10, steps: 1000, warm_up: 1000, ensemble: true }
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        let log_density = target.log_density(&points);
        if points.rows() != 10 || !log_density.iter().all(|l| l.is_finite()) {
            return Err(Stop::new("bad starting points"));
        }
        let memory = 0_u64.into();
        Ok(State { points, log_density, accepted: vec![false; 10], evaluations: 10, memory })
    }

    fn step(&self, _: &dyn Target, state: &mut State, _: &Stream) -> Result<(), Stop> {
        let step = state.memory.as_u64().unwrap_or(0);
        assert!(step < 9, "a step after the last");
        state.memory = (step + 1).into();
        Ok(())
    }

    fn finished(&self, state: &State) -> bool {
        self.0 != Slip::NeverFinishes && state.memory == 9
    }

    fn harvest(
        &self,
        target: &dyn Target,
        state: &State,
        stream: &Stream,
    ) -> Result<Option<Harvest>, Stop> {
        if !self.finished(state) {
            return Err(Stop::new("not yet"));
        }
        let stream = match self.0 {
            Slip::DependsOnThreads => stream.at(rayon::current_num_threads() as u64),
            _ => stream.clone(),
        };
        let points = target.prior_draws(POPULATION, &stream.named("prior"));
        let (density, prior) = (target.log_density(&points), target.log_prior(&points));
        let weights: Vec<f64> = density.iter().zip(&prior).map(|(d, p)| (d - p).exp()).collect();
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let mut rng = stream.generator();
        let mut drawn = Vec::new();
        while drawn.len() < KEPT {
            let i = below(&mut rng, POPULATION);
            if self.0 == Slip::Unweighted || uniform(&mut rng) * largest < weights[i] {
                drawn.push(i);
            }
        }
        if self.0 == Slip::InOrder {
            drawn.sort_by(|&a, &b| density[a].total_cmp(&density[b]));
        }
        let error = (variance(&weights) / POPULATION as f64).sqrt() / mean(&weights);
        let log = mean(&weights).ln() + if self.0 == Slip::WrongEvidence { 0.2 } else { 0.0 };
        let error = if self.0 == Slip::WildEvidence { 5.0 } else { error };
        let mut log_density: Vec<f64> = drawn.iter().map(|&i| density[i]).collect();
        if self.0 == Slip::StaleDensity {
            log_density.rotate_left(1);
        }
        let size = if self.0 == Slip::WorthTooMany { 2.0 } else { 0.5 };
        Ok(Some(Harvest {
            points: points.select_rows(&drawn),
            log_density,
            effective_size: size * KEPT as f64,
            evidence: Some(Evidence { log, error, method: "weights".into() }),
            ..Harvest::default()
        }))
    }
}

#[test]
fn a_sound_harvest_passes() {
    assert_eq!(sampler("weighted", &Weighted(Slip::None)), Ok(()));
}

#[test]
fn each_slip_of_a_harvest_is_found() {
    for (slip, expected) in [
        (Slip::Unweighted, "draws a normal law: the mean of coordinate 1"),
        (Slip::WrongEvidence, "keeps sound states: the log evidence is"),
        (Slip::WildEvidence, "the log evidence has the error 5"),
        (Slip::InOrder, "the halves of the harvest differ by"),
        (Slip::WorthTooMany, "4000 draws of the harvest are said to be worth 8000"),
        (Slip::StaleDensity, "a log density of the harvest is not that of its point"),
        (Slip::DependsOnThreads, "one and three threads differ"),
        (Slip::NeverFinishes, "makes it panic"),
    ] {
        let found = sampler("weighted", &Weighted(slip)).err().unwrap_or_default();
        assert!(found.iter().any(|b| b.contains(expected)), "{expected}: {found:?}");
    }
}
