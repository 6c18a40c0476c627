//! What goes into and comes out of [`crate::Agent::step`]; the recorded inbox is a list of these.
//!
//! Vehicle messages are already in the world ENU and body FLU frames (the MAVLink file turns them),
//! but positions are still relative to the autopilot's own origin.

use fleet_core::types::{Quat, Reference, Setpoint, State, Vec3, wxyz};
use fleet_core::wire::{Mode, Status, Up};
use serde::{Deserialize, Serialize};

/// File name of the committed plan in [`Output::Persist`]: the bytes of the plan file, written before
/// the commit is acknowledged. The solver's worker and the `plan` query take the plan from here.
pub const PLAN_FILE: &str = "plan.cbor";
/// File name of the last offered plan in [`Output::Persist`], written before the offer is accepted.
pub const OFFER_FILE: &str = "offer.cbor";

/// Flight mode of the autopilot as far as the agent cares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VehicleMode {
    /// External setpoints act (PX4 OFFBOARD).
    Offboard,
    /// The autopilot lands by itself (PX4 AUTO/LAND).
    Land,
    /// The autopilot holds position (PX4 AUTO/LOITER).
    Loiter,
    /// Any other mode, as its MAVLink custom mode.
    Other(u32),
}

/// A command that the autopilot acknowledges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VehicleRequest {
    /// Arm or disarm.
    Arm,
    /// Change mode.
    Mode,
    /// Set a message interval.
    Interval,
    /// Request a message once.
    Message,
}

/// What the autopilot says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "msg", rename_all = "snake_case")]
pub enum VehicleMsg {
    /// HEARTBEAT.
    Heartbeat {
        /// Motors armed.
        armed: bool,
        /// Mode.
        mode: VehicleMode,
        /// MAV_STATE: 3 standby, 4 active, 5 failsafe.
        system_status: u8,
    },
    /// CURRENT_MODE: sent at once on each change.
    Mode {
        /// Mode that acts.
        actual: VehicleMode,
        /// Mode that was asked for.
        intended: VehicleMode,
    },
    /// ATTITUDE_QUATERNION.
    Attitude {
        /// Autopilot's boot clock [ms].
        boot_ms: u32,
        /// Body FLU to ENU.
        #[serde(with = "wxyz")]
        q: Quat,
        /// Body rates [rad/s; FLU].
        w: Vec3,
    },
    /// LOCAL_POSITION_NED, turned to ENU, relative to the autopilot's own origin.
    LocalPosition {
        /// Autopilot's boot clock [ms].
        boot_ms: u32,
        /// Position [m].
        p: Vec3,
        /// Velocity [m/s].
        v: Vec3,
    },
    /// ODOMETRY: only its reset counter is used.
    Odometry {
        /// Rises when the estimator jumps.
        reset_counter: u8,
    },
    /// GPS_GLOBAL_ORIGIN of the autopilot's local frame.
    Origin {
        /// Latitude [deg].
        latitude: f64,
        /// Longitude [deg].
        longitude: f64,
        /// Altitude above mean sea level [m].
        altitude: f64,
    },
    /// COMMAND_ACK.
    Ack {
        /// Which request; none when it was none of ours.
        request: Option<VehicleRequest>,
        /// MAV_RESULT, 0 accepted.
        result: u8,
    },
    /// PARAM_VALUE.
    Param {
        /// Name.
        name: String,
        /// Value.
        value: f64,
    },
    /// SYS_STATUS.
    Battery {
        /// Remaining, 0 to 1, when known.
        remaining: Option<f64>,
        /// Voltage [V], when known.
        voltage: Option<f64>,
        /// Whether the autopilot's own pre-arm checks pass.
        prearm_ok: bool,
    },
    /// EXTENDED_SYS_STATE.
    Landed {
        /// On the ground.
        on_ground: bool,
    },
    /// STATUSTEXT.
    Text {
        /// Its words.
        text: String,
    },
}

/// Streams that the agent asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stream {
    /// ATTITUDE_QUATERNION.
    Attitude,
    /// LOCAL_POSITION_NED.
    LocalPosition,
    /// ODOMETRY.
    Odometry,
    /// EXTENDED_SYS_STATE.
    Landed,
    /// SYS_STATUS.
    Battery,
    /// GPS_GLOBAL_ORIGIN.
    Origin,
}

/// What is sent to the autopilot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "cmd", rename_all = "snake_case")]
pub enum VehicleCmd {
    /// SET_ATTITUDE_TARGET with type mask 128.
    Rates(Setpoint),
    /// HEARTBEAT as onboard controller.
    Heartbeat,
    /// DO_SET_MODE.
    SetMode {
        /// Offboard, land or loiter.
        mode: VehicleMode,
    },
    /// COMPONENT_ARM_DISARM.
    Arm {
        /// Arm or disarm.
        arm: bool,
        /// With the magic number that stops motors in the air.
        force: bool,
    },
    /// SET_MESSAGE_INTERVAL.
    Interval {
        /// Which stream.
        stream: Stream,
        /// Period [us].
        period_us: u32,
    },
    /// REQUEST_MESSAGE.
    Request {
        /// Which message.
        stream: Stream,
    },
    /// PARAM_REQUEST_READ.
    ReadParam {
        /// Name.
        name: String,
    },
}

/// One message into [`crate::Agent::step`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "in", rename_all = "snake_case")]
pub enum Input {
    /// From the autopilot.
    Vehicle(VehicleMsg),
    /// Bytes of an envelope of [`fleet_core::wire::Down`], as received; decoded inside the step.
    Ground {
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// Bytes of a peer's envelope of [`Up`] (heartbeat or replan), as received.
    Peer {
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// A solver finished.
    Solved(crate::SolveResult),
    /// A file was written and flushed to disk (true), or could not be (false).
    Persisted {
        /// The request's number.
        id: u64,
        /// Whether it is on disk.
        ok: bool,
    },
}

/// What a control tick saw and did, for the log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    /// Mode.
    pub mode: Mode,
    /// Mission time [s] when a start is known.
    pub mission_time: Option<f64>,
    /// Newest vehicle state.
    pub state: Option<State>,
    /// Committed reference at this time.
    pub reference: Option<Reference>,
    /// Setpoint sent in this tick.
    pub setpoint: Option<Setpoint>,
    /// Distance between state and committed reference [m].
    pub deviation: Option<f64>,
    /// Estimated hover thrust, 0 to 1.
    pub hover_thrust: f64,
}

/// One message out of [`crate::Agent::step`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "out", rename_all = "snake_case")]
pub enum Output {
    /// To the autopilot.
    Vehicle(VehicleCmd),
    /// To Zenoh: the channel follows from the kind of message.
    Publish {
        /// CBOR of `Envelope<Up>`.
        bytes: Vec<u8>,
        /// The same message, for log and tests.
        message: Box<Up>,
    },
    /// Solve this off the control thread; the answer comes back as [`Input::Solved`].
    Solve(Box<crate::SolveRequest>),
    /// Write this to disk atomically; the answer comes back as [`Input::Persisted`].
    Persist {
        /// Number of the request.
        id: u64,
        /// File name without directory.
        name: String,
        /// Content.
        bytes: Vec<u8>,
    },
    /// What the `status` query answers from now on.
    Status(Status),
    /// State, reference and setpoint of this tick, for the log; one every 10 ms in every mode.
    Tick(Box<Tick>),
}
