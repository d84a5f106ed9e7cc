//! Table of units and prefixes.

use super::{BASES, Meaning};

/// One unit: symbols, factor, power of ten, exponents of m kg s A K mol cd.
type Row = (&'static [&'static str], f64, i32, [i16; BASES]);

const PLAIN: [i16; BASES] = [0; BASES];

/// Units that accept prefixes.
const WITH_PREFIX: &[Row] = &[
    (&["m"], 1.0, 0, [1, 0, 0, 0, 0, 0, 0]),
    (&["g"], 1.0, -3, [0, 1, 0, 0, 0, 0, 0]),
    (&["s"], 1.0, 0, [0, 0, 1, 0, 0, 0, 0]),
    (&["A"], 1.0, 0, [0, 0, 0, 1, 0, 0, 0]),
    (&["K"], 1.0, 0, [0, 0, 0, 0, 1, 0, 0]),
    (&["mol"], 1.0, 0, [0, 0, 0, 0, 0, 1, 0]),
    (&["cd"], 1.0, 0, [0, 0, 0, 0, 0, 0, 1]),
    (&["Hz", "Bq"], 1.0, 0, [0, 0, -1, 0, 0, 0, 0]),
    (&["N"], 1.0, 0, [1, 1, -2, 0, 0, 0, 0]),
    (&["Pa"], 1.0, 0, [-1, 1, -2, 0, 0, 0, 0]),
    (&["bar"], 1.0, 5, [-1, 1, -2, 0, 0, 0, 0]),
    (&["J"], 1.0, 0, [2, 1, -2, 0, 0, 0, 0]),
    (&["eV"], 1.602_176_634, -19, [2, 1, -2, 0, 0, 0, 0]),
    (&["W"], 1.0, 0, [2, 1, -3, 0, 0, 0, 0]),
    (&["C"], 1.0, 0, [0, 0, 1, 1, 0, 0, 0]),
    (&["V"], 1.0, 0, [2, 1, -3, -1, 0, 0, 0]),
    (&["F"], 1.0, 0, [-2, -1, 4, 2, 0, 0, 0]),
    (&["ohm", "Ω", "Ω"], 1.0, 0, [2, 1, -3, -2, 0, 0, 0]),
    (&["S"], 1.0, 0, [-2, -1, 3, 2, 0, 0, 0]),
    (&["Wb"], 1.0, 0, [2, 1, -2, -1, 0, 0, 0]),
    (&["T"], 1.0, 0, [0, 1, -2, -1, 0, 0, 0]),
    (&["H"], 1.0, 0, [2, 1, -2, -2, 0, 0, 0]),
    (&["lm"], 1.0, 0, [0, 0, 0, 0, 0, 0, 1]),
    (&["lx"], 1.0, 0, [-2, 0, 0, 0, 0, 0, 1]),
    (&["Gy", "Sv"], 1.0, 0, [2, 0, -2, 0, 0, 0, 0]),
    (&["L", "l"], 1.0, -3, [3, 0, 0, 0, 0, 0, 0]),
    (&["rad", "sr", "strain", "ε"], 1.0, 0, PLAIN),
];

/// Units that accept no prefix.
const WITHOUT_PREFIX: &[Row] = &[
    (&["min"], 60.0, 0, [0, 0, 1, 0, 0, 0, 0]),
    (&["h"], 3600.0, 0, [0, 0, 1, 0, 0, 0, 0]),
    (&["d"], 86400.0, 0, [0, 0, 1, 0, 0, 0, 0]),
    (&["t"], 1.0, 3, [0, 1, 0, 0, 0, 0, 0]),
    (&["u"], 1.660_539_068_92, -27, [0, 1, 0, 0, 0, 0, 0]),
    (&["atm"], 101_325.0, 0, [-1, 1, -2, 0, 0, 0, 0]),
    (&["deg", "°"], std::f64::consts::PI / 180.0, 0, PLAIN),
    (&["%"], 1.0, -2, PLAIN),
    (&["ppm"], 1.0, -6, PLAIN),
    (&["ppb"], 1.0, -9, PLAIN),
    // The usual spelling of µε for strain gauges.
    (&["ue"], 1.0, -6, PLAIN),
];

/// Prefixes; longer symbols come before the shorter ones that they begin with.
const PREFIXES: &[(&str, i32)] = &[
    ("micro", -6),
    ("milli", -3),
    ("nano", -9),
    ("kilo", 3),
    ("da", 1),
    ("Q", 30),
    ("R", 27),
    ("Y", 24),
    ("Z", 21),
    ("E", 18),
    ("P", 15),
    ("T", 12),
    ("G", 9),
    ("M", 6),
    ("k", 3),
    ("h", 2),
    ("d", -1),
    ("c", -2),
    ("m", -3),
    ("u", -6),
    // U+00B5 (micro sign) and U+03BC (Greek letter mu) look alike; both are accepted.
    ("µ", -6),
    ("μ", -6),
    ("n", -9),
    ("p", -12),
    ("f", -15),
    ("a", -18),
    ("z", -21),
    ("y", -24),
    ("r", -27),
    ("q", -30),
];

/// Symbols of the degree Celsius, the only unit with an offset.
const CELSIUS: &[&str] = &["degC", "°C", "℃"];

/// Meaning of one symbol with or without prefix.
pub(super) fn find(symbol: &str) -> Option<Meaning> {
    if CELSIUS.contains(&symbol) {
        let kelvin = named(WITH_PREFIX, "K")?;
        return Some(Meaning { offset: 273.15, ..kelvin });
    }
    // A complete symbol takes precedence over prefix and symbol: `min` is the minute and not the milli-inch, `cd` the
    // candela and not the centiday.
    named(WITH_PREFIX, symbol).or_else(|| named(WITHOUT_PREFIX, symbol)).or_else(|| {
        PREFIXES.iter().find_map(|(prefix, decimals)| {
            let meaning = named(WITH_PREFIX, symbol.strip_prefix(prefix)?)?;
            Some(Meaning { decimals: meaning.decimals + decimals, ..meaning })
        })
    })
}

fn named(rows: &[Row], symbol: &str) -> Option<Meaning> {
    let &(_, factor, decimals, exponents) =
        rows.iter().find(|(symbols, ..)| symbols.contains(&symbol))?;
    let sixths = exponents.map(|exponent| 6 * exponent);
    Some(Meaning { factor, decimals, offset: 0.0, sixths })
}

/// The known symbol, with or without prefix, that is closest to `symbol`.
pub(super) fn nearest(symbol: &str) -> Option<String> {
    let respelt = [
        ("sec", "s"),
        ("second", "s"),
        ("seconds", "s"),
        ("hour", "h"),
        ("hr", "h"),
        ("minute", "min"),
        ("day", "d"),
        ("meter", "m"),
        ("metre", "m"),
        ("kelvin", "K"),
        ("celsius", "degC"),
        ("percent", "%"),
        ("pascal", "Pa"),
        ("hertz", "Hz"),
        ("radian", "rad"),
        ("degree", "deg"),
        ("degrees", "deg"),
        ("ustrains", "ustrain"),
        ("me", "microstrain"),
        ("volt", "V"),
        ("newton", "N"),
        ("joule", "J"),
        ("watt", "W"),
    ];
    let lower = symbol.to_lowercase();
    if let Some((_, right)) = respelt.iter().find(|(wrong, _)| *wrong == lower) {
        return Some((*right).to_owned());
    }
    let bare = || WITH_PREFIX.iter().flat_map(|(symbols, ..)| symbols.iter().copied());
    let prefixed = PREFIXES
        .iter()
        .filter(|(prefix, _)| prefix.is_ascii())
        .flat_map(|(prefix, _)| bare().map(move |unit| format!("{prefix}{unit}")));
    let others = WITHOUT_PREFIX.iter().flat_map(|(symbols, ..)| symbols.iter());
    let all: Vec<String> = bare()
        .map(str::to_owned)
        .chain(others.chain(CELSIUS).map(|&symbol| symbol.to_owned()))
        .chain(prefixed)
        .collect();
    let same_letters = all.iter().find(|known| known.to_lowercase() == lower);
    let close = || {
        let length = symbol.chars().count();
        // The distance is never below the difference of the lengths, which is known sooner.
        let near = |known: &&String| {
            known.chars().count().abs_diff(length) <= 1
                && strsim::damerau_levenshtein(symbol, known) == 1
        };
        if length > 2 { all.iter().find(near) } else { None }
    };
    same_letters.or_else(close).cloned()
}
