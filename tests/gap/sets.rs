//! An effect on several sensors is one effect, on those sensors and no others.

use generator::{Kind, SENSORS};

use super::cases::{Plan, asked, name};

/// At 1.5 times the noise of one replicate, a sensor adds some thousands to the chi squared of the effect on it: the place
/// is certain. Saturation is not linear in its size, so that its place does not follow from scores alone; the gain on
/// three sensors of four is one of all but one.
#[test]
fn an_effect_on_several_sensors_is_one_effect() {
    let placed =
        [(Kind::Saturation, vec![0, 2]), (Kind::Gain, vec![0, 1, 3]), (Kind::Delay, vec![1, 2])];
    let plan =
        |kind: &(Kind, Vec<usize>)| Plan { replicates: 8, ..Plan::new(0, vec![kind.clone()], 1.5) };
    for asked in asked(11, placed.iter().map(plan).collect()) {
        let [(kind, sensors)] = &asked.plan.kinds[..] else { panic!("one effect is hidden") };
        let effects = &asked.answer.verdict.effects;
        assert_eq!(effects.len(), 1, "{}", asked.said());
        assert_eq!(effects[0].kind, name(*kind), "{}", asked.said());
        let on: Vec<&str> = effects[0].on["sensor"].iter().map(String::as_str).collect();
        let expected: Vec<&str> = sensors.iter().map(|&s| SENSORS[s]).collect();
        assert_eq!(on, expected, "{}", asked.said());
    }
}
