use super::*;

fn two_clouds(count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = Stream::root(seed).generator();
    let one = |_| {
        let right = uniform(&mut rng) < 0.3;
        let centre = if right { [3.0, 1.0] } else { [-1.0, 0.0] };
        let (a, b) = (normal(&mut rng), normal(&mut rng));
        vec![centre[0] + 0.5 * a, centre[1] + 0.3 * a + 0.4 * b]
    };
    (0..count).map(one).collect()
}

/// The fit loses as much log density per draw against the true density as there are free numbers per two draws, in
/// expectation (Wilks 1938): eleven numbers of two components, here with a margin of four.
#[test]
fn a_mixture_is_found_in_its_draws() {
    let (draws, others) = (two_clouds(3000, 1), two_clouds(2000, 2));
    let fit = Mixture::fit(&draws, &others, &Stream::root(0)).unwrap();
    assert!((2..=4).contains(&fit.count()), "{}", fit.count());
    let fresh = two_clouds(20_000, 3);
    let truth = |z: &[f64]| {
        let density = |c: [f64; 2]| {
            let a = (z[0] - c[0]) / 0.5;
            let b = (z[1] - c[1] - 0.3 * a) / 0.4;
            -0.5 * (a * a + b * b) - (0.2_f64).ln() - 2.0 * HALF_LN_TWO_PI
        };
        log_sum(
            [0.7_f64.ln() + density([-1.0, 0.0]), 0.3_f64.ln() + density([3.0, 1.0])].into_iter(),
        )
    };
    let exact = fresh.iter().map(|z| truth(z)).sum::<f64>() / fresh.len() as f64;
    let lost = exact - fit.mean_log_density(&fresh);
    assert!((0.0..4.0 * 11.0 / 6000.0).contains(&lost), "{lost}");
    let mut rng = Stream::root(4).generator();
    let right = (0..10_000).filter(|_| fit.sample(&mut rng)[0] > 1.0).count() as f64 / 1e4;
    assert!((right - 0.3).abs() < 4.0 * (0.21_f64 / 1e4 + 0.21 / 3000.0).sqrt(), "{right}");
}

#[test]
fn slopes_are_those_of_finite_differences() {
    let fit = Mixture::fit(&two_clouds(500, 1), &two_clouds(300, 2), &Stream::root(0)).unwrap();
    for z in two_clouds(20, 9) {
        let slopes = fit.slopes(&z);
        for j in 0..2 {
            let at = |by: f64| {
                let mut moved = z.clone();
                moved[j] += by;
                fit.log_density(&moved)
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((slopes[j] - difference).abs() < 1e-6 * (1.0 + difference.abs()));
        }
    }
}
