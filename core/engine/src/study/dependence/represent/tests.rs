//! Shapes that no normal distribution has: represented, or the poor representation stated.

use super::*;
use lacuna::math::random::normal;
use lacuna::math::random::uniform;

fn sample(
    dimension: usize,
    mut draw: impl FnMut(&mut dyn FnMut() -> f64, f64) -> Vec<f64>,
) -> Sample {
    let mut rng = Stream::root(21).generator();
    let mut chain = || -> Vec<Vec<f64>> {
        (0..1000)
            .map(|_| {
                let u = uniform(&mut rng);
                draw(&mut || normal(&mut rng), u)
            })
            .collect()
    };
    let chains: Vec<_> = (0..4).map(|_| chain()).collect();
    let supports = vec![(f64::NEG_INFINITY, f64::INFINITY); dimension];
    Sample { chains, supports, effective: 4000.0 }
}

fn represented(sample: &Sample) -> Density {
    let density = Density::of(sample).unwrap();
    let check = density.check;
    assert!(!check.is_poor() && check.energy.coefficient < 0.1, "{check:?}");
    density
}

/// A banana: the mean of the second number given the first is its square (Haario et al., Bernoulli 7 (2001) 223).
#[test]
fn a_banana_is_represented() {
    let banana = sample(2, |normal, _| {
        let x = normal();
        vec![x, x * x + 0.3 * normal()]
    });
    let density = represented(&banana);
    let mixture = density.copula.unwrap();
    assert!(mixture.count() > 1);
    let laws: Vec<&Distribution> = density.marginals.iter().collect();
    let copula = Copula::Mixture(mixture);
    let mut rng = Stream::root(1).generator();
    let residual = |x: &[f64]| x[1] - x[0] * x[0];
    let count = 4000;
    let drawn: Vec<f64> = (0..count).map(|_| residual(&copula.sample(&laws, &mut rng))).collect();
    let spread = lacuna::math::moments::variance(&drawn).sqrt();
    // A normal distribution with these moments has residuals of standard deviation above 1.4.
    assert!(spread < 0.6, "{spread}");
}

/// Two modes, one of a quarter of the draws: the shares are kept, and the share outside of both, which is empty, is no larger
/// than the stated divergence allows by Pinsker's inequality (the total variation is at most the root of half of it).
#[test]
fn two_modes_are_represented() {
    let modes = sample(2, |normal, u| {
        let centre = if u < 0.25 { 4.0 } else { -4.0 };
        vec![centre + normal(), centre + normal()]
    });
    let density = represented(&modes);
    let stated = density.check.divergence;
    let laws: Vec<&Distribution> = density.marginals.iter().collect();
    let copula = Copula::Mixture(density.copula.unwrap());
    let mut rng = Stream::root(2).generator();
    let count = 4000;
    let drawn: Vec<Vec<f64>> = (0..count).map(|_| copula.sample(&laws, &mut rng)).collect();
    let share = |f: &dyn Fn(&[f64]) -> bool| {
        drawn.iter().filter(|x| f(x)).count() as f64 / f64::from(count)
    };
    let right = share(&|x| x[0] > 0.0);
    assert!((right - 0.25).abs() < 4.0 * (2.0 * 0.1875_f64 / f64::from(count)).sqrt(), "{right}");
    let outside = share(&|x| x[0] * x[1] < 0.0);
    let allowed = (0.5 * (stated.value.max(0.0) + 3.0 * stated.error)).sqrt();
    println!("outside of both modes: {outside}, allowed {allowed}, {stated:?}");
    assert!(outside < allowed.min(0.1), "{outside} {allowed}");
}

/// A thin spiral, which a dozen normal distributions do not describe.
#[test]
fn a_poor_representation_is_stated() {
    let spiral = sample(2, |normal, u| {
        let angle = 25.0 * u;
        vec![angle * angle.cos() + 0.1 * normal(), angle * angle.sin() + 0.1 * normal()]
    });
    let check = Density::of(&spiral).unwrap().check;
    assert!(check.is_poor() && check.divergence.value > 0.3, "{check:?}");
}

#[test]
fn too_few_draws_make_no_density() {
    let few = Sample {
        chains: vec![vec![vec![0.0, 1.0]; 30]],
        supports: vec![(f64::NEG_INFINITY, f64::INFINITY); 2],
        effective: 30.0,
    };
    assert!(Density::of(&few).is_none());
}
