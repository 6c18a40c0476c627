//! Whole flights.

use super::rig::{Rig, code};
use crate::io::{VehicleMode, VehicleMsg};
use fleet_core::types::{Quat, Vec3};
use fleet_core::wire::{AckResult, Command, EventKind, Mode, RejectCode, ReplanOutcome, Up};

fn tracking(seconds: f64) -> Rig {
    let mut rig = Rig::started(0.45, 12.0);
    rig.run_until(Mode::Track, 13.0);
    rig.run(seconds);
    rig
}

fn replans(rig: &Rig) -> Vec<ReplanOutcome> {
    let outcome = |up: &Up| match up {
        Up::Replan(notice) => Some(notice.outcome),
        _ => None,
    };
    rig.published.iter().filter_map(outcome).collect()
}

#[test]
fn flies_the_plan_from_pad_to_pad() {
    // The configured guess of hover thrust is 0.5; the vehicles differ.
    for hover in [0.3, 0.5, 0.65] {
        let mut rig = Rig::started(hover, 12.0);
        rig.run_until(Mode::Takeoff, 3.0);
        rig.run_until(Mode::Track, 11.0);
        rig.run_until(Mode::Land, 21.0);
        assert!(rig.worst < 0.1, "hover {hover}: deviation {}", rig.worst);
        rig.run_until(Mode::Idle, 15.0);
        assert!(!rig.body.armed);
        assert!((rig.body.p - rig.body.pad).norm() < 0.1);
        let landed = rig.events().filter(|e| e.kind == EventKind::Landed).count();
        assert_eq!((landed, rig.faults()), (1, Vec::new()));
        assert!((rig.agent.hover.hover_thrust() - hover).abs() < 0.05 * hover);
    }
}

#[test]
fn flies_twice() {
    let mut rig = tracking(0.0);
    rig.run_until(Mode::Idle, 40.0);
    rig.run(2.0);
    rig.epoch = 2;
    rig.commit();
    assert_eq!(rig.command(Command::Arm), AckResult::Accepted);
    rig.run(1.2);
    let start = rig.start_command(11.0);
    assert_eq!(rig.command(start), AckResult::Accepted);
    rig.run_until(Mode::Track, 12.0);
    rig.run_until(Mode::Idle, 40.0);
    assert_eq!(rig.faults(), Vec::<String>::new());
}

#[test]
fn a_gust_is_answered_by_a_replan_and_the_drone_rejoins() {
    let mut rig = tracking(3.0);
    rig.body.push = Vec3::new(0.0, 3.9, 0.0);
    rig.run_until(Mode::Replan, 1.0);
    rig.run_until(Mode::Track, 0.2);
    rig.run(0.5);
    rig.body.push = Vec3::zeros();
    rig.run_until(Mode::Land, 20.0);
    rig.run_until(Mode::Idle, 15.0);
    assert!(replans(&rig).contains(&ReplanOutcome::Committed), "{:?}", replans(&rig));
    assert!(rig.agent.replan.committed >= 1);
    assert_eq!(rig.faults(), Vec::<String>::new());
    assert!((rig.body.p - rig.body.pad).norm() < 0.1);
}

#[test]
fn a_splice_does_not_jump() {
    let mut rig = tracking(3.0);
    rig.body.push = Vec3::new(0.0, 3.9, 0.0);
    rig.run_until(Mode::Replan, 1.0);
    // From the request to well after the splice nothing steps more from tick to tick than a gust
    // and 60 m/s^4 of jerk make it: the demand of 4 m/s^2 and more goes on beyond the plan's limit.
    let (mut spliced, end) = (false, rig.now.plus(0.3));
    while rig.now < end {
        let (acceleration, setpoint) = (rig.agent.acceleration, rig.agent.last_setpoint.expect("flying"));
        rig.tick();
        let step = (rig.agent.acceleration - acceleration).norm();
        let turn = (rig.agent.last_setpoint.expect("flying").rates - setpoint.rates).norm();
        assert!(step < 0.15 && turn < 0.12, "{step} m/s^2 and {turn} rad/s at {:?}", rig.now);
        if !spliced && rig.agent.mode == Mode::Track {
            spliced = true;
            assert!(acceleration.amax() > rig.plan.limits.a_max, "{acceleration}");
            assert!(rig.agent.deviation.expect("known") < 0.05, "{:?}", rig.agent.deviation);
        }
    }
    assert!(spliced, "{:?}", rig.agent.mode);
}

#[test]
fn without_replanning_a_gust_of_one_second_peaks_between_eta_and_one_metre() {
    let mut rig = Rig::new(0.45, super::plans::plan(&[("d1", Vec3::new(1.0, 2.0, 0.1))]));
    rig.plan.replan.enabled = false;
    rig.run(2.5);
    rig.commit();
    assert_eq!(rig.command(Command::Arm), AckResult::Accepted);
    rig.run(1.2);
    let start = rig.start_command(11.0);
    rig.command(start);
    rig.run_until(Mode::Track, 12.0);
    rig.run(3.0);
    rig.body.push = Vec3::new(0.0, 3.9, 0.0);
    rig.run(1.0);
    rig.body.push = Vec3::zeros();
    rig.run(3.0);
    assert!((0.55..0.9).contains(&rig.worst), "{}", rig.worst);
    assert_eq!((rig.requests, rig.agent.mode), (0, Mode::Track));
}

#[test]
fn a_solver_that_never_answers_ends_in_hold_and_resume_rejoins() {
    let mut rig = tracking(3.0);
    rig.solver = None;
    rig.body.push = Vec3::new(0.0, 3.9, 0.0);
    rig.run_until(Mode::Replan, 1.0);
    rig.body.push = Vec3::zeros();
    rig.run_until(Mode::Hold, 4.0);
    rig.run(3.0);
    assert!(rig.body.v.norm() < 0.05);
    rig.solver = Some(0.02);
    assert_eq!(rig.command(Command::Resume), AckResult::Accepted);
    rig.run_until(Mode::Track, 1.0);
    rig.run_until(Mode::Idle, 40.0);
    assert_eq!(rig.faults(), Vec::<String>::new());
}

#[test]
fn a_late_answer_is_asked_for_again_with_a_longer_lead() {
    let mut rig = tracking(3.0);
    rig.solver = Some(0.09);
    rig.body.push = Vec3::new(0.0, 3.9, 0.0);
    rig.run_until(Mode::Replan, 1.0);
    rig.body.push = Vec3::zeros();
    rig.run_until(Mode::Track, 1.0);
    assert_eq!(replans(&rig)[..2], [ReplanOutcome::Late, ReplanOutcome::Committed]);
}

#[test]
fn hold_brakes_on_the_plan_and_resume_after_its_end_goes_home() {
    let mut rig = tracking(5.0);
    let fast = rig.body.v.norm();
    assert_eq!(rig.command(Command::Hold), AckResult::Accepted);
    rig.run(4.0);
    assert!(fast > 0.8 && rig.body.v.norm() < 0.02 && rig.agent.deviation.expect("known") < 0.05);
    rig.run(20.0);
    assert_eq!(rig.agent.mode, Mode::Hold);
    assert_eq!(rig.command(Command::Resume), AckResult::Accepted);
    assert_eq!(rig.agent.mode, Mode::Return);
    rig.run_until(Mode::Land, 60.0);
    rig.run_until(Mode::Idle, 60.0);
    assert!((rig.body.p - rig.body.pad).norm() < 0.2);
}

#[test]
fn return_flies_home_under_the_ceiling_and_not_too_fast() {
    let mut rig = tracking(8.0);
    assert_eq!(rig.command(Command::Return), AckResult::Accepted);
    let mut top = 0.0_f64;
    while rig.agent.mode == Mode::Return {
        rig.tick();
        top = top.max(rig.body.p.z);
        assert!(rig.body.v.norm() < 2.4, "{}", rig.body.v);
    }
    assert!((13.5..14.6).contains(&top), "{top}");
    rig.run_until(Mode::Idle, 60.0);
    assert!((rig.body.p - rig.body.pad).norm() < 0.2);
}

#[test]
fn land_comes_down_where_it_is() {
    let mut rig = tracking(10.0);
    let at = rig.body.p;
    assert_eq!(rig.command(Command::Land), AckResult::Accepted);
    assert_eq!(code(rig.command(Command::Hold)), RejectCode::Mode);
    rig.run_until(Mode::Idle, 40.0);
    assert!((rig.body.p - at).xy().norm() < 0.3 && !rig.body.armed);
}

#[test]
fn abort_in_the_air_comes_down_and_is_latched() {
    let mut rig = tracking(10.0);
    assert_eq!(rig.command(Command::Abort), AckResult::Accepted);
    assert_eq!(code(rig.command(Command::Disarm)), RejectCode::Mode);
    rig.run(20.0);
    assert!(!rig.body.armed);
    assert_eq!(rig.agent.mode, Mode::Abort);
    assert_eq!(code(rig.command(Command::Arm)), RejectCode::Mode);
    assert_eq!(rig.command(Command::Disarm), AckResult::Accepted);
    assert_eq!(rig.agent.mode, Mode::Idle);
    assert_eq!(rig.events().filter(|e| e.kind == EventKind::Landed).count(), 1);
}

#[test]
fn abort_before_take_off_disarms() {
    let mut rig = Rig::started(0.45, 14.0);
    assert_eq!(rig.command(Command::Abort), AckResult::Accepted);
    rig.run(0.2);
    assert!(!rig.body.armed);
    assert_eq!(rig.command(Command::Disarm), AckResult::Accepted);
    assert_eq!(rig.agent.mode, Mode::Idle);
    rig.run(15.0);
    assert_eq!(rig.body.p, rig.body.pad);
}

#[test]
fn a_pilot_who_takes_over_is_left_alone_until_resume() {
    let mut rig = tracking(5.0);
    rig.body.mode = VehicleMode::Other(3);
    rig.vehicle(VehicleMsg::Mode { actual: VehicleMode::Other(3), intended: VehicleMode::Other(3) });
    rig.tick();
    assert_eq!(rig.agent.mode, Mode::Released);
    let sent = rig.setpoints.len();
    // The pilot hovers: nothing else moves the body here.
    rig.body.setpoint.rates = Vec3::zeros();
    rig.body.setpoint.thrust = rig.body.hover;
    rig.run(1.0);
    assert_eq!(rig.setpoints.len(), sent);
    assert_eq!(code(rig.command(Command::Land)), RejectCode::Mode);
    assert_eq!(rig.command(Command::Resume), AckResult::Accepted);
    rig.run(4.0);
    assert_eq!((rig.agent.mode, rig.body.mode), (Mode::Hold, VehicleMode::Offboard));
    assert!(rig.body.v.norm() < 0.05);
}

#[test]
fn a_landing_that_a_pilot_broke_off_begins_anew_after_resume() {
    let mut rig = tracking(10.0);
    assert_eq!(rig.command(Command::Land), AckResult::Accepted);
    while rig.body.mode != VehicleMode::Land {
        rig.tick();
        assert!(rig.agent.mode == Mode::Land, "{:?}", rig.agent.mode);
    }
    // Just before touchdown the pilot climbs away.
    rig.body.mode = VehicleMode::Other(3);
    rig.vehicle(VehicleMsg::Mode { actual: VehicleMode::Other(3), intended: VehicleMode::Other(3) });
    rig.tick();
    assert_eq!(rig.agent.mode, Mode::Released);
    (rig.body.setpoint.rates, rig.body.setpoint.thrust) = (Vec3::zeros(), rig.body.hover);
    rig.body.q = Quat::identity();
    rig.body.v = Vec3::new(0.0, 0.0, 3.0);
    rig.run(1.5);
    rig.body.v = Vec3::zeros();
    rig.run(0.5);
    assert_eq!(rig.command(Command::Resume), AckResult::Accepted);
    rig.run(3.0);
    assert_eq!((rig.agent.mode, rig.body.mode), (Mode::Hold, VehicleMode::Offboard));
    assert_eq!(rig.command(Command::Land), AckResult::Accepted);
    rig.run(1.0);
    assert_eq!(rig.body.mode, VehicleMode::Offboard, "far from the ground it descends on our rates");
    rig.run_until(Mode::Idle, 40.0);
    assert!(!rig.body.armed);
}
