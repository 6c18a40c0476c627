//! Collective thrust and body torques to the four motors of an X quadrotor, with saturation.

/// Motor positions along the body's left axis, as sign: front right, rear left, front left, rear
/// right (PX4 "Quadrotor x").
pub const LEFT: [f64; 4] = [-1.0, 1.0, 1.0, -1.0];
/// Motor positions along the body's forward axis, as sign.
pub const FORWARD: [f64; 4] = [1.0, -1.0, 1.0, -1.0];
/// Sign of the reaction torque about the body's up axis: motors 1 and 2 turn counter-clockwise.
pub const REACTION: [f64; 4] = [-1.0, -1.0, 1.0, 1.0];

/// Share of collective thrust that yaw may cost (PX4 `MINIMUM_YAW_MARGIN`).
const YAW_MARGIN: f64 = 0.15;

/// Motor commands and which torques could not be given in full.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mix {
    /// Thrust of each motor, 0 to 1.
    pub motors: [f64; 4],
    /// Whether the roll, pitch, yaw torque was cut.
    pub saturated: [bool; 3],
}

/// Mixes collective thrust (0 to 1) and torques (-1 to 1; FLU: roll right, nose down, turn left).
///
/// Roll and pitch come first, then thrust, then yaw, and thrust is never raised to make room for a
/// torque (PX4 `mixAirmodeDisabled`).
#[must_use]
pub fn mix(thrust: f64, torque: [f64; 3]) -> Mix {
    let tilt: [f64; 4] = std::array::from_fn(|i| {
        std::f64::consts::FRAC_1_SQRT_2 * (LEFT[i] * torque[0] - FORWARD[i] * torque[1])
    });
    // The X layout is symmetric: the least of the four is the negative of the greatest.
    let reach = tilt.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut level = thrust.clamp(0.0, 1.0);
    level = level.min((1.0 - reach).max(0.5));
    let room = level.min(1.0 - level);
    let scale = if reach > room { room / reach } else { 1.0 };

    let mut yaw = torque[2];
    let top = (0..4).fold(0.0_f64, |m, i| m.max(level + scale * tilt[i] + REACTION[i] * yaw));
    if top > 1.0 {
        let bottom = (0..4).fold(1.0_f64, |m, i| m.min(level + scale * tilt[i]));
        level -= (top - 1.0).min(YAW_MARGIN * level).min(bottom.max(0.0));
    }
    for i in 0..4 {
        let free = level + scale * tilt[i];
        if REACTION[i] * yaw > 1.0 - free {
            yaw = REACTION[i] * (1.0 - free).max(0.0);
        } else if REACTION[i] * yaw < -free {
            yaw = -REACTION[i] * free.max(0.0);
        }
    }
    let cut = scale < 1.0;
    Mix {
        motors: std::array::from_fn(|i| (level + scale * tilt[i] + REACTION[i] * yaw).clamp(0.0, 1.0)),
        saturated: [cut, cut, yaw != torque[2]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn torques(m: &Mix) -> ([f64; 3], f64) {
        let sum = |sign: &[f64; 4]| (0..4).map(|i| sign[i] * m.motors[i]).sum::<f64>();
        let root = std::f64::consts::SQRT_2;
        (
            [sum(&LEFT) / 4.0 * root, -sum(&FORWARD) / 4.0 * root, sum(&REACTION) / 4.0],
            m.motors.iter().sum::<f64>() / 4.0,
        )
    }

    proptest! {
        #[test]
        fn motors_stay_in_range_and_unsaturated_torques_are_exact(
            thrust in 0.0..1.0f64, roll in -1.0..1.0f64, pitch in -1.0..1.0f64, yaw in -1.0..1.0f64
        ) {
            let m = mix(thrust, [roll, pitch, yaw]);
            prop_assert!(m.motors.iter().all(|x| (0.0..=1.0).contains(x)));
            let (got, level) = torques(&m);
            prop_assert!(level <= thrust + 1e-12, "thrust was raised");
            for (axis, want) in [roll, pitch, yaw].into_iter().enumerate() {
                if m.saturated[axis] {
                    prop_assert!(got[axis].abs() <= want.abs() + 1e-9);
                    prop_assert!(got[axis] * want >= -1e-9, "a torque changed its sign");
                } else {
                    prop_assert!((got[axis] - want).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn no_thrust_gives_no_torque() {
        assert_eq!(mix(0.0, [0.5, -0.5, 0.5]).motors, [0.0; 4]);
    }
}
