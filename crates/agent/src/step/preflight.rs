//! Pre-flight checks, each with what to do when it fails.

use super::config::PreflightLimits;
use super::vehicle::Vehicle;
use fleet_core::types::{Nanos, Vec3};

/// Parameter: seconds without setpoints until the autopilot falls back.
pub const OFFBOARD_LOSS: &str = "COM_OF_LOSS_T";
/// Parameter: what it falls back to.
pub const OFFBOARD_ACTION: &str = "COM_OBL_RC_ACT";
/// Value of [`OFFBOARD_ACTION`] that holds position (mavlink.md, section 3).
const HOLD: f64 = 5.0;
/// The autopilot's HEARTBEAT comes once a second; three may be lost.
const HEARTBEAT_AGE: f64 = 3.5;

/// Every check that fails now. `pad` is the surveyed pad of the committed plan.
pub fn failures(vehicle: &Vehicle, limits: &PreflightLimits, pad: Option<Vec3>, now: Nanos) -> Vec<String> {
    let mut list = Vec::new();
    let connected = vehicle.heartbeat.is_some_and(|at| now.since(at) <= HEARTBEAT_AGE);
    if !connected {
        list.push("no HEARTBEAT from the autopilot: check the MAVLink link and the system id".to_owned());
    }
    match vehicle.age(now) {
        None => {
            list.push("attitude or local position was never received: check the MAVLink streams".to_owned());
        }
        Some(age) if age > limits.state_age => list.push(format!(
            "vehicle state is {:.0} ms old, {:.0} ms is legal: check the MAVLink streams and the estimator",
            age * 1e3,
            limits.state_age * 1e3
        )),
        Some(_) => {}
    }
    parameters(vehicle, limits, &mut list);
    position(vehicle, limits, pad, &mut list);
    match vehicle.prearm_ok {
        Some(true) => {}
        Some(false) => list.push(format!(
            "the autopilot's own pre-arm checks fail: see its messages ({})",
            if vehicle.last_words.is_empty() { "none yet" } else { &vehicle.last_words }
        )),
        None => {
            list.push("no SYS_STATUS from the autopilot yet: wait, or check the MAVLink streams".to_owned())
        }
    }
    if let Some(charge) = vehicle.battery.filter(|charge| *charge <= limits.battery) {
        list.push(format!(
            "battery at {:.0} %, more than {:.0} % is needed: charge or change it",
            charge * 100.0,
            limits.battery * 100.0
        ));
    }
    if vehicle.on_ground == Some(false) {
        list.push("the autopilot says that the vehicle is in the air: land it first".to_owned());
    }
    list
}

/// Whether parameter `name` was read and has a legal value.
pub fn parameter_ok(vehicle: &Vehicle, limits: &PreflightLimits, name: &str) -> bool {
    vehicle.params.get(name).is_some_and(|value| match name {
        OFFBOARD_LOSS => (0.0..=limits.offboard_loss).contains(value),
        OFFBOARD_ACTION => (value - HOLD).abs() < 1e-6,
        _ => true,
    })
}

fn parameters(vehicle: &Vehicle, limits: &PreflightLimits, list: &mut Vec<String>) {
    for name in [OFFBOARD_LOSS, OFFBOARD_ACTION] {
        if parameter_ok(vehicle, limits, name) {
            continue;
        }
        let Some(value) = vehicle.params.get(name) else {
            list.push(format!("{name} could not be read yet: wait, or check the MAVLink link"));
            continue;
        };
        list.push(if name == OFFBOARD_LOSS {
            let most = limits.offboard_loss;
            format!("{name} is {value} s, at most {most} s is legal: old rates would act too long; set it")
        } else {
            format!("{name} is {value}, 5 (hold) is legal: without setpoints it would not stay put; set it")
        });
    }
}

fn position(vehicle: &Vehicle, limits: &PreflightLimits, pad: Option<Vec3>, list: &mut Vec<String>) {
    let Some(pad) = pad else {
        list.push("no plan is committed: offer and commit one".to_owned());
        return;
    };
    let Some(local) = vehicle.local() else { return };
    let expected = vehicle.expected_local(pad);
    let away = (local - expected).xy().norm();
    if away > limits.horizontal {
        list.push(format!(
            "local position is {away:.2} m from where the pad is, {} m is legal: put the vehicle on its pad \
             and restart its estimator there",
            limits.horizontal
        ));
    }
    if local.z.abs() > limits.height {
        list.push(format!(
            "local height on the pad is {:.2} m, {} m is legal: restart the estimator on the pad",
            local.z, limits.height
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{VehicleMode, VehicleMsg};
    use fleet_core::types::Quat;

    const PAD: Vec3 = Vec3::new(1.0, 2.0, 0.1);

    fn ready() -> Vehicle {
        let mut vehicle = Vehicle::default();
        let mode = VehicleMode::Loiter;
        for message in [
            VehicleMsg::Heartbeat { armed: false, mode, system_status: 3 },
            VehicleMsg::Attitude { boot_ms: 0, q: Quat::identity(), w: Vec3::zeros() },
            VehicleMsg::LocalPosition { boot_ms: 0, p: Vec3::new(0.1, 0.0, 0.5), v: Vec3::zeros() },
            VehicleMsg::Param { name: OFFBOARD_LOSS.into(), value: 0.5 },
            VehicleMsg::Param { name: OFFBOARD_ACTION.into(), value: 5.0 },
            VehicleMsg::Battery { remaining: Some(0.9), voltage: None, prearm_ok: true },
            VehicleMsg::Landed { on_ground: true },
        ] {
            vehicle.take(Nanos(0), &message);
        }
        vehicle
    }

    fn check(vehicle: &Vehicle, now: Nanos) -> Vec<String> {
        failures(vehicle, &PreflightLimits::default(), Some(PAD), now)
    }

    #[test]
    fn a_ready_vehicle_passes() {
        assert_eq!(check(&ready(), Nanos(0)), Vec::<String>::new());
    }

    #[test]
    fn each_check_fails_alone_and_names_itself() {
        let local = |p: Vec3| VehicleMsg::LocalPosition { boot_ms: 0, p, v: Vec3::zeros() };
        let param = |name: &str, value| VehicleMsg::Param { name: name.into(), value };
        let battery =
            |charge, prearm_ok| VehicleMsg::Battery { remaining: Some(charge), voltage: None, prearm_ok };
        for (message, word) in [
            (local(Vec3::new(0.6, 0.0, 0.0)), "from where the pad is"),
            (local(Vec3::new(0.0, 0.0, -1.6)), "local height"),
            (param(OFFBOARD_LOSS, 1.0), OFFBOARD_LOSS),
            (param(OFFBOARD_ACTION, 0.0), OFFBOARD_ACTION),
            (battery(0.2, true), "battery"),
            (battery(0.9, false), "pre-arm"),
            (VehicleMsg::Landed { on_ground: false }, "in the air"),
        ] {
            let mut vehicle = ready();
            vehicle.take(Nanos(0), &message);
            let list = check(&vehicle, Nanos(0));
            assert!(list.len() == 1 && list[0].contains(word), "{word}: {list:?}");
        }
        let stale = check(&ready(), Nanos(101_000_000));
        assert!(stale.len() == 1 && stale[0].contains("ms old"), "{stale:?}");
        let planless = failures(&ready(), &PreflightLimits::default(), None, Nanos(0));
        assert!(planless.len() == 1 && planless[0].contains("no plan"), "{planless:?}");
    }

    #[test]
    fn nothing_known_fails_everything() {
        assert_eq!(failures(&Vehicle::default(), &PreflightLimits::default(), None, Nanos(0)).len(), 6);
    }
}
