//! What the agent accepts from the ground, and the code of every refusal.

use super::plans::plan;
use super::rig::{MISSION, Rig, code};
use crate::io::{Input, Output, PLAN_FILE, VehicleMsg};
use fleet_core::types::{Nanos, Vec3};
use fleet_core::wire::{AckResult, Command, Commit, Down, Mode, Offer, Plan, RejectCode, encode, plan_hash};

const PAD: Vec3 = Vec3::new(1.0, 2.0, 0.1);

fn rig() -> Rig {
    let mut rig = Rig::new(0.5, plan(&[("d1", PAD)]));
    rig.run(2.5);
    rig
}

fn offer(plan: &Plan) -> Down {
    let bytes = encode(plan).expect("encodes");
    Down::Offer(Offer { hash: plan_hash(&bytes), plan: bytes })
}

#[test]
fn every_refusal_of_an_offer_has_its_code() {
    let change = |f: fn(&mut Plan)| {
        let mut plan = plan(&[("d1", PAD)]);
        f(&mut plan);
        offer(&plan)
    };
    let good = offer(&plan(&[("d1", PAD)]));
    let Down::Offer(mut forged) = good.clone() else { unreachable!() };
    forged.hash = "0".repeat(64);
    let junk = vec![0xa1, 0x61];
    let junk = Offer { hash: plan_hash(&junk), plan: junk };
    for (body, expected) in [
        (Down::Offer(forged), RejectCode::Hash),
        (Down::Offer(junk), RejectCode::Malformed),
        (change(|p| p.fleet = "other".into()), RejectCode::WrongFleet),
        (change(|p| p.drones[0].id = "d9".into()), RejectCode::NotInPlan),
        (change(|p| p.limits.v_max = 50.0), RejectCode::Limits),
        (change(|p| p.clauses.clear()), RejectCode::Certificate),
        (change(|p| p.drones[0].pad.p.x += 3.0), RejectCode::Ends),
    ] {
        let mut rig = rig();
        assert_eq!(code(rig.ask(body)), expected);
        // A refusal changes nothing: the good plan is still welcome.
        assert_eq!(rig.ask(good.clone()), AckResult::Accepted);
    }
}

#[test]
fn envelopes_are_checked_first() {
    let mut rig = rig();
    let body = offer(&rig.plan);
    let mut envelope = rig.envelope(body.clone());
    envelope.schema = 2;
    assert_eq!(code(rig.send(&envelope)), RejectCode::Malformed);
    assert_eq!(code(rig.send_bytes(vec![1, 2, 3])), RejectCode::Malformed);
    let mut envelope = rig.envelope(body.clone());
    envelope.valid_until = Nanos(rig.now.0 - 1);
    assert_eq!(code(rig.send(&envelope)), RejectCode::Expired);
    let mut envelope = rig.envelope(body.clone());
    envelope.valid_until = rig.now.plus(7200.0);
    assert_eq!(code(rig.send(&envelope)), RejectCode::Expired);
    let mut envelope = rig.envelope(body);
    envelope.epoch = 0;
    assert_eq!(code(rig.send(&envelope)), RejectCode::Stale);
}

#[test]
fn offers_are_idempotent_and_epochs_rise() {
    let mut rig = rig();
    rig.epoch = 5;
    let first = offer(&rig.plan);
    assert_eq!(rig.ask(first.clone()), AckResult::Accepted);
    assert_eq!(rig.ask(first.clone()), AckResult::Accepted);
    let mut other = rig.plan.clone();
    other.seed = 2;
    assert_eq!(code(rig.ask(offer(&other))), RejectCode::Stale);
    rig.epoch = 4;
    assert_eq!(code(rig.ask(offer(&other))), RejectCode::Stale);
    rig.epoch = 6;
    assert_eq!(rig.ask(offer(&other)), AckResult::Accepted);
    // What was offered first can no longer be committed.
    let hash = rig.hash();
    assert_eq!(code(rig.ask(Down::Commit(Commit { hash }))), RejectCode::Hash);
}

#[test]
fn nothing_is_accepted_before_it_is_on_disk() {
    let mut rig = rig();
    let envelope = rig.envelope(offer(&rig.plan.clone()));
    let bytes = encode(&envelope).expect("encodes");
    let out = rig.agent.step(rig.now, &[Input::Ground { bytes: bytes.clone() }]);
    let acks = |out: &[Output]| {
        let is_ack = |o: &&Output| format!("{o:?}").contains("Ack(");
        out.iter().filter(is_ack).count()
    };
    let Some(Output::Persist { id, .. }) = out.iter().find(|o| matches!(o, Output::Persist { .. })) else {
        panic!("nothing to write: {out:?}")
    };
    assert_eq!(acks(&out), 0);
    let out = rig.agent.step(rig.now, &[Input::Persisted { id: *id, ok: false }]);
    assert_eq!(acks(&out), 1);
    assert!(rig.agent.mission.offered.is_none());
    rig.commit();
    assert_eq!(rig.agent.mission.hash(), rig.hash());
    assert_ne!(PLAN_FILE, crate::io::OFFER_FILE);
}

#[test]
fn commits_must_match_the_offer() {
    let mut rig = rig();
    let hash = rig.hash();
    assert_eq!(code(rig.ask(Down::Commit(Commit { hash: hash.clone() }))), RejectCode::Hash);
    let body = offer(&rig.plan);
    assert_eq!(rig.ask(body), AckResult::Accepted);
    assert_eq!(code(rig.ask(Down::Commit(Commit { hash: "0".repeat(64) }))), RejectCode::Hash);
    let mut envelope = rig.envelope(Down::Commit(Commit { hash: hash.clone() }));
    envelope.mission_id = "f".repeat(32);
    assert_eq!(code(rig.send(&envelope)), RejectCode::WrongMission);
    assert_eq!(rig.ask(Down::Commit(Commit { hash: hash.clone() })), AckResult::Accepted);
    assert_eq!(rig.ask(Down::Commit(Commit { hash })), AckResult::Accepted);
}

#[test]
fn commands_are_refused_with_their_code() {
    let mut rig = rig();
    assert_eq!(code(rig.command(Command::Arm)), RejectCode::Preflight);
    rig.commit();
    rig.body.params[0] = 1.0;
    rig.vehicle(VehicleMsg::Param { name: "COM_OF_LOSS_T".into(), value: 1.0 });
    assert_eq!(code(rig.command(Command::Arm)), RejectCode::Preflight);
    rig.vehicle(VehicleMsg::Param { name: "COM_OF_LOSS_T".into(), value: 0.5 });
    let hash = rig.hash();
    let start = |t0: Nanos, hash: &str| Command::Start { t0, hash: hash.to_owned() };
    let now = rig.now;
    assert_eq!(code(rig.command(start(now.plus(20.0), "00"))), RejectCode::Hash);
    assert_eq!(code(rig.command(start(now.plus(9.0), &hash))), RejectCode::StartTime);
    assert_eq!(code(rig.command(start(now.plus(1e4), &hash))), RejectCode::StartTime);
    for command in [Command::Hold, Command::Resume, Command::Return, Command::Land] {
        assert_eq!(code(rig.command(command)), RejectCode::Mode);
    }
    let mut envelope = rig.envelope(Down::Command(Command::Arm));
    envelope.mission_id = "f".repeat(32);
    assert_eq!(code(rig.send(&envelope)), RejectCode::WrongMission);
    let mut envelope = rig.envelope(Down::Command(Command::Arm));
    envelope.seq = 1;
    assert_eq!(code(rig.send(&envelope)), RejectCode::Stale);
    assert_eq!(MISSION, rig.agent.mission.id());
    assert_eq!(rig.command(Command::Arm), AckResult::Accepted);
    rig.run(1.0);
    assert_eq!(rig.agent.mode, Mode::Armed);
    let body = offer(&rig.plan);
    assert_eq!(code(rig.ask(body)), RejectCode::Mode);
}

#[test]
fn a_repeated_command_is_answered_again_and_done_once() {
    let mut rig = rig();
    rig.commit();
    let envelope = rig.envelope(Down::Command(Command::Arm));
    assert_eq!(rig.send(&envelope), AckResult::Accepted);
    rig.run(1.0);
    assert_eq!(rig.command(Command::Disarm), AckResult::Accepted);
    rig.run(0.5);
    // A copy that comes late must not arm again.
    assert_eq!(code(rig.send(&envelope)), RejectCode::Stale);
    let envelope = rig.envelope(Down::Command(Command::Arm));
    assert_eq!(rig.send(&envelope), AckResult::Accepted);
    assert_eq!(rig.send(&envelope), AckResult::Accepted);
}

#[test]
fn a_stranger_may_stop_the_fleet_but_not_make_its_mission_stale() {
    let mut rig = Rig::started(0.45, 12.0);
    rig.run_until(Mode::Track, 13.0);
    rig.run(2.0);
    let mut envelope = rig.envelope(Down::Command(Command::Hold));
    (envelope.mission_id, envelope.epoch, envelope.seq) = ("f".repeat(32), 99, u64::MAX);
    assert_eq!(rig.send(&envelope), AckResult::Accepted);
    assert_eq!(rig.agent.mode, Mode::Hold);
    assert_eq!(rig.command(Command::Resume), AckResult::Accepted);
    rig.run_until(Mode::Track, 1.0);
}
