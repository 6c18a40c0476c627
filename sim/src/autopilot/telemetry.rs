//! The messages that the autopilot sends about itself (NED, FRD).

use super::commander::Commander;
use super::frame;
use super::mode::FlightMode;
use super::streams::id;
use crate::plant::Truth;
use fleet_core::types::{Nanos, Vec3};
use mavlink::dialects::common::*;

/// What the messages are made from.
pub struct Snapshot<'a> {
    /// Own boot clock.
    pub boot: Nanos,
    /// Simulated time since launch.
    pub now: Nanos,
    /// System id.
    pub system: u8,
    /// The estimate; in this version the truth.
    pub truth: &'a Truth,
    /// Origin of the local frame [m; ENU].
    pub origin: &'a Vec3,
    /// Take-off point [m; ENU].
    pub home: &'a Vec3,
    /// Modes and arming.
    pub commander: &'a Commander,
    /// Whether setpoints are fresh.
    pub stream_fresh: bool,
    /// Last accepted rate setpoint [rad/s; FLU].
    pub rates: &'a Vec3,
}

/// Version that the vehicle claims: it behaves as PX4 1.15 (major, minor, patch, release type).
const VERSION: u32 = 1 << 24 | 15 << 16 | 4 << 8 | 255;

impl Snapshot<'_> {
    /// The message with this id; none when it is not offered.
    #[must_use]
    pub fn message(&self, message_id: u32) -> Option<MavMessage> {
        Some(match message_id {
            id::HEARTBEAT => self.heartbeat(),
            id::SYS_STATUS => self.sys_status(),
            id::SYSTEM_TIME => {
                MavMessage::SYSTEM_TIME(SYSTEM_TIME_DATA { time_unix_usec: 0, time_boot_ms: self.boot_ms() })
            }
            id::ATTITUDE => self.attitude(),
            id::ATTITUDE_QUATERNION => self.attitude_quaternion(),
            id::LOCAL_POSITION_NED => self.local_position(),
            id::GLOBAL_POSITION_INT => self.global_position(),
            id::GPS_GLOBAL_ORIGIN => self.global_origin(),
            id::ATTITUDE_TARGET => self.attitude_target(),
            id::TIMESYNC => {
                MavMessage::TIMESYNC(TIMESYNC_DATA { ts1: self.boot.0 as i64, ..TIMESYNC_DATA::DEFAULT })
            }
            id::HIL_STATE_QUATERNION => self.ground_truth(),
            id::BATTERY_STATUS => battery_status(),
            id::AUTOPILOT_VERSION => self.autopilot_version(),
            id::HOME_POSITION => self.home_position(),
            id::EXTENDED_SYS_STATE => self.extended_sys_state(),
            id::ODOMETRY => self.odometry(),
            id::CURRENT_MODE => MavMessage::CURRENT_MODE(CURRENT_MODE_DATA {
                custom_mode: self.commander.actual().custom_mode(),
                intended_custom_mode: self.commander.intended().custom_mode(),
                standard_mode: standard_mode(self.commander.actual()),
            }),
            _ => return None,
        })
    }

    fn boot_ms(&self) -> u32 {
        (self.boot.0 / 1_000_000) as u32
    }

    fn local(&self, p: &Vec3) -> Vec3 {
        frame::world(&(p - self.origin))
    }

    fn heartbeat(&self) -> MavMessage {
        let commander = self.commander;
        let mut base = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            | MavModeFlag::MAV_MODE_FLAG_STABILIZE_ENABLED
            | MavModeFlag::MAV_MODE_FLAG_GUIDED_ENABLED
            | MavModeFlag::MAV_MODE_FLAG_AUTO_ENABLED;
        if commander.armed() {
            base |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        let waiting = commander.intended() == FlightMode::Offboard && !self.stream_fresh;
        let system_status = match (commander.terminated(), commander.armed(), commander.failsafe()) {
            (true, _, _) => MavState::MAV_STATE_FLIGHT_TERMINATION,
            (_, true, true) => MavState::MAV_STATE_CRITICAL,
            (_, true, false) => MavState::MAV_STATE_ACTIVE,
            _ if waiting || !commander.ready(self.now) => MavState::MAV_STATE_UNINIT,
            _ => MavState::MAV_STATE_STANDBY,
        };
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: commander.actual().custom_mode(),
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode: base,
            system_status,
            mavlink_version: 3,
        })
    }

    fn sys_status(&self) -> MavMessage {
        let present = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_GYRO
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_MAG
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_GPS
            | MavSysStatusSensor::MAV_SYS_STATUS_AHRS
            | MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        let mut health = present;
        if !self.commander.ready(self.now) || self.commander.terminated() {
            health.remove(MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK);
            health.remove(MavSysStatusSensor::MAV_SYS_STATUS_AHRS);
        }
        MavMessage::SYS_STATUS(SYS_STATUS_DATA {
            onboard_control_sensors_present: present,
            onboard_control_sensors_enabled: present,
            onboard_control_sensors_health: health,
            // No battery is modelled yet: unknown, as the protocol writes it.
            voltage_battery: u16::MAX,
            current_battery: -1,
            battery_remaining: -1,
            onboard_control_sensors_present_extended: MavSysStatusSensorExtended::empty(),
            onboard_control_sensors_enabled_extended: MavSysStatusSensorExtended::empty(),
            onboard_control_sensors_health_extended: MavSysStatusSensorExtended::empty(),
            ..SYS_STATUS_DATA::DEFAULT
        })
    }

    fn attitude(&self) -> MavMessage {
        let (roll, pitch, yaw) = frame::attitude(&self.truth.q).euler_angles();
        let w = frame::body(&self.truth.w);
        MavMessage::ATTITUDE(ATTITUDE_DATA {
            time_boot_ms: self.boot_ms(),
            roll: roll as f32,
            pitch: pitch as f32,
            yaw: yaw as f32,
            rollspeed: w.x as f32,
            pitchspeed: w.y as f32,
            yawspeed: w.z as f32,
        })
    }

    fn attitude_quaternion(&self) -> MavMessage {
        let [q1, q2, q3, q4] = self.quaternion();
        let w = frame::body(&self.truth.w);
        MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA {
            time_boot_ms: self.boot_ms(),
            q1,
            q2,
            q3,
            q4,
            rollspeed: w.x as f32,
            pitchspeed: w.y as f32,
            yawspeed: w.z as f32,
            ..ATTITUDE_QUATERNION_DATA::DEFAULT
        })
    }

    fn quaternion(&self) -> [f32; 4] {
        let q = frame::attitude(&self.truth.q);
        [q.w as f32, q.i as f32, q.j as f32, q.k as f32]
    }

    fn local_position(&self) -> MavMessage {
        let p = self.local(&self.truth.p);
        let v = frame::world(&self.truth.v);
        MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA {
            time_boot_ms: self.boot_ms(),
            x: p.x as f32,
            y: p.y as f32,
            z: p.z as f32,
            vx: v.x as f32,
            vy: v.y as f32,
            vz: v.z as f32,
        })
    }

    fn global_position(&self) -> MavMessage {
        let (lat, lon, alt) = frame::geodetic(&self.truth.p);
        let v = frame::world(&self.truth.v) * 100.0;
        let yaw = frame::attitude(&self.truth.q).euler_angles().2.to_degrees();
        MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.boot_ms(),
            lat,
            lon,
            alt,
            relative_alt: ((self.truth.p.z - self.home.z) * 1e3).round() as i32,
            vx: v.x.round() as i16,
            vy: v.y.round() as i16,
            vz: v.z.round() as i16,
            hdg: (yaw.rem_euclid(360.0) * 100.0).round() as u16 % 36_000,
        })
    }

    fn global_origin(&self) -> MavMessage {
        let (latitude, longitude, altitude) = frame::geodetic(self.origin);
        MavMessage::GPS_GLOBAL_ORIGIN(GPS_GLOBAL_ORIGIN_DATA {
            latitude,
            longitude,
            altitude,
            time_usec: self.boot.0 / 1000,
        })
    }

    /// In pure rate mode PX4 echoes the accepted rates; attitude and thrust are stale.
    fn attitude_target(&self) -> MavMessage {
        let w = frame::body(self.rates);
        MavMessage::ATTITUDE_TARGET(ATTITUDE_TARGET_DATA {
            time_boot_ms: self.boot_ms(),
            q: [1.0, 0.0, 0.0, 0.0],
            body_roll_rate: w.x as f32,
            body_pitch_rate: w.y as f32,
            body_yaw_rate: w.z as f32,
            thrust: 0.0,
            type_mask: AttitudeTargetTypemask::empty(),
        })
    }

    fn ground_truth(&self) -> MavMessage {
        let (lat, lon, alt) = frame::geodetic(&self.truth.p);
        let v = frame::world(&self.truth.v) * 100.0;
        let w = frame::body(&self.truth.w);
        // Specific force in mg, as the message wants it.
        let f = frame::body(&self.truth.specific_force) / fleet_core::types::GRAVITY * 1e3;
        MavMessage::HIL_STATE_QUATERNION(HIL_STATE_QUATERNION_DATA {
            time_usec: self.boot.0 / 1000,
            attitude_quaternion: self.quaternion(),
            rollspeed: w.x as f32,
            pitchspeed: w.y as f32,
            yawspeed: w.z as f32,
            lat,
            lon,
            alt,
            vx: v.x.round() as i16,
            vy: v.y.round() as i16,
            vz: v.z.round() as i16,
            ind_airspeed: 0,
            true_airspeed: 0,
            xacc: f.x.round() as i16,
            yacc: f.y.round() as i16,
            zacc: f.z.round() as i16,
        })
    }

    fn autopilot_version(&self) -> MavMessage {
        let uid = u64::from_le_bytes([b'f', b'l', b'e', b'e', b't', 0, 0, self.system]);
        let mut uid2 = [0; 18];
        uid2[..8].copy_from_slice(&uid.to_le_bytes());
        MavMessage::AUTOPILOT_VERSION(AUTOPILOT_VERSION_DATA {
            capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_INT
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2,
            uid,
            flight_sw_version: VERSION,
            uid2,
            ..AUTOPILOT_VERSION_DATA::DEFAULT
        })
    }

    fn home_position(&self) -> MavMessage {
        let (latitude, longitude, altitude) = frame::geodetic(self.home);
        let p = self.local(self.home);
        MavMessage::HOME_POSITION(HOME_POSITION_DATA {
            latitude,
            longitude,
            altitude,
            x: p.x as f32,
            y: p.y as f32,
            z: p.z as f32,
            q: [1.0, 0.0, 0.0, 0.0],
            time_usec: self.boot.0 / 1000,
            ..HOME_POSITION_DATA::DEFAULT
        })
    }

    fn extended_sys_state(&self) -> MavMessage {
        let landed_state = match (self.commander.landed(), self.commander.actual()) {
            (true, _) => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            (false, FlightMode::Land) => MavLandedState::MAV_LANDED_STATE_LANDING,
            (false, FlightMode::Takeoff) => MavLandedState::MAV_LANDED_STATE_TAKEOFF,
            _ => MavLandedState::MAV_LANDED_STATE_IN_AIR,
        };
        MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
            vtol_state: MavVtolState::MAV_VTOL_STATE_UNDEFINED,
            landed_state,
        })
    }

    fn odometry(&self) -> MavMessage {
        let p = self.local(&self.truth.p);
        let v = frame::body(&(self.truth.q.inverse() * self.truth.v));
        let w = frame::body(&self.truth.w);
        // NaN first element: covariance unknown, as the protocol writes it.
        let mut unknown = [0.0; 21];
        unknown[0] = f32::NAN;
        MavMessage::ODOMETRY(ODOMETRY_DATA {
            time_usec: self.boot.0 / 1000,
            x: p.x as f32,
            y: p.y as f32,
            z: p.z as f32,
            q: self.quaternion(),
            vx: v.x as f32,
            vy: v.y as f32,
            vz: v.z as f32,
            rollspeed: w.x as f32,
            pitchspeed: w.y as f32,
            yawspeed: w.z as f32,
            pose_covariance: unknown,
            velocity_covariance: unknown,
            frame_id: MavFrame::MAV_FRAME_LOCAL_NED,
            child_frame_id: MavFrame::MAV_FRAME_BODY_FRD,
            reset_counter: 0,
            estimator_type: MavEstimatorType::MAV_ESTIMATOR_TYPE_AUTOPILOT,
            quality: 100,
        })
    }
}

/// No battery is modelled yet: every field says unknown.
fn battery_status() -> MavMessage {
    MavMessage::BATTERY_STATUS(BATTERY_STATUS_DATA {
        current_consumed: -1,
        energy_consumed: -1,
        temperature: i16::MAX,
        voltages: [u16::MAX; 10],
        current_battery: -1,
        battery_remaining: -1,
        fault_bitmask: MavBatteryFault::empty(),
        ..BATTERY_STATUS_DATA::DEFAULT
    })
}

fn standard_mode(mode: FlightMode) -> MavStandardMode {
    match mode {
        FlightMode::Posctl => MavStandardMode::MAV_STANDARD_MODE_POSITION_HOLD,
        FlightMode::Altctl => MavStandardMode::MAV_STANDARD_MODE_ALTITUDE_HOLD,
        FlightMode::Rtl => MavStandardMode::MAV_STANDARD_MODE_SAFE_RECOVERY,
        FlightMode::Land => MavStandardMode::MAV_STANDARD_MODE_LAND,
        FlightMode::Takeoff => MavStandardMode::MAV_STANDARD_MODE_TAKEOFF,
        _ => MavStandardMode::MAV_STANDARD_MODE_NON_STANDARD,
    }
}
