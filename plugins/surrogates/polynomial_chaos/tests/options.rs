//! The options as written in a study.

use lacuna::math::distribution::Distribution;

use super::bench::{of_degree, parameters, up_to};
use crate::surrogates::polynomial_chaos::{
    Degree, DegreeRange, Family, PolynomialChaos, QNorm, Solver,
};

fn parsed(json: &str) -> Result<PolynomialChaos, String> {
    serde_json::from_str(json).map_err(|e| e.to_string())
}

#[test]
fn a_degree_is_a_number_or_a_range() {
    assert_eq!(parsed(r#"{ "degree": 7 }"#).unwrap(), of_degree(7));
    assert_eq!(parsed(r#"{ "degree": { "max": 12 } }"#).unwrap(), up_to(1, 12));
    let range = Degree::Range(DegreeRange { min: 3, max: 20 });
    assert_eq!(parsed(r#"{ "degree": { "min": 3 } }"#).unwrap().degree, range);
    assert!(parsed(r#"{ "degree": "high" }"#).unwrap_err().contains("a whole number or a range"));
    assert!(parsed(r#"{ "degree": { "maximum": 3 } }"#).unwrap_err().contains("`maximum`"));
    assert!(parsed(r#"{ "degre": 3 }"#).unwrap_err().contains("`degre`"));
}

#[test]
fn options_survive_being_written() {
    let study = r#"{
        "basis": "legendre", "solver": "least_squares", "degree": 4, "q_norm": 0.7,
        "max_interaction": 2, "early_stop": { "degrees": 3, "terms": 50 }
    }"#;
    let options = parsed(study).unwrap();
    assert_eq!(options.solver, Solver::LeastSquares);
    assert_eq!(parsed(&serde_json::to_string(&options).unwrap()).unwrap(), options);
    assert_eq!(parsed("{}").unwrap(), PolynomialChaos::default());
}

#[test]
fn options_that_cannot_work_are_named() {
    let three = parameters(&[[0.0, 1.0]; 3]);
    let keys = |options: &PolynomialChaos, runs| -> Vec<&str> {
        options.faults(&three, runs).iter().map(|f| f.key).collect()
    };
    assert!(keys(&PolynomialChaos::default(), Some(100)).is_empty());
    let wrong = PolynomialChaos {
        q_norm: Some(QNorm::Fixed(0.0)),
        max_interaction: Some(0),
        ..of_degree(0)
    };
    assert_eq!(keys(&wrong, None), ["degree", "q_norm", "max_interaction"]);
    assert_eq!(keys(&PolynomialChaos { max_terms: Some(100), ..of_degree(20) }, None), ["degree"]);
    let dense = PolynomialChaos { solver: Solver::LeastSquares, ..of_degree(8) };
    assert_eq!(keys(&dense, Some(165)), ["degree"]);
    assert!(keys(&dense, Some(166)).is_empty() && keys(&dense, None).is_empty());
    assert_eq!(PolynomialChaos::default().faults(&[], None)[0].key, "use");
}

#[test]
fn a_design_with_too_few_moments_is_refused_by_the_parameters_name() {
    let mut parameters = parameters(&[[0.0, 1.0]; 3]);
    parameters[1].design = Distribution::StudentT([4.0, 0.0, 1.0]);
    let faults = PolynomialChaos::default().faults(&parameters, Some(100));
    assert_eq!((faults.len(), faults[0].key), (1, "basis"));
    assert!(
        faults[0].message.starts_with("the design of parameter `x2` (Student t with 4 degrees")
    );
    assert!(faults[0].message.ends_with("has orthogonal polynomials up to degree 1 only, not 20"));
    let forced = PolynomialChaos { basis: Family::Hermite, ..Default::default() };
    assert!(forced.faults(&parameters, Some(100)).is_empty());
}
