//! PX4's flight modes as far as the simulated autopilot flies them.

/// A flight mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightMode {
    /// Height by stick; without sticks it sinks.
    Altctl,
    /// Position by stick; without sticks it sinks on the spot.
    Posctl,
    /// External setpoints.
    Offboard,
    /// Attitude by stick; level without.
    Stabilized,
    /// Climb to `MIS_TAKEOFF_ALT`.
    Takeoff,
    /// Hold position.
    Loiter,
    /// Return to the take-off point and land.
    Rtl,
    /// Land here.
    Land,
}

impl FlightMode {
    /// Main and sub mode of PX4's `custom_mode`.
    #[must_use]
    pub fn main_sub(self) -> (u8, u8) {
        match self {
            Self::Altctl => (2, 0),
            Self::Posctl => (3, 0),
            Self::Takeoff => (4, 2),
            Self::Loiter => (4, 3),
            Self::Rtl => (4, 5),
            Self::Land => (4, 6),
            Self::Offboard => (6, 0),
            Self::Stabilized => (7, 0),
        }
    }

    /// The mode of a main and sub mode, if it is one that is flown here.
    #[must_use]
    pub fn from_main_sub(main: u8, sub: u8) -> Option<Self> {
        match (main, sub) {
            (2, _) => Some(Self::Altctl),
            (3, _) => Some(Self::Posctl),
            (4, 2) => Some(Self::Takeoff),
            (4, 3) => Some(Self::Loiter),
            (4, 5) => Some(Self::Rtl),
            (4, 6) => Some(Self::Land),
            (6, _) => Some(Self::Offboard),
            (7, _) => Some(Self::Stabilized),
            _ => None,
        }
    }

    /// `custom_mode` of HEARTBEAT.
    #[must_use]
    pub fn custom_mode(self) -> u32 {
        let (main, sub) = self.main_sub();
        u32::from(main) << 16 | u32::from(sub) << 24
    }

    /// Whether the mode needs sticks, which a simulated vehicle never has.
    #[must_use]
    pub fn needs_sticks(self) -> bool {
        matches!(self, Self::Altctl | Self::Posctl | Self::Stabilized)
    }

    /// Whether PX4 refuses to arm in it (`mode_req_prevent_arming`).
    #[must_use]
    pub fn prevents_arming(self) -> bool {
        matches!(self, Self::Rtl | Self::Land)
    }
}
