//! JSON Schemas of the logged messages.

use serde_json::{Value, json};

/// Every schema that a log may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SchemaName {
    /// `foxglove.PoseInFrame`, with velocity, rates, acceleration and mission time besides.
    Pose,
    /// `fleet.Setpoint`.
    Setpoint,
    /// `fleet.Mode`.
    Mode,
    /// `fleet.Replan`.
    Replan,
    /// `fleet.Event`.
    Event,
    /// `fleet.Mission`.
    Mission,
}

impl SchemaName {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Pose, Self::Setpoint, Self::Mode, Self::Replan, Self::Event, Self::Mission];

    /// The name that stands in the file.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Pose => "foxglove.PoseInFrame",
            Self::Setpoint => "fleet.Setpoint",
            Self::Mode => "fleet.Mode",
            Self::Replan => "fleet.Replan",
            Self::Event => "fleet.Event",
            Self::Mission => "fleet.Mission",
        }
    }

    /// The schema itself. `foxglove.PoseInFrame` follows the well-known schema of that name
    /// (docs.foxglove.dev, message schemas); additional properties are legal in it.
    #[must_use]
    pub fn json_schema(self) -> Value {
        let (description, required, properties) = match self {
            Self::Pose => pose(),
            Self::Setpoint => setpoint(),
            Self::Mode => mode(),
            Self::Replan => replan(),
            Self::Event => event(),
            Self::Mission => mission(),
        };
        json!({
            "title": self.as_str(),
            "description": description,
            "type": "object",
            "properties": properties,
            "required": required,
        })
    }
}

type Parts = (&'static str, &'static [&'static str], Value);

fn pose() -> Parts {
    let properties = json!({
        "timestamp": time(),
        "frame_id": {"type": "string", "description": "Always map: the scenario frame, ENU"},
        "pose": {
            "title": "foxglove.Pose",
            "type": "object",
            "properties": {
                "position": {
                    "title": "foxglove.Vector3",
                    "type": "object",
                    "properties": {
                        "x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"},
                    },
                },
                "orientation": {
                    "title": "foxglove.Quaternion",
                    "type": "object",
                    "properties": {
                        "x": {"type": "number"}, "y": {"type": "number"},
                        "z": {"type": "number"}, "w": {"type": "number"},
                    },
                },
            },
        },
        "v": vector("Velocity [m/s; ENU]"),
        "w": vector("Body rates [rad/s; FLU]"),
        "a": vector("Acceleration [m/s^2; ENU]"),
        "mission_time": mission_time(),
    });
    ("A timestamped pose of a vehicle's centre", &["timestamp", "frame_id", "pose"], properties)
}

fn setpoint() -> Parts {
    let properties = json!({
        "timestamp": time(),
        "rates": vector("Commanded body rates [rad/s; FLU]"),
        "thrust": {"type": "number", "description": "Collective thrust, 0 to 1"},
        "hover_thrust": {"type": "number", "description": "Estimated hover thrust, 0 to 1"},
        "deviation": {
            "type": ["number", "null"],
            "description": "Distance between state and committed reference [m]",
        },
        "mission_time": mission_time(),
    });
    ("What was sent to the autopilot", &["timestamp", "rates", "thrust", "hover_thrust"], properties)
}

fn mode() -> Parts {
    let properties = json!({
        "timestamp": time(),
        "mode": {"type": "string"},
        "cause": {"type": "string", "description": "Why it changed"},
        "mission_time": mission_time(),
    });
    ("A change of the agent's mode", &["timestamp", "mode", "cause"], properties)
}

fn replan() -> Parts {
    let properties = json!({
        "timestamp": time(),
        "notice": {"type": "object", "description": "The notice as it went to peers and ground"},
    });
    ("A local replan and how it ended", &["timestamp", "notice"], properties)
}

fn event() -> Parts {
    let properties = json!({
        "timestamp": time(),
        "drone": {"type": "string"},
        "event": {"type": "object", "description": "The event as it went to the ground"},
    });
    ("What happened, with its cause", &["timestamp", "drone", "event"], properties)
}

fn mission() -> Parts {
    let properties = json!({
        "timestamp": time(),
        "scenario": {"type": "string"},
        "hash": {"type": "string", "description": "SHA-256 of the plan file"},
        "seed": {"type": "integer"},
        "t0_ns": {"type": "integer", "description": "Log clock at mission time 0 [ns]"},
        "plan_cbor_base64": {"type": "string", "contentEncoding": "base64"},
    });
    let required = &["timestamp", "scenario", "hash", "seed", "t0_ns", "plan_cbor_base64"];
    ("The mission that was flown", required, properties)
}

fn time() -> Value {
    json!({
        "type": "object",
        "title": "time",
        "properties": {
            "sec": {"type": "integer", "minimum": 0},
            "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
        },
    })
}

fn vector(description: &str) -> Value {
    json!({
        "type": "array", "description": description,
        "items": {"type": "number"}, "minItems": 3, "maxItems": 3,
    })
}

fn mission_time() -> Value {
    json!({"type": ["number", "null"], "description": "Mission time [s], when a start is known"})
}
