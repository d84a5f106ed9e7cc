//! Plugins of a library that panic: each panic becomes an error that names library and call, and the program continues.

use lacuna::data::{Layout, Measurements, Replicate};
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::registry::{self, Built};
use lacuna::plugin::sampler::Start;
use lacuna::plugin::{Discrepancy, Likelihood, Sampler, Target};
use lacuna_linalg::Matrix;

use super::twin;

fn panicking(call: &str) -> Built<dyn Discrepancy> {
    twin();
    registry::from_text("panicking", &format!("call = \"{call}\""))
        .unwrap_or_else(|e| panic!("{e}"))
}

fn likelihood(built: &Built<dyn Discrepancy>) -> Result<Box<dyn Likelihood>, String> {
    let replicates = vec![Replicate::new("1".to_owned(), vec![Some(1.0)])];
    let data = Measurements::new(Layout::number("y"), replicates);
    built.plugin.likelihood(&Known::without_slopes(&data, &[])).map_err(|stop| stop.to_string())
}

/// Name of the library's file in messages.
fn library() -> String {
    twin().file()
}

/// One call of a likelihood.
type Ask<'a> = &'a dyn Fn(&dyn Likelihood);

#[test]
fn a_panic_of_a_discrepancy_is_an_error_or_a_fault() {
    let said = likelihood(&panicking("likelihood")).map(|_| ()).unwrap_err();
    assert_eq!(
        said,
        format!("discrepancy `panicking` of {}: `likelihood` panicked: as I was told", library())
    );
    let stream = Stream::root(1);
    for (call, ask) in [
        (
            "log_likelihood",
            &(|l: &dyn Likelihood| assert!(!l.log_likelihood(&[0.0], &[1.0]).is_nan())) as Ask<'_>,
        ),
        ("gradient", &|l: &dyn Likelihood| drop(l.gradient(&[0.0], &[1.0]))),
        ("predictive", &|l: &dyn Likelihood| drop(l.predictive(&[0.0], &[1.0]))),
        ("simulate", &|l: &dyn Likelihood| drop(l.simulate(&[0.0], &[1.0], &stream))),
    ] {
        let likelihood = likelihood(&panicking(call)).unwrap();
        ask(&*likelihood);
        let said = likelihood.failure().unwrap();
        assert_eq!(
            said,
            format!("discrepancy `panicking` of {}: `{call}` panicked: as I was told", library())
        );
    }
    let built = panicking("takes_stated_noise");
    assert!(!built.plugin.takes_stated_noise());
    let said = format!(
        "discrepancy `panicking` of {}: `takes_stated_noise` panicked: as I was told",
        library()
    );
    assert_eq!(built.plugin.faults()[0].said(), Some(&*said));
    let data = Measurements::new(Layout::number("y"), Vec::new());
    let known = Known::without_slopes(&data, &[]);
    let of_part = |call| panicking(call).plugin.likelihood_of_part(&known, &data);
    let said = of_part("likelihood_of_part").map(|_| ()).unwrap_err().message;
    assert!(said.ends_with("`likelihood_of_part` panicked: as I was told"), "{said}");
    assert!(of_part("").unwrap().is_none());
    // Even in `drop`, where no error can be returned.
    drop(likelihood(&panicking("drop")).unwrap());
    // The next instance is unaffected.
    let sound = likelihood(&panicking("")).unwrap();
    assert_eq!(sound.log_likelihood(&[0.0], &[1.0]), -1.0);
    assert_eq!(sound.failure(), None);
}

/// A density that panics if the first coordinate is negative.
struct Brittle;

impl Target for Brittle {
    fn dimension(&self) -> usize {
        1
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        assert!(points[(0, 0)] >= 0.0, "below zero");
        vec![0.0; points.rows()]
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }
    fn gradient(&self, _: &[f64]) -> (f64, Vec<f64>) {
        (0.0, vec![0.0])
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY)]
    }
    fn prior_draws(&self, count: usize, _: &Stream) -> Matrix {
        Matrix::zeros(count, 1)
    }
}

/// One call of a sampler.
type AskSampler<'a> = &'a dyn Fn(&dyn Sampler);

#[test]
fn a_panic_of_a_sampler_or_of_its_density_is_an_error() {
    twin();
    let of = |call: &str| {
        let options = format!("call = \"{call}\"");
        registry::from_text::<dyn Sampler>("panicking", &options)
            .unwrap_or_else(|e| panic!("{e}"))
            .plugin
    };
    let points = |x: f64| Matrix::from_vec(2, 1, vec![x; 2]);
    let begun = of("start").start(&Brittle, points(1.0)).unwrap_err();
    let who = format!("sampler `panicking` of {}", library());
    assert_eq!(begun.message, format!("{who}: `start` panicked: as I was told"));
    let mut state = of("").start(&Brittle, points(1.0)).unwrap();
    assert_eq!(state.memory, 1);
    let before = state.clone();
    let stepped = of("step").step(&Brittle, &mut state, &Stream::root(1)).unwrap_err();
    assert_eq!(stepped.message, format!("{who}: `step` panicked: as I was told"));
    assert_eq!(state, before);
    let planned = of("plan");
    planned.plan(1);
    assert_eq!(
        planned.faults()[0].said(),
        Some(&*format!("{who}: `plan` panicked: as I was told"))
    );
    for (call, ask) in [
        ("uses_starts", &(|s: &dyn Sampler| assert!(s.uses_starts())) as AskSampler<'_>),
        ("start_where", &|s: &dyn Sampler| assert_eq!(s.start_where(), Start::Map)),
        ("steps_are_draws", &|s: &dyn Sampler| assert!(!s.steps_are_draws())),
        ("statistics", &|s: &dyn Sampler| assert_eq!(s.statistics(&before), [])),
    ] {
        let sampler = of(call);
        ask(&*sampler);
        let said = format!("{who}: `{call}` panicked: as I was told");
        assert_eq!(sampler.faults()[0].said(), Some(&*said));
    }
    let sound = of("");
    assert!(!sound.uses_starts() && sound.steps_are_draws());
    assert_eq!((sound.start_where(), sound.statistics(&before)), (Start::Prior, Vec::new()));
    assert_eq!(sound.faults()[0].said(), None);
    // A panic of the program, called back by the library, crosses the interface twice and becomes an error.
    let begun = of("").start(&Brittle, points(-1.0)).unwrap_err();
    assert_eq!(begun.message, format!("{who}: the program: below zero"));
}
