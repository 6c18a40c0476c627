//! Laws of the codec: decode(encode(x)) = x, and nothing else than a message is ever taken for one.
#![allow(missing_docs, clippy::unwrap_used)] // clippy.toml spares only functions marked as tests

mod common;

use common::messages::{all_commands, all_down, all_plans, all_up, envelope};
use common::{formula, seeded, trajectory, vec3};
use fleet_core::formula::Formula;
use fleet_core::types::{Nanos, Quat, Reference, Setpoint, State};
use fleet_core::wire::{
    DecodeError, Down, Envelope, Heartbeat, MAX_BYTES, Mode, Offer, Plan, Telemetry, Up, decode, encode, keys,
};
use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
use proptest::prelude::*;

/// Every finite double.
fn finite() -> impl Strategy<Value = f64> {
    NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE
}

fn telemetry() -> impl Strategy<Value = Telemetry> {
    let turn = (vec3(3.0), vec3(1e6)).prop_map(|(turn, w)| (Quat::from_scaled_axis(turn), w));
    (any::<u64>(), vec3(1e6), vec3(1e3), turn, finite(), any::<Option<f32>>(), ".*").prop_map(
        |(at, p, v, (q, w), x, some, text)| Telemetry {
            drone: "d1".to_owned(),
            mode: Mode::Track,
            mission_time: some.filter(|x| x.is_finite()).map(f64::from),
            state: Some(State { at: Nanos(at), p, v, q, w }),
            reference: Some(Reference { p, v, a: w, j: v, psi: x, psi_rate: -x }),
            setpoint: Some(Setpoint { rates: w, thrust: x }),
            deviation: Some(x),
            hover_thrust: x,
            replans: at as u32,
            next_topic: None,
            next_region: Some(text),
        },
    )
}

fn plan() -> impl Strategy<Value = Plan> {
    (any::<u64>(), finite(), formula(), trajectory(), ".*").prop_map(|(seed, x, formula, path, text)| {
        let mut plan = all_plans().remove(0);
        plan.seed = seed;
        plan.rho = x;
        plan.clauses[0].formula = formula;
        plan.clauses[0].text = text;
        plan.drones[0].trajectory = path;
        plan
    })
}

fn garbage() -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(any::<u8>(), 0..300)
}

/// Every decoder on the same bytes; none may panic, and what one takes must encode again.
fn feed(bytes: &[u8]) {
    if let Ok(message) = Envelope::<Up>::from_bytes(bytes) {
        encode(&message).unwrap();
    }
    if let Ok(message) = Envelope::<Down>::from_bytes(bytes) {
        encode(&message).unwrap();
    }
    if let Ok(plan) = Plan::from_bytes(bytes) {
        encode(&plan).unwrap();
    }
}

proptest! {
    #![proptest_config(seeded(512))]

    #[test]
    fn telemetry_survives(telemetry in telemetry()) {
        let sent = envelope(Up::Telemetry(telemetry));
        prop_assert_eq!(Envelope::<Up>::from_bytes(&encode(&sent).unwrap()).unwrap(), sent);
    }

    #[test]
    fn plans_survive_to_the_last_bit(plan in plan()) {
        let bytes = encode(&plan).unwrap();
        let back = Plan::from_bytes(&bytes).unwrap();
        prop_assert_eq!(&back, &plan);
        prop_assert_eq!(encode(&back).unwrap(), bytes);
    }

    #[test]
    fn random_bytes_never_panic(bytes in garbage()) {
        feed(&bytes);
    }

    #[test]
    fn a_damaged_message_never_panics(at in any::<prop::sample::Index>(), value in any::<u8>(), cut in any::<bool>()) {
        for message in all_up() {
            let mut bytes = encode(&envelope(message)).unwrap();
            let at = at.index(bytes.len());
            bytes[at] = value;
            if cut {
                bytes.truncate(at);
            }
            feed(&bytes);
        }
    }

    #[test]
    fn trailing_bytes_are_refused(tail in prop::collection::vec(any::<u8>(), 1..20)) {
        for message in all_down() {
            let mut bytes = encode(&envelope(message)).unwrap();
            bytes.extend(&tail);
            prop_assert_eq!(Envelope::<Down>::from_bytes(&bytes), Err(DecodeError::Trailing(tail.len())));
        }
    }

    #[test]
    fn a_number_that_is_not_finite_is_refused(at in any::<prop::sample::Index>(), which in 0..3_usize) {
        // Damage one double of a plan in place: CBOR writes it as 0xfb and eight bytes.
        let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][which].to_be_bytes();
        let mut plan = all_plans().remove(0);
        let marker = 0.123_456_789_f64;
        let knots = plan.drones[0].trajectory.knots().to_vec();
        let mut knots = knots;
        let k = at.index(knots.len());
        knots[k].p.y = marker;
        plan.drones[0].trajectory = knots.try_into().unwrap();
        let mut bytes = encode(&plan).unwrap();
        let position = bytes.windows(8).position(|w| w == marker.to_be_bytes()).unwrap();
        bytes[position..position + 8].copy_from_slice(&bad);
        prop_assert_eq!(Plan::from_bytes(&bytes), Err(DecodeError::NotFinite));
    }
}

#[test]
fn another_schema_is_refused() {
    let mut sent = envelope(Down::Command(all_commands().remove(0)));
    sent.schema = 2;
    assert_eq!(Envelope::<Down>::from_bytes(&encode(&sent).unwrap()), Err(DecodeError::Schema(2)));
    let mut plan = all_plans().remove(0);
    plan.schema = 0;
    assert_eq!(Plan::from_bytes(&encode(&plan).unwrap()), Err(DecodeError::Schema(0)));
}

#[test]
fn oversize_is_refused_both_ways() {
    let offer = |n| envelope(Down::Offer(Offer { hash: String::new(), plan: vec![7; n] }));
    assert!(matches!(encode(&offer(MAX_BYTES)), Err(DecodeError::TooLarge(_))));
    assert!(encode(&offer(MAX_BYTES - 300)).is_ok());
    assert_eq!(decode::<Plan>(&vec![0; MAX_BYTES + 1]), Err(DecodeError::TooLarge(MAX_BYTES + 1)));
}

#[test]
fn nothing_that_is_not_finite_is_sent() {
    let heartbeat = Heartbeat {
        drone: "d1".to_owned(),
        now: Nanos(1),
        mode: Mode::Idle,
        hash: String::new(),
        mission_time: Some(f64::NAN),
        armed: false,
        battery: None,
        state_age: None,
    };
    assert_eq!(encode(&envelope(Up::Heartbeat(heartbeat))), Err(DecodeError::NotFinite));
}

#[test]
fn nesting_without_end_is_refused() {
    for byte in [0x81, 0xa1, 0xc1, 0x9f] {
        assert_eq!(decode::<Plan>(&[byte; 100_000]), Err(DecodeError::TooDeep));
    }
}

#[test]
fn what_is_encoded_is_never_too_deep_to_be_decoded() {
    let mut deepest = 0;
    for depth in 1..100 {
        let mut plan = all_plans().remove(0);
        for _ in 0..depth {
            plan.clauses[0].formula = Formula::Not { f: Box::new(plan.clauses[0].formula.clone()) };
        }
        match encode(&plan) {
            Ok(bytes) => {
                assert_eq!(Plan::from_bytes(&bytes).unwrap(), plan);
                deepest = depth;
            }
            Err(error) => assert_eq!(error, DecodeError::TooDeep),
        }
    }
    assert!((50..64).contains(&deepest), "{deepest}");
}

#[test]
fn names_are_plain() {
    for good in ["d1", "D", "a_b", "x23456789012345678901234567890_1"] {
        assert!(keys::is_name(good), "{good}");
    }
    for bad in ["", "1d", "_a", "a/b", "a*", "*", "ä", "a b", "home.d1", "x234567890123456789012345678901_2"]
    {
        assert!(!keys::is_name(bad), "{bad}");
    }
}
