//! Terms with unknowns of their own, compared with exact solutions of one equation in which the term acts alone.

use super::term_forms::{SINGLE, near, response, times};

/// Response from a start with the options of a term, without supply, at values of the coefficient and the unknowns.
fn alone(start: f64, options: &str, values: &[f64]) -> Vec<f64> {
    let body = SINGLE.replace("START", &format!("{start:?}")) + options;
    let point: Vec<f64> = std::iter::once(0.0).chain(values.iter().copied()).collect();
    response(["K/s", "K"], &body, &point)
}

/// Root mean square of the state at the middle of the priors, where the supply is one: a line of slope one less `from`.
pub fn size(start: f64, from: f64) -> f64 {
    let all = times().into_iter().map(|t| (start + t - from).powi(2));
    (all.sum::<f64>() / 40.0).sqrt()
}

/// `dy/dt = -c y (y/s)^(p - 1)`: `y^(1 - p)` grows linearly.
fn by_power(start: f64, c: f64, power: f64, scale: f64) -> impl Fn(f64) -> f64 {
    move |t| {
        let left = start.powf(1.0 - power) + (power - 1.0) * c * scale.powf(1.0 - power) * t;
        left.powf(1.0 / (1.0 - power))
    }
}

/// The bend of the term changes the rate by 1e-4 where the speed has fallen to a twentieth of its scale.
#[test]
fn a_drag_has_a_power() {
    for power in [0.6, 1.5, 2.4] {
        let found = alone(2.0, "use = \"power_friction\"\n", &[0.3, power]);
        near(&found, by_power(2.0, 0.3, power, size(2.0, 0.0)), 3e-5);
    }
}

#[test]
fn a_spring_has_a_power() {
    let options = "use = \"power_stiffness\"\nof = \"y\"\nunit = \"K\"\n";
    for power in [1.5, 5.0] {
        let found = alone(2.0, options, &[0.3, power]);
        near(&found, by_power(2.0, 0.3, power, size(2.0, 0.0)), 1e-5);
    }
}

/// The surroundings are stated here; by default they are what the rate subtracts.
#[test]
fn convection_cools_with_the_power_five_quarters() {
    let options = "use = \"convection\"\nambient = \"293 {K}\"\n";
    let found = alone(353.0, options, &[0.4]);
    let difference = by_power(60.0, 0.4, 1.25, size(353.0, 293.0));
    near(&found, |t| 293.0 + difference(t), 1e-4);
}

/// The excess over a limit decays exponentially; the bend at the limit is a hundredth of the size wide.
#[test]
fn a_limit_opposes_what_exceeds_it() {
    let found = alone(3.0, "use = \"limiter\"\n", &[0.5, 1.2]);
    near(&found, |t| 1.2 + 1.8 * (-0.5 * t).exp(), 2e-3);
}

/// `dy/dt = -2 y + 2 clamp(y, -g, g)` acts on what exceeds the gap only.
#[test]
fn a_dead_zone_leaves_what_is_within() {
    let body = SINGLE.replace("START", "3.0").replace("\"supply\"", "\"supply - 0.5 {1/s} * y\"")
        + "use = \"dead_zone\"\n";
    let found = response(["K/s", "K"], &body, &[0.0, 0.5, 1.2]);
    near(&found, |t| 1.2 + 1.8 * (-0.5 * t).exp(), 4e-3);
}

/// `dy/dt = -c y t / T` with the duration T = 3.9 of the response.
#[test]
fn ageing_grows_with_time() {
    let found = alone(2.0, "use = \"ageing\"\n", &[0.8]);
    near(&found, |t| 2.0 * (-0.8 * t * t / 7.8).exp(), 1e-6);
}

/// `y' = -c z`, `z' = y - z/T`: `y'' + y'/T + c y = 0` from `y = y0`, `y' = 0`.
#[test]
fn a_maxwell_element_is_a_damped_oscillator() {
    let (c, relaxation) = (4.0, 0.9);
    let found = alone(2.0, "use = \"maxwell_damping\"\n", &[c, relaxation]);
    let decay: f64 = 0.5 / relaxation;
    let omega = (c - decay * decay).sqrt();
    let exact =
        |t: f64| 2.0 * (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin());
    near(&found, exact, 1e-5);
}

/// While a body slides one way, `v²/2` falls by the work `c (x - d (1 - exp(-x/d)))`, where `x` is the integral of the
/// speed, here by the trapezoidal rule with its correction at the ends. With power one and elastic unloading
/// the element of Bouc and Wen has the same rate as Dahl's.
#[test]
fn friction_builds_up_over_a_distance() {
    let (c, d) = (0.4, 0.8);
    let dahl = alone(3.0, "use = \"dahl_friction\"\n", &[c, d]);
    let bouc_wen = alone(3.0, "use = \"bouc_wen\"\n", &[c, d, 1.0]);
    // The response begins a step after the start.
    let mut x = 0.1 * 0.5 * (3.0 + dahl[0]);
    let mut before = dahl[0];
    for (i, v) in dahl.iter().enumerate() {
        if i > 0 {
            x += 0.1 * 0.5 * (before + v);
        }
        before = *v;
        let work = c * (x - d * (1.0 - (-x / d).exp()));
        assert!((0.5 * v * v - (4.5 - work)).abs() < 2e-3, "{i}: {v} after {x}");
        assert!((v - bouc_wen[i]).abs() < 2e-3, "{i}: {v} {}", bouc_wen[i]);
    }
}

/// The time after which a state that changes with a rate of its own alone has fallen from `start` to `end`: the integral of
/// its slowness, by Simpson's rule.
fn time_to(start: f64, end: f64, slowness: impl Fn(f64) -> f64) -> f64 {
    let count = 2000;
    let step = (start - end) / f64::from(count);
    let value = |k: i32| slowness(end + step * f64::from(k));
    let odd: f64 = (1..count).step_by(2).map(value).sum();
    let even: f64 = (2..count).step_by(2).map(value).sum();
    step / 3.0 * (value(0) + 4.0 * odd + 2.0 * even + value(count))
}

/// `dy/dt = -c y ((1 + (y/b)²) / (1 + (s/b)²))^((p - 1) / 2)`, where the size `s` is that of a line of slope one from two.
#[test]
fn a_drag_bends() {
    for power in [0.1, 0.7, 2.0] {
        let (c, bend) = (0.4, 0.6);
        let found = alone(2.0, "use = \"carreau_friction\"\n", &[c, power, bend]);
        let bent = |y: f64| 1.0 + (y / bend).powi(2);
        let scale = size(2.0, 0.0);
        let slowness = |y: f64| (bent(y) / bent(scale)).powf(0.5 * (1.0 - power)) / (c * y);
        for (y, t) in found.iter().zip(times()).filter(|(y, _)| **y > 0.05) {
            let exact = time_to(2.0, *y, slowness);
            assert!((exact - t).abs() < 1e-4, "at {t}: {y} is reached at {exact}");
        }
    }
}

/// At speeds far above the width, `dy/dt = -c (1 + r exp(-(y/s)²))` reaches `y` after the integral of its slowness.
#[test]
fn dry_friction_rises_near_rest() {
    let (c, rise, speed) = (0.4, 1.5, 1.1);
    let found =
        alone(3.0, "use = \"stribeck_friction\"\nwidth = \"0.001 {K}\"\n", &[c, rise, speed]);
    let slowness = |y: f64| 1.0 / (c * (1.0 + rise * (-(y / speed).powi(2)).exp()));
    for (y, t) in found.iter().zip(times()).filter(|(y, _)| **y > 0.05) {
        let exact = time_to(3.0, *y, slowness);
        assert!((exact - t).abs() < 1e-5, "at {t}: {y} is reached at {exact}");
    }
}

/// `Γ(x)` by Lanczos' sum as in Press et al., Numerical Recipes, section 6.1.
fn gamma(x: f64) -> f64 {
    let sum = [
        76.180_091_729_471_46,
        -86.505_320_329_416_77,
        24.014_098_240_830_91,
        -1.231_739_572_450_155,
        0.120_865_097_386_617_9e-2,
        -0.539_523_938_495_3e-5,
    ];
    let series =
        sum.iter().zip(1_u8..).fold(1.000_000_000_190_015, |s, (c, k)| s + c / (x + f64::from(k)));
    let base = x + 5.5;
    ((x + 0.5) * base.ln() - base + (2.506_628_274_631_000_5 * series / x).ln()).exp()
}

/// `dy/dt = -λ I^(1 - a) y` has the solution `y0 E(-λ t^(2 - a))` with the function of Mittag-Leffler of order `2 - a`
/// (Diethelm, The Analysis of Fractional Differential Equations, 2010, chapter 4). The ten rates reproduce it within two per cent.
#[test]
fn fractional_damping_has_the_solution_of_mittag_leffler() {
    let (low, high): (f64, f64) = (1.0 / (30.0 * 3.9), 3.0 / 0.1);
    let reference = (low * high).sqrt();
    for order in [0.3, 0.5, 0.8] {
        let lambda = 1.2;
        let c = lambda * reference.powf(order);
        let found = alone(1.0, "use = \"fractional_damping\"\n", &[c, order]);
        let exact = |t: f64| {
            let each = (0..40).map(|k| {
                let power = (-lambda * t.powf(2.0 - order)).powi(k);
                power / gamma((2.0 - order) * f64::from(k) + 1.0)
            });
            each.sum::<f64>()
        };
        near(&found, exact, 0.02);
    }
}
