//! Units as studies and files write them.

use lacuna::data::Unit;

/// A unit that is read is written so that it reads back as itself, and conversions between units of one dimension undo each
/// other.
pub fn unit(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let mut read = Vec::new();
    for line in text.lines().take(4) {
        match Unit::parse(line) {
            Ok(unit) => {
                assert_eq!(Unit::parse(unit.as_str()).as_ref(), Ok(&unit), "`{line}`");
                assert_eq!(Unit::parse(&unit.to_string()).as_ref(), Ok(&unit), "`{line}`");
                read.push(unit);
            }
            Err(error) => assert!(!error.to_string().trim().is_empty(), "`{line}`"),
        }
    }
    for a in &read {
        for b in &read {
            let there = a.factor_to(b);
            assert_eq!(there.is_some(), a.same_dimension(b), "`{a}` and `{b}`");
            if let (Some(there), Some(back)) = (there, b.factor_to(a)) {
                let product = there * back;
                let is_lost = there == 0.0 || back == 0.0 || !product.is_finite();
                assert!(is_lost || (product - 1.0).abs() < 1e-9, "`{a}` and `{b}`: {product}");
            }
            if let Some(product) = a.times(b) {
                let again = Unit::parse(product.as_str()).expect("a product reads back");
                assert!(again.same_dimension(&product), "`{a}` times `{b}`");
            }
        }
        for exponent in [-1.0, 0.5, 2.0] {
            if let Some(power) = a.power(exponent) {
                let again = Unit::parse(power.as_str()).expect("a power reads back");
                assert!(again.same_dimension(&power), "`{a}` to the power {exponent}");
            }
        }
    }
}
