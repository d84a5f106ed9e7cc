//! A sound sampler passes; each planted fault is found.

use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::math::random::normal;
use crate::plugin::Component;
use crate::plugin::sampler::Plan;
use crate::run::Stop;

/// What is wrong with a random walk of Metropolis.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    AcceptsAll,
    NarrowDensity,
    HiddenState,
    AcceptsAnyStart,
    StaleDensity,
    DependsOnThreads,
}

struct Walk {
    fault: Fault,
    calls: AtomicU64,
}

impl Component for Walk {}

impl Sampler for Walk {
    fn plan(&self, _: usize) -> Plan {
        Plan { chains: 30, steps: 3000, warm_up: 0, ensemble: false }
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
        let stream = match self.fault {
            Fault::HiddenState => stream.at(calls),
            Fault::DependsOnThreads => stream.at(rayon::current_num_threads() as u64),
            _ => stream.clone(),
        };
        for chain in 0..state.points.rows() {
            let mut rng = stream.at(chain as u64).generator();
            let point: Vec<f64> = state.points.row(chain).to_vec();
            // Steps in proportion to the scales of both test laws.
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
    ] {
        let found = breaches(fault);
        assert!(found.iter().any(|b| b.contains(expected)), "{expected}: {found:?}");
        assert!(found[0].starts_with("sampler `walk`, "));
    }
}
