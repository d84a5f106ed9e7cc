//! Water hammer in a pipe between a reservoir and a valve, by the method of characteristics (Wylie and Streeter, Fluid
//! Transients in Systems, 1993, chapter 3), with six pressure gauges; and physics that the model lacks.

use std::f64::consts::PI;

use crate::world::{Change, World};

/// Reaches of the pipe.
const REACHES: usize = 40;

/// Length, m, diameter, m, and head of the reservoir, m.
const LENGTH: f64 = 1000.0;
const DIAMETER: f64 = 0.5;
const HEAD: f64 = 100.0;

const GRAVITY: f64 = 9.81;

/// Time between fine samples, s, and samples per measured one.
const STEP: f64 = 0.02;
const FINE: usize = 4;
const SAMPLES: usize = 120;

/// Gauges: places from the reservoir, as shares of the length.
const GAUGES: [(&str, f64); 6] =
    [("p1", 0.15), ("p2", 0.35), ("p3", 0.5), ("p4", 0.7), ("p5", 0.875), ("p6", 1.0)];

/// Physics inside the pipe that the model lacks; the number is its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Inside {
    /// An orifice at 0.6 of the length through which water leaks: its area over that of the pipe.
    Leak(f64),
    /// A throttle at 0.4 of the length: its loss in velocity heads.
    Blockage(f64),
    /// Air at 0.5 of the length: its volume at rest, m3.
    Air(f64),
    /// Friction that also acts on accelerations (Brunone's coefficient).
    UnsteadyFriction(f64),
    /// A wall that creeps, with this share of the elastic compliance, over 0.3 s.
    Creep(f64),
    /// Friction as a lower power of the flow: the power is two less this.
    Exponent(f64),
    /// The level of the reservoir sways by this height, m.
    Swaying(f64),
    /// The valve leaks when closed: this share of its opening.
    LeakingValve(f64),
}

/// The pipe as a world: the parameters are wave speed, friction factor, initial velocity and time of closure.
#[derive(Debug, Clone, Copy)]
pub struct Pipe;

impl World for Pipe {
    type Inside = Inside;

    fn parameters(&self) -> Vec<(&'static str, [f64; 2], f64)> {
        vec![
            ("wave_speed", [1160.0, 1240.0], 1200.0),
            ("friction", [0.012, 0.04], 0.022),
            ("velocity", [0.8, 1.6], 1.2),
            ("closure", [0.85, 1.15], 1.0),
        ]
    }

    fn sensors(&self) -> Vec<&'static str> {
        GAUGES.map(|(name, _)| name).to_vec()
    }

    fn conditions(&self) -> usize {
        2
    }

    fn fine(&self) -> usize {
        FINE
    }

    fn step(&self) -> f64 {
        STEP
    }

    fn samples(&self) -> usize {
        SAMPLES
    }

    fn noise_share(&self) -> f64 {
        0.04
    }

    fn curves(&self, parameters: &[f64], inside: &[Inside], condition: usize) -> Vec<Vec<f64>> {
        let [speed, friction, velocity, closure] =
            [parameters[0], parameters[1], parameters[2], parameters[3]];
        let mut flow = Flow::new(speed, friction, velocity, inside);
        let steps = FINE * (SAMPLES - 1) + 1;
        let mut curves = vec![Vec::with_capacity(steps); GAUGES.len()];
        let (mut before, mut time) = (flow.gauges(), 0.0);
        for k in 0..steps {
            let wanted = STEP * k as f64;
            while time < wanted {
                before = flow.gauges();
                time += flow.step;
                flow.advance(time, opening(condition, time, closure));
            }
            let now = flow.gauges();
            let share = if time > 0.0 { 1.0 - (time - wanted) / flow.step } else { 1.0 };
            for ((curve, a), b) in curves.iter_mut().zip(&before).zip(&now) {
                curve.push(a + share * (b - a));
            }
        }
        curves
    }

    fn changes(&self) -> Vec<Change<Inside>> {
        vec![
            Change::new("leak", Inside::Leak, 1e-6, 0.1),
            Change::new("blockage", Inside::Blockage, 0.01, 1e4),
            Change::new("air", Inside::Air, 1e-6, 1.0),
            Change::new("unsteady friction", Inside::UnsteadyFriction, 1e-4, 0.5),
            Change::new("creep", Inside::Creep, 1e-4, 2.0),
            Change::new("exponent of the friction", Inside::Exponent, 1e-3, 1.9),
            Change::new("swaying reservoir", Inside::Swaying, 1e-3, 50.0),
            Change::new("leaking valve", Inside::LeakingValve, 1e-5, 0.9),
        ]
    }
}

/// The opening of the valve: closed once, or closed by half and opened again.
fn opening(condition: usize, time: f64, closure: f64) -> f64 {
    match condition {
        0 => (1.0 - time / closure).max(0.0).powf(1.5),
        _ => 1.0 - 0.35 * (1.0 - (2.0 * PI * time / (3.0 * closure)).cos()),
    }
}

/// Heads and flows along the pipe.
struct Flow<'a> {
    inside: &'a [Inside],
    step: f64,
    impedance: f64,
    resistance: f64,
    start: f64,
    /// Heads on the upstream and on the downstream side of each node, m.
    head: Vec<[f64; 2]>,
    /// Flows on the upstream and on the downstream side of each node, m3/s.
    discharge: Vec<[f64; 2]>,
    older: Vec<f64>,
    crept: Vec<f64>,
    air: f64,
}

impl<'a> Flow<'a> {
    fn new(speed: f64, friction: f64, velocity: f64, inside: &'a [Inside]) -> Self {
        let area = PI * DIAMETER * DIAMETER / 4.0;
        let reach = LENGTH / REACHES as f64;
        let start = velocity * area;
        let resistance = friction * reach / (2.0 * GRAVITY * DIAMETER * area * area);
        let head = (0..=REACHES).map(|i| [HEAD - i as f64 * resistance * start * start; 2]);
        let air: f64 = inside.iter().map(|p| if let Inside::Air(v) = p { *v } else { 0.0 }).sum();
        Self {
            inside,
            step: reach / speed,
            impedance: speed / (GRAVITY * area),
            resistance,
            start,
            discharge: vec![[start; 2]; REACHES + 1],
            older: vec![start; REACHES + 1],
            crept: vec![0.0; REACHES + 1],
            head: head.collect(),
            air,
        }
    }

    fn sum(&self, of: impl Fn(&Inside) -> f64) -> f64 {
        self.inside.iter().map(of).sum()
    }

    /// The loss of head over a reach.
    fn loss(&self, q: f64, older: f64) -> f64 {
        let less = self.sum(|p| if let Inside::Exponent(e) = p { *e } else { 0.0 });
        let brunone = self.sum(|p| if let Inside::UnsteadyFriction(k) = p { *k } else { 0.0 });
        let scale = (q.abs() / self.start).max(1e-9).powf(-less);
        self.resistance * q * q.abs() * scale + brunone * self.impedance * (q - older)
    }

    fn advance(&mut self, time: f64, opening: f64) {
        let b = self.impedance;
        let creep = self.sum(|p| if let Inside::Creep(c) = p { *c } else { 0.0 });
        let old_head = self.head.clone();
        let old_flow = self.discharge.clone();
        let plus = |i: usize, s: &Self| {
            let q = old_flow[i - 1][1];
            old_head[i - 1][1] + b * q - s.loss(q, s.older[i - 1])
        };
        let minus = |i: usize, s: &Self| {
            let q = old_flow[i + 1][0];
            old_head[i + 1][0] - b * q + s.loss(q, s.older[i + 1])
        };
        let swaying = self.sum(|p| if let Inside::Swaying(h) = p { *h } else { 0.0 });
        let mut head = vec![[0.0; 2]; REACHES + 1];
        let mut flow = vec![[0.0; 2]; REACHES + 1];
        head[0] = [HEAD + swaying * (2.0 * PI * time / 3.7).sin(); 2];
        flow[0] = [(head[0][1] - minus(0, self)) / b; 2];
        for i in 1..REACHES {
            let (cp, cm) = (plus(i, self), minus(i, self));
            let free = (0.5 * (cp + cm), [0.5 * (cp - cm) / b; 2]);
            (head[i], flow[i]) = self.at_node(i, free.0, free.1, [cp, cm]);
        }
        // The valve, an orifice: Q = opening * Q0 sqrt(H / H0).
        let leaking = self.sum(|p| if let Inside::LeakingValve(s) = p { *s } else { 0.0 });
        let cp = plus(REACHES, self);
        let steady = HEAD - REACHES as f64 * self.resistance * self.start * self.start;
        let c = (opening.max(leaking) * self.start).powi(2) / (2.0 * steady);
        let q = -b * c + ((b * c).powi(2) + 2.0 * c * cp.max(0.0)).sqrt();
        flow[REACHES] = [q; 2];
        head[REACHES] = [cp - b * q; 2];
        if creep > 0.0 {
            for (head, crept) in head.iter_mut().zip(&mut self.crept).skip(1) {
                let aim = creep * (head[0] - HEAD);
                let moved = (aim - *crept) * (1.0 - (-self.step / 0.3).exp());
                *crept += moved;
                for side in head {
                    *side -= moved;
                }
            }
        }
        self.older = old_flow.iter().map(|q| q[1]).collect();
        (self.head, self.discharge) = (head, flow);
    }

    /// Heads and flows at a node with what acts there.
    fn at_node(&mut self, i: usize, h: f64, q: [f64; 2], c: [f64; 2]) -> ([f64; 2], [f64; 2]) {
        let b = self.impedance;
        let area = PI * DIAMETER * DIAMETER / 4.0;
        let sides = |h: f64| [(c[0] - h) / b, (h - c[1]) / b];
        let mut answer = ([h; 2], q);
        for physics in self.inside {
            match *physics {
                Inside::Leak(share) if i == REACHES * 3 / 5 => {
                    let out = |h: f64| share * area * (2.0 * GRAVITY * h.max(0.0)).sqrt();
                    // (cp - h) / b - (h - cm) / b = out(h), by bisection.
                    let (mut low, mut high) = (h - b * out(h), h);
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        let [a, d] = sides(middle);
                        if a - d > out(middle) { low = middle } else { high = middle }
                    }
                    let h = 0.5 * (low + high);
                    answer = ([h; 2], sides(h));
                }
                Inside::Blockage(loss) if i == REACHES * 2 / 5 => {
                    let k = loss / (2.0 * GRAVITY * area * area);
                    let difference = c[0] - c[1];
                    // 2 b q + k q |q| = cp - cm.
                    let root = -b + (b * b + k * difference.abs()).sqrt();
                    let through = difference.signum() * root / k.max(1e-12);
                    answer = ([c[0] - b * through, c[1] + b * through], [through; 2]);
                }
                Inside::Air(rest) if i == REACHES / 2 && rest > 0.0 => {
                    // An isothermal volume over one step, absolute head 10 m above that of the gauge.
                    let product = rest * (HEAD + 10.0);
                    let (mut low, mut high) = (h - 200.0, h + 200.0);
                    let change = |h: f64| {
                        let [a, d] = sides(h);
                        self.air + self.step * (d - a) - product / (h + 10.0).max(0.5)
                    };
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        if change(middle) < 0.0 { low = middle } else { high = middle }
                    }
                    let h = 0.5 * (low + high);
                    self.air = product / (h + 10.0).max(0.5);
                    answer = ([h; 2], sides(h));
                }
                _ => {}
            }
        }
        answer
    }

    fn gauges(&self) -> Vec<f64> {
        let at = |share: f64| {
            let place = share * REACHES as f64;
            let k = (place.floor() as usize).min(REACHES - 1);
            let part = place - k as f64;
            self.head[k][1] * (1.0 - part) + self.head[k + 1][0] * part
        };
        GAUGES.iter().map(|(_, share)| at(*share)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In steady flow a throttle takes its loss in velocity heads between its two sides, and the valve sees a head that is
    /// lower by as much.
    #[test]
    fn a_throttle_loses_head() {
        let inside = [Inside::Blockage(20.0)];
        let mut flow = Flow::new(1200.0, 0.022, 1.2, &inside);
        for k in 0..20_000 {
            flow.advance(flow.step * f64::from(k), 1.0);
        }
        let [above, below] = flow.head[REACHES * 2 / 5];
        let area = PI * DIAMETER * DIAMETER / 4.0;
        let velocity = flow.discharge[REACHES][0] / area;
        let lost = 20.0 * velocity * velocity / (2.0 * GRAVITY);
        assert!((above - below - lost).abs() < 1e-3 * lost, "{above} {below} {lost}");
        let friction = 0.022 * LENGTH / DIAMETER * velocity * velocity / (2.0 * GRAVITY);
        let valve = flow.head[REACHES][0];
        assert!((HEAD - friction - lost - valve).abs() < 1e-2, "{valve} {friction} {lost}");
    }
}
