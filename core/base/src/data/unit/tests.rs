#![allow(clippy::unwrap_used)]

use super::*;

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn factor(from: &str, to: &str) -> f64 {
    unit(from).factor_to(&unit(to)).unwrap_or_else(|| panic!("no factor from {from} to {to}"))
}

#[test]
fn spellings_of_one_unit_are_equal() {
    for same in [
        &["kg/m3", "kg*m^-3", "kg m-3", "kg·m⁻³", "kg / m^3"][..],
        &["kg m/s2", "N", "kg*m/s^2", "kg.m.s-2", "m kg/(s s)"],
        &["1", "", "strain", "rad", "m/m"],
        &["microstrain", "ustrain", "µε", "με", "ue", "ppm", "um/m"],
        &["1/s", "Hz", "s^-1", "s⁻¹"],
        &["J/(kg K)", "m2/(s2 K)", "J/kg/K"],
        &["Pa m^0.5", "Pa m^(1/2)", "N m^-1.5"],
        &["L", "dm3"],
        &["degC", "°C"],
    ] {
        for (a, b) in same.iter().zip(&same[1..]) {
            assert_eq!(unit(a), unit(b), "{a} and {b}");
        }
    }
    assert_ne!(unit("degC"), unit("K"));
    assert_ne!(unit("mm"), unit("m"));
}

/// Source: SI brochure, 9th edition, tables 7 and 8, and the definition of the prefixes.
#[test]
fn factors_are_those_of_the_si_brochure() {
    for (from, to, expected) in [
        ("g/cm3", "kg/m3", 1000.0),
        ("MPa", "Pa", 1e6),
        ("Pa", "MPa", 1e-6),
        ("bar", "kPa", 100.0),
        ("h", "min", 60.0),
        ("min", "s", 60.0),
        ("d", "h", 24.0),
        ("km/h", "m/s", 1.0 / 3.6),
        ("eV", "J", 1.602_176_634e-19),
        ("%", "1", 0.01),
        ("microstrain", "1", 1e-6),
        ("strain", "microstrain", 1e6),
        ("deg", "rad", std::f64::consts::PI / 180.0),
        ("t", "kg", 1000.0),
        ("u", "kg", 1.660_539_068_92e-27),
        ("mL", "cm3", 1.0),
        ("V/kHz^0.5", "V/Hz^0.5", 1.0 / 1000f64.sqrt()),
        ("kW h", "MJ", 3.6),
        ("das", "s", 10.0),
    ] {
        let computed = factor(from, to);
        let error = (computed / expected - 1.0).abs();
        assert!(error < 4.0 * f64::EPSILON, "{from} to {to}: {computed}");
    }
    // Powers of ten are exact, not merely close.
    assert_eq!(factor("g/cm3", "kg/m3"), 1000.0);
    assert_eq!(factor("microstrain", "1"), 1e-6);
    assert_eq!(factor("um3", "m3"), 1e-18);
}

#[test]
fn dimensions_are_told_apart() {
    assert!(!unit("Pa").same_dimension(&unit("J")));
    assert!(unit("Pa").same_dimension(&unit("J/m3")));
    assert_eq!(unit("Pa").factor_to(&unit("s")), None);
    assert_eq!(unit("degC").factor_to(&unit("K")), None);
    assert_eq!(unit("degC").convert(20.0, &unit("K")), Some(293.15));
    assert_eq!(unit("K").convert(273.15, &unit("degC")), Some(0.0));
    assert_eq!(unit("s").convert(1.0, &unit("m")), None);
    assert!(unit("%").is_dimensionless());
}

#[test]
fn errors_point_at_the_part_that_is_wrong() {
    let wrong = |text: &str| {
        let error = Unit::parse(text).unwrap_err();
        (text[error.range].to_owned(), error.nearest)
    };
    let near = |name: &str| Some(name.to_owned());
    assert_eq!(wrong("kg/qq3"), ("qq".to_owned(), None));
    assert_eq!(wrong("m/sec"), ("sec".to_owned(), near("s")));
    assert_eq!(wrong("pa"), ("pa".to_owned(), near("Pa")));
    assert_eq!(wrong("mpa"), ("mpa".to_owned(), near("MPa")));
    assert_eq!(wrong("microstrian"), ("microstrian".to_owned(), near("microstrain")));
    assert_eq!(wrong("J/kg K"), ("K".to_owned(), None));
    assert_eq!(wrong("W/(m2 degC)"), ("degC".to_owned(), near("K")));
    assert_eq!(wrong("(m/s"), ("(".to_owned(), None));
    assert_eq!(wrong("m/s)"), (")".to_owned(), None));
    assert_eq!(wrong("m/"), (String::new(), None));
    assert_eq!(wrong("10 s"), ("10".to_owned(), None));
    assert_eq!(wrong("m^0.3"), ("^0.3".to_owned(), None));
    assert_eq!(wrong("m/✗"), ("✗".to_owned(), None));
    assert_eq!(
        Unit::parse("m/sec").unwrap_err().to_string(),
        "expected a unit such as `m/s2`, found \"m/sec\"; \
         help: `sec` is not a unit known here; did you mean `s`?"
    );
}

#[test]
fn no_text_panics() {
    // All short strings over an alphabet that reaches every branch of the grammar.
    let alphabet = ["m", "°", "1", "/", "^", "(", ")", "-", "2", ".", " ", "²", "⁻", "9"];
    let mut texts = vec![String::new()];
    for _ in 0..4 {
        let longer = |text: &String| alphabet.map(|letter| format!("{text}{letter}"));
        texts = texts.iter().flat_map(longer).collect();
        for text in &texts {
            if let Err(error) = Unit::parse(text) {
                assert!(text.get(error.range).is_some(), "{text}");
            }
        }
    }
}

#[test]
fn units_that_cannot_be_computed_with_are_refused() {
    let deep = format!("{}m{}", "(".repeat(100_000), ")".repeat(100_000));
    let many = "m/".repeat(30_000) + "m";
    let word = "x".repeat(60_000);
    let inside = format!("{}m{}", "(".repeat(300), ")".repeat(300));
    let sum = ["(m^20)^20"; 100].join("*");
    for (text, message) in [
        ("m^(-5", "this `(` is not closed"),
        (deep.as_str(), "too long"),
        (&many, "too long"),
        (&word, "too long"),
        (&inside, "there are too many `(`"),
        (&sum, "the powers of this unit are too large"),
        ("((km^20)^20)^20", "too large"),
        ("((min/s)^20)^20", "too large"),
        ("(%^20)^20", "too large"),
    ] {
        let error = Unit::parse(text).unwrap_err();
        assert!(
            error.message.contains(message),
            "{}: {}",
            &text[..text.len().min(40)],
            error.message
        );
    }
    assert_eq!(unit("(m^20)^20").times(&unit("(m^20)^20")), None);
    assert_eq!(unit("(((m)))"), unit("m"));
}

#[test]
fn units_are_shown_as_written() {
    let written: Unit = serde_json::from_str("\"kg*m^-3\"").unwrap();
    assert_eq!(serde_json::to_string(&written).unwrap(), "\"kg*m^-3\"");
    assert_eq!(format!("[{written:>9}]"), "[  kg*m^-3]");
}

#[test]
fn products_are_written_plainly() {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let rate = unit("m/s").times(&unit("s").power(-1.0).unwrap()).unwrap();
    assert_eq!(rate.clone().plain().as_str(), "m/s2");
    assert_eq!(rate.times(&unit("m").power(-2.0).unwrap()).unwrap().plain().as_str(), "1/(m s2)");
    assert_eq!(unit("kg m/(m2 s)").plain().as_str(), "kg/(m s)");
    assert_eq!(unit("mm/s").times(&unit("mm")).unwrap().plain().as_str(), "(mm/s) mm");
    assert_eq!(unit("").plain().as_str(), "1");
}

/// A rate of 1/s from `v * diameter / sqrt(mass)`, among others.
#[test]
fn electrical_units_have_their_symbols() {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let rate = unit("V/s2").times(&unit("V").power(-3.0).unwrap()).unwrap();
    assert_eq!(rate.plain().as_str(), "1/(V2 s2)");
    assert_eq!(
        unit("V/s").times(&unit("A").power(-1.0).unwrap()).unwrap().plain().as_str(),
        "ohm/s"
    );
    assert_eq!(unit("A").times(&unit("m")).unwrap().plain().as_str(), "m A");
    assert_eq!(unit("V").times(&unit("m").power(-1.0).unwrap()).unwrap().plain().as_str(), "V/m");
    let root = unit("V").power(0.5).unwrap().times(&unit("s").power(-1.0).unwrap()).unwrap();
    assert_eq!(root.plain().as_str(), "V^(1/2)/s");
}

#[test]
fn roots_are_written_in_the_lowest_terms_and_read_again() {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let shape = unit("m/s").times(&unit("m")).unwrap();
    let shape = shape.times(&unit("kg").power(-0.5).unwrap()).unwrap();
    let rate = unit("m/s2").times(&shape.power(-1.0).unwrap()).unwrap();
    assert_eq!(unit("kg").power(0.5).unwrap().as_str(), "kg^(1/2)");
    assert_eq!(unit("m").power(-2.0 / 3.0).unwrap().as_str(), "m^(-2/3)");
    assert_eq!(unit("s").power(1.0 / 6.0).unwrap().as_str(), "s^(1/6)");
    assert_eq!(unit("m/s").power(-1.5).unwrap().as_str(), "(m/s)^(-3/2)");
    assert_eq!(rate.clone().plain().as_str(), "kg^(1/2)/(m s)");
    assert_eq!(unit("s").power(-0.5).unwrap().plain().as_str(), "1/s^(1/2)");
    for sixths in (-12..=12).filter(|sixths| *sixths != 0) {
        let power = unit("kg").power(f64::from(sixths) / 6.0).unwrap();
        for written in [power.as_str(), power.clone().plain().as_str()] {
            assert_eq!(unit(written), power, "{written}");
        }
    }
}
