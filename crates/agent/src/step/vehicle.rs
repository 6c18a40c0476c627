//! What the autopilot has told: attitude, position, mode, parameters, and how old each of it is.

use crate::io::{Stream, VehicleMode, VehicleMsg};
use fleet_core::types::{Nanos, Quat, State, Vec3};
use nalgebra::UnitQuaternion;
use std::collections::BTreeMap;

/// A sample that is this far from where the last one was going is an estimator jump [m]; at 5.2 m/s
/// and 100 Hz a vehicle moves 0.05 m from one sample to the next.
const JUMP: f64 = 0.3;
/// Samples further apart than this say nothing about a jump [s].
const JUMP_GAP: f64 = 0.2;
/// A sample up to this much older than the newest was overtaken on the way and says nothing new [s];
/// one that is older still comes from an autopilot that has started again.
const OVERTAKEN: f64 = 1.0;
/// A position or speed beyond this is not believed [m, m/s].
const SANE: f64 = 1e5;

/// An estimator jump that has just been noticed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// How far [m].
    pub metres: f64,
}

/// Messages of one stream in the current second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Newest arrival.
    pub last: Option<Nanos>,
    /// Arrivals since the last look.
    pub count: u32,
}

/// The autopilot as this agent knows it. Positions are in the autopilot's own local frame; the
/// scenario frame is [`Vehicle::offset`] away.
#[derive(Clone, Debug, Default)]
pub struct Vehicle {
    attitude: Option<(Nanos, Quat, Vec3)>,
    position: Option<(Nanos, Vec3, Vec3)>,
    /// The autopilot's own time of that position [ms since its boot].
    position_boot: u32,
    /// Scenario position minus local position [m; ENU].
    pub offset: Vec3,
    /// Pad for which the horizontal offset was taken.
    zeroed_at: Option<Vec3>,
    /// Last HEARTBEAT.
    pub heartbeat: Option<Nanos>,
    /// Motors armed.
    pub armed: bool,
    /// Mode that acts.
    pub mode: Option<VehicleMode>,
    /// Parameters read.
    pub params: BTreeMap<String, f64>,
    /// Remaining battery, 0 to 1.
    pub battery: Option<f64>,
    /// Whether the autopilot's own checks pass; none before the first SYS_STATUS.
    pub prearm_ok: Option<bool>,
    /// On the ground, as the autopilot says; none before the first EXTENDED_SYS_STATE.
    pub on_ground: Option<bool>,
    /// Last refusal or text of the autopilot, for people.
    pub last_words: String,
    /// ODOMETRY's reset counter.
    pub reset_counter: Option<u8>,
    jumped_at: Option<Nanos>,
    flows: BTreeMap<u8, Flow>,
}

fn finite(v: &Vec3) -> bool {
    v.iter().all(|x| x.is_finite() && x.abs() < SANE)
}

impl Vehicle {
    /// Takes one message; a value that is not finite is dropped, so that it reads as a stale state.
    pub fn take(&mut self, now: Nanos, message: &VehicleMsg) -> Option<Jump> {
        match message {
            VehicleMsg::Heartbeat { armed, mode, .. } => {
                self.heartbeat = Some(now);
                self.armed = *armed;
                self.mode = Some(*mode);
            }
            VehicleMsg::Mode { actual, .. } => self.mode = Some(*actual),
            VehicleMsg::Attitude { q, w, .. } => {
                self.count(Stream::Attitude, now);
                let unit = (q.coords.norm() - 1.0).abs() < 1e-3;
                if unit && finite(w) {
                    self.attitude = Some((now, UnitQuaternion::new_normalize(q.into_inner()), *w));
                }
            }
            VehicleMsg::LocalPosition { boot_ms, p, v } => {
                self.count(Stream::LocalPosition, now);
                if finite(p) && finite(v) {
                    return self.take_position(now, *boot_ms, *p, *v);
                }
            }
            VehicleMsg::Odometry { reset_counter } => {
                self.count(Stream::Odometry, now);
                return self.take_reset(now, *reset_counter);
            }
            VehicleMsg::Origin { .. } => self.count(Stream::Origin, now),
            VehicleMsg::Ack { result, request } => {
                if *result != 0 {
                    self.last_words = format!("{request:?} refused with MAV_RESULT {result}");
                }
            }
            VehicleMsg::Param { name, value } => {
                if value.is_finite() {
                    self.params.insert(name.clone(), *value);
                }
            }
            VehicleMsg::Battery { remaining, prearm_ok, .. } => {
                self.count(Stream::Battery, now);
                self.battery = remaining.filter(|x| x.is_finite());
                self.prearm_ok = Some(*prearm_ok);
            }
            VehicleMsg::Landed { on_ground } => {
                self.count(Stream::Landed, now);
                self.on_ground = Some(*on_ground);
            }
            VehicleMsg::Text { text } => self.last_words.clone_from(text),
        }
        None
    }

    /// Between two samples the autopilot's own clock counts: after a stall of the link or of this
    /// process old samples arrive in one burst, and by their arrival all of them would be jumps.
    fn take_position(&mut self, now: Nanos, boot_ms: u32, p: Vec3, v: Vec3) -> Option<Jump> {
        let mut jump = None;
        if let Some((_, p0, v0)) = self.position {
            let dt = f64::from(boot_ms.wrapping_sub(self.position_boot).cast_signed()) * 1e-3;
            if (-OVERTAKEN..0.0).contains(&dt) {
                return None;
            }
            let expected = p0 + (v0 + v) * (0.5 * dt);
            let metres = (p - expected).norm();
            if (0.0..JUMP_GAP).contains(&dt) && metres > JUMP && self.armed {
                // The vehicle did not move: keep the scenario position where it was.
                self.offset -= p - expected;
                self.jumped_at = Some(now);
                jump = Some(Jump { metres });
            }
        }
        self.position = Some((now, p, v));
        self.position_boot = boot_ms;
        jump
    }

    /// A reset counter that rises without a visible jump is reported as one of zero length.
    fn take_reset(&mut self, now: Nanos, counter: u8) -> Option<Jump> {
        let changed = self.reset_counter.is_some_and(|old| old != counter);
        self.reset_counter = Some(counter);
        let seen = self.jumped_at.is_some_and(|at| now.since(at) < JUMP_GAP);
        (changed && !seen && self.armed).then_some(Jump { metres: 0.0 })
    }

    fn count(&mut self, stream: Stream, now: Nanos) {
        let flow = self.flows.entry(stream as u8).or_default();
        flow.last = Some(now);
        flow.count += 1;
    }

    /// Arrivals of `stream` since the last call, and the newest.
    pub fn drain(&mut self, stream: Stream) -> Flow {
        let flow = self.flows.entry(stream as u8).or_default();
        let seen = *flow;
        flow.count = 0;
        seen
    }

    /// Age of the older of attitude and position [s]; none when one was never seen.
    #[must_use]
    pub fn age(&self, now: Nanos) -> Option<f64> {
        Some(self.attitude_age(now)?.max(now.since(self.position.as_ref()?.0)))
    }

    /// Age of the attitude [s].
    #[must_use]
    pub fn attitude_age(&self, now: Nanos) -> Option<f64> {
        self.attitude.as_ref().map(|(at, ..)| now.since(*at))
    }

    /// Newest attitude, whatever its age.
    #[must_use]
    pub fn attitude(&self) -> Option<Quat> {
        self.attitude.as_ref().map(|(_, q, _)| *q)
    }

    /// Newest position in the autopilot's own frame [m; ENU].
    #[must_use]
    pub fn local(&self) -> Option<Vec3> {
        self.position.as_ref().map(|(_, p, _)| *p)
    }

    /// State in the scenario frame, carried forward to `now` over the age of the measurements.
    #[must_use]
    pub fn state(&self, now: Nanos) -> Option<State> {
        let (t_attitude, q, w) = self.attitude.as_ref()?;
        let (t_position, p, v) = self.position.as_ref()?;
        // Bridging is for the few milliseconds between a sample and a tick.
        let turn = now.since(*t_attitude).clamp(0.0, 0.1);
        let drift = now.since(*t_position).clamp(0.0, 0.1);
        Some(State {
            at: (*t_attitude).min(*t_position),
            p: p + self.offset + v * drift,
            v: *v,
            q: q * UnitQuaternion::from_scaled_axis(w * turn),
            w: *w,
        })
    }

    /// Ties the local frame to the surveyed pad: the vehicle stands on it now. After a flight only the
    /// height is taken again, because a landing may be some decimetres off the pad.
    pub fn zero_on_pad(&mut self, pad: Vec3) {
        let Some(local) = self.local() else { return };
        self.offset.z = pad.z - local.z;
        if self.zeroed_at != Some(pad) {
            self.offset.x = pad.x - local.x;
            self.offset.y = pad.y - local.y;
        }
    }

    /// Where the autopilot's local position is expected while the vehicle stands on `pad` [m; ENU]:
    /// at its own origin, or, after a flight from this pad, where the pad was then.
    #[must_use]
    pub fn expected_local(&self, pad: Vec3) -> Vec3 {
        if self.zeroed_at == Some(pad) { pad - self.offset } else { Vec3::zeros() }
    }

    /// The vehicle has left `pad`: from now on its horizontal offset stands.
    pub fn keep_offset_of(&mut self, pad: Vec3) {
        self.zeroed_at = Some(pad);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn position(boot_ms: u32, x: f64, vx: f64) -> VehicleMsg {
        VehicleMsg::LocalPosition { boot_ms, p: Vec3::new(x, 0.0, 1.0), v: Vec3::new(vx, 0.0, 0.0) }
    }

    fn level() -> VehicleMsg {
        VehicleMsg::Attitude { boot_ms: 0, q: Quat::identity(), w: Vec3::zeros() }
    }

    #[test]
    fn a_jump_is_absorbed_and_reported_once() {
        let mut vehicle = Vehicle { armed: true, ..Vehicle::default() };
        let at = |k: u64| Nanos(k * 10_000_000);
        vehicle.take(at(0), &level());
        vehicle.take(at(0), &position(0, 0.0, 1.0));
        assert_eq!(vehicle.take(at(1), &position(10, 0.01, 1.0)), None);
        let jump = vehicle.take(at(2), &position(20, 2.02, 1.0)).expect("a jump");
        assert!((jump.metres - 2.0).abs() < 1e-9);
        assert!((vehicle.state(at(2)).expect("state").p.x - 0.02).abs() < 1e-9);
        assert_eq!(vehicle.take(at(2), &VehicleMsg::Odometry { reset_counter: 0 }), None);
        assert_eq!(vehicle.take(at(3), &VehicleMsg::Odometry { reset_counter: 1 }), None);
        assert_eq!(vehicle.take(at(3), &position(30, 2.03, 1.0)), None);
        let later = vehicle.take(at(90), &VehicleMsg::Odometry { reset_counter: 2 });
        assert_eq!(later, Some(Jump { metres: 0.0 }));
    }

    #[test]
    fn a_burst_of_old_samples_after_a_stall_is_no_jump() {
        let mut vehicle = Vehicle { armed: true, ..Vehicle::default() };
        vehicle.take(Nanos(0), &level());
        vehicle.take(Nanos(0), &position(1000, 0.0, 5.0));
        // 150 ms of samples at 5 m/s arrive in one millisecond; the first is 140 ms old by then.
        for k in 1..=15_u32 {
            let now = Nanos(150_000_000 + u64::from(k) * 60_000);
            assert_eq!(vehicle.take(now, &position(1000 + 10 * k, 0.05 * f64::from(k), 5.0)), None, "{k}");
        }
        // One that was overtaken does not turn the position back.
        assert_eq!(vehicle.take(Nanos(151_000_000), &position(1100, 0.5, 5.0)), None);
        assert_eq!(vehicle.offset, Vec3::zeros());
        assert!((vehicle.local().expect("known").x - 0.75).abs() < 1e-12);
        // The autopilot's clock wraps after 49 days.
        let mut late = Vehicle { armed: true, ..Vehicle::default() };
        late.take(Nanos(0), &position(u32::MAX - 4, 0.0, 5.0));
        assert_eq!(late.take(Nanos(10_000_000), &position(5, 0.05, 5.0)), None);
        assert!(late.take(Nanos(20_000_000), &position(15, 1.1, 5.0)).is_some());
    }

    #[test]
    fn what_is_not_finite_reads_as_stale() {
        let mut vehicle = Vehicle::default();
        vehicle.take(Nanos(0), &level());
        vehicle.take(Nanos(0), &position(0, 0.0, 0.0));
        let now = Nanos(500_000_000);
        vehicle.take(now, &position(500, f64::NAN, 0.0));
        vehicle.take(now, &position(500, 0.0, f64::INFINITY));
        assert_eq!(vehicle.age(now), Some(0.5));
        assert_eq!(vehicle.state(now).expect("state").p.x, 0.0);
    }

    #[test]
    fn after_a_flight_only_height_is_zeroed_again() {
        let pad = Vec3::new(-5.0, -7.0, 0.2);
        let mut vehicle = Vehicle::default();
        vehicle.take(Nanos(0), &level());
        vehicle.take(Nanos(0), &position(0, 0.1, 0.0));
        vehicle.zero_on_pad(pad);
        assert!((vehicle.state(Nanos(0)).expect("state").p - pad).norm() < 1e-12);
        vehicle.keep_offset_of(pad);
        vehicle.take(Nanos(1), &position(10, 0.4, 0.0));
        vehicle.zero_on_pad(pad);
        let p = vehicle.state(Nanos(1)).expect("state").p;
        assert!((p - pad - Vec3::new(0.3, 0.0, 0.0)).norm() < 1e-12);
    }
}
