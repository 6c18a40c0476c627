//! Late, missing and broken input; peers that do not play along; determinism.

use super::plans::plan;
use super::rig::{MISSION, Rig};
use crate::io::{Input, Output, VehicleCmd, VehicleMode, VehicleMsg};
use crate::step::{Agent, AgentConfig};
use fleet_core::types::{Nanos, Quat, Vec3};
use fleet_core::wire::{AckResult, Command, Envelope, EventKind, Heartbeat, Mode, SCHEMA, Up, encode};
use nalgebra::{Quaternion, UnitQuaternion};
use proptest::prelude::*;

fn tracking() -> Rig {
    let mut rig = Rig::started(0.45, 12.0);
    rig.run_until(Mode::Track, 13.0);
    rig.run(4.0);
    rig
}

/// Two drones, ours armed; `t0` in 12 s.
fn pair() -> Rig {
    let pads = [("d1", Vec3::new(1.0, 2.0, 0.1)), ("d2", Vec3::new(1.0, -8.0, 0.1))];
    let mut rig = Rig::new(0.45, plan(&pads));
    rig.run(2.5);
    rig.commit();
    assert_eq!(rig.command(Command::Arm), AckResult::Accepted);
    rig.run(1.2);
    let start = rig.start_command(12.0);
    assert_eq!(rig.command(start), AckResult::Accepted);
    rig
}

fn peer(rig: &mut Rig, mode: Mode) {
    let heartbeat = Heartbeat {
        drone: "d2".into(),
        now: Nanos(5),
        mode,
        hash: rig.hash(),
        mission_time: rig.agent.mission.time(rig.now),
        armed: true,
        battery: None,
        state_age: Some(0.0),
    };
    let envelope = Envelope {
        schema: SCHEMA,
        mission_id: MISSION.into(),
        epoch: 1,
        seq: 1,
        issued: Nanos(5),
        valid_until: Nanos(6),
        body: Up::Heartbeat(heartbeat),
    };
    rig.inbox.push(Input::Peer { bytes: encode(&envelope).expect("encodes") });
}

#[test]
fn without_its_peer_it_does_not_take_off() {
    let mut rig = pair();
    rig.run_until(Mode::Idle, 4.0);
    rig.run(1.0);
    assert!(!rig.body.armed && rig.body.p == rig.body.pad);
    assert!(rig.faults().iter().any(|f| f.contains("d2: never heard")), "{:?}", rig.faults());
}

#[test]
fn a_peer_that_aborts_before_the_start_stops_this_one() {
    for (last, expected) in [(Mode::Takeoff, Mode::Track), (Mode::Abort, Mode::Land)] {
        let mut rig = pair();
        while rig.agent.mission.time(rig.now).is_some_and(|t| t < 0.05) {
            let mode = if rig.agent.mission.time(rig.now) < Some(-3.0) { Mode::Takeoff } else { last };
            peer(&mut rig, mode);
            rig.tick();
        }
        assert_eq!(rig.agent.mode, expected, "{:?}", rig.faults());
    }
}

#[test]
fn a_short_gap_of_the_state_is_bridged() {
    let mut rig = tracking();
    rig.sensing = false;
    rig.run(0.25);
    rig.sensing = true;
    rig.run(2.0);
    assert_eq!(rig.agent.mode, Mode::Track);
    assert!(rig.agent.deviation.expect("known") < 0.3);
    let stale = rig.events().filter(|e| matches!(e.kind, EventKind::StateStale { .. })).count();
    assert_eq!(stale, 2);
}

#[test]
fn a_pause_of_the_process_is_not_a_lost_state() {
    let mut rig = tracking();
    // The machine stood still, and what arrived meanwhile comes two ticks later.
    rig.now = rig.now.plus(0.4);
    rig.sensing = false;
    rig.run(0.02);
    rig.sensing = true;
    rig.run(2.0);
    assert_eq!(rig.agent.mode, Mode::Track, "{:?}", rig.faults());
}

#[test]
fn a_lost_state_ends_in_the_autopilots_landing() {
    let mut rig = tracking();
    rig.sensing = false;
    rig.run(0.4);
    assert_eq!(rig.agent.mode, Mode::Land);
    rig.run(1.5);
    assert_eq!(rig.body.mode, VehicleMode::Land);
    rig.run_until(Mode::Idle, 30.0);
    assert!(!rig.body.armed);
}

#[test]
fn an_estimator_jump_is_not_chased() {
    let mut rig = tracking();
    let before = rig.body.p;
    // The autopilot's frame moves by 1 m under the vehicle.
    rig.body.pad.x -= 1.0;
    rig.run(0.1);
    assert!((rig.body.p - before).norm() < 0.3);
    assert_eq!((rig.requests, rig.agent.mode), (0, Mode::Track));
    assert!(rig.events().any(|e| matches!(e.kind, EventKind::EstimatorReset { .. })));
    rig.body.pad.x += 10.0;
    rig.run(0.1);
    assert_eq!(rig.agent.mode, Mode::Land);
}

#[test]
fn arming_gives_up_and_says_so() {
    let mut rig = Rig::new(0.45, plan(&[("d1", Vec3::new(1.0, 2.0, 0.1))]));
    rig.run(2.5);
    rig.commit();
    let mut out = Vec::new();
    assert_eq!(rig.command(Command::Arm), AckResult::Accepted);
    // An autopilot that never answers.
    for _ in 0..600 {
        rig.now = Nanos(rig.now.0 + super::rig::DT);
        out.extend(rig.agent.step(rig.now, &[]));
    }
    let faults = out.iter().filter(|o| format!("{o:?}").contains("could not arm")).count();
    assert!(faults >= 1 && rig.agent.mode == Mode::Idle && rig.agent.arming.is_none());
}

#[test]
fn the_same_inbox_gives_the_same_bytes() {
    let fly = || {
        let mut rig = tracking();
        rig.body.push = Vec3::new(0.0, 3.9, 0.0);
        rig.run(1.0);
        rig.body.push = Vec3::zeros();
        rig.run_until(Mode::Idle, 40.0);
        rig.bytes
    };
    let (first, second) = (fly(), fly());
    assert!(first.len() > 1_000_000 && first == second);
}

#[test]
fn extra_calls_do_no_harm() {
    let mut agent = Agent::new(AgentConfig::new("fleet", "d1"));
    let ticks = |out: Vec<Output>| out.iter().filter(|o| matches!(o, Output::Tick(_))).count();
    let mut count = 0;
    for k in 0..1000 {
        count += ticks(agent.step(Nanos(1 + k * 1_000_000), &[]));
    }
    assert_eq!(count, 100);
    // A pause is not made up for.
    assert_eq!(ticks(agent.step(Nanos(1 + 5_000_000_000), &[])), 1);
    assert_eq!(ticks(agent.step(Nanos(1 + 5_001_000_000), &[])), 0);
}

fn any3() -> impl Strategy<Value = Vec3> {
    proptest::array::uniform3(proptest::num::f64::ANY).prop_map(Vec3::from)
}

fn finite(out: &[Output]) -> bool {
    out.iter().all(|o| match o {
        Output::Vehicle(VehicleCmd::Rates(s)) => {
            s.thrust.is_finite() && s.rates.iter().all(|x| x.is_finite()) && (0.0..=1.0).contains(&s.thrust)
        }
        _ => true,
    })
}

proptest! {
    #[test]
    fn bytes_from_anywhere_never_panic_and_are_answered_once(
        bytes in proptest::collection::vec(any::<u8>(), 0..400), cut in 0usize..2000, flip in any::<u8>(),
    ) {
        let mut agent = Agent::new(AgentConfig::new("fleet", "d1"));
        agent.step(Nanos(0), &[]);
        let offer = encode(&plan(&[("d1", Vec3::zeros())])).expect("encodes");
        let mut damaged = offer[..cut.min(offer.len())].to_vec();
        if let Some(byte) = damaged.last_mut() {
            *byte ^= flip;
        }
        for bytes in [bytes, damaged] {
            let out = agent.step(Nanos(1), &[Input::Ground { bytes: bytes.clone() }, Input::Peer { bytes }]);
            prop_assert_eq!(out.len(), 1);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn whatever_the_state_the_setpoint_is_finite(
        junk in proptest::collection::vec((any3(), any3(), proptest::array::uniform4(proptest::num::f64::ANY)), 40),
    ) {
        let mut rig = tracking();
        let mut sent = 0;
        for (p, v, q) in junk {
            let q: Quat = UnitQuaternion::new_unchecked(Quaternion::new(q[0], q[1], q[2], q[3]));
            let inbox = [
                Input::Vehicle(VehicleMsg::Attitude { boot_ms: 0, q, w: v }),
                Input::Vehicle(VehicleMsg::LocalPosition { boot_ms: 0, p, v }),
                Input::Vehicle(VehicleMsg::Attitude { boot_ms: 0, q: Quat::identity(), w: p }),
            ];
            rig.now = Nanos(rig.now.0 + super::rig::DT);
            let out = rig.agent.step(rig.now, &inbox);
            sent += out.iter().filter(|o| matches!(o, Output::Vehicle(VehicleCmd::Rates(_)))).count();
            prop_assert!(finite(&out));
        }
        prop_assert_eq!(sent, 40);
    }
}
