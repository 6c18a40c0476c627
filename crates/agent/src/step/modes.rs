//! The mode machine: one table, every pair of mode and trigger written out.
//!
//! Rules (safety.md, section 2.2): the more severe request wins; return, land and abort latch; only
//! hold and released are left by a command of lower severity, `resume`.

use fleet_core::wire::Mode;

/// What can change the mode: commands first, then what the agent notices itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// Command.
    Arm,
    /// Command.
    Start,
    /// Command.
    Hold,
    /// Command.
    Resume,
    /// Command.
    Return,
    /// Command.
    Land,
    /// Command.
    Abort,
    /// Command.
    Disarm,
    /// The autopilot armed on our request.
    Armed,
    /// The autopilot disarmed.
    Disarmed,
    /// Take-off is due and every peer agrees.
    Go,
    /// Take-off is due and something is missing.
    NoGo,
    /// Mission time 0, at the start of the plan, every peer in the air.
    AtStart,
    /// Mission time 0 and not so.
    NotAtStart,
    /// The deviation passed eta.
    Deviation,
    /// A local replan was committed.
    Spliced,
    /// No topic waypoint can be reached.
    Unsolvable,
    /// The plan's end.
    PlanEnd,
    /// The way home is flown.
    OverHome,
    /// No vehicle state for longer than can be bridged.
    StateLost,
    /// The position estimate jumped too far to go on.
    Jumped,
    /// The autopilot left offboard control although our stream was fresh.
    Taken,
}

/// Number of triggers, in the order of [`Trigger`].
pub const TRIGGERS: usize = 22;
/// Every trigger, in the order of the table's columns.
#[cfg(test)]
pub const ALL_TRIGGERS: [Trigger; TRIGGERS] = {
    use Trigger::{
        Abort, Arm, Armed, AtStart, Deviation, Disarm, Disarmed, Go, Hold, Jumped, Land, NoGo, NotAtStart,
        OverHome, PlanEnd, Resume, Return, Spliced, Start, StateLost, Taken, Unsolvable,
    };
    [
        Arm, Start, Hold, Resume, Return, Land, Abort, Disarm, Armed, Disarmed, Go, NoGo, AtStart,
        NotAtStart, Deviation, Spliced, Unsolvable, PlanEnd, OverHome, StateLost, Jumped, Taken,
    ]
};
/// Every mode, in the order of the table's rows.
#[cfg(test)]
pub const ALL_MODES: [Mode; 10] = [
    Mode::Idle,
    Mode::Armed,
    Mode::Takeoff,
    Mode::Track,
    Mode::Replan,
    Mode::Hold,
    Mode::Return,
    Mode::Land,
    Mode::Abort,
    Mode::Released,
];

/// What a trigger does in a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Change to this mode.
    To(Mode),
    /// Legal, the mode stays.
    Stay,
    /// A command is refused; anything else is without effect.
    No,
}

/// Row `mode`, column `trigger`.
#[rustfmt::skip]
const TABLE: [[Next; TRIGGERS]; 10] = {
    use Next::{No as X, Stay as S};
    const I: Next = Next::To(Mode::Idle);
    const M: Next = Next::To(Mode::Armed);
    const U: Next = Next::To(Mode::Takeoff);
    const T: Next = Next::To(Mode::Track);
    const P: Next = Next::To(Mode::Replan);
    const H: Next = Next::To(Mode::Hold);
    const R: Next = Next::To(Mode::Return);
    const L: Next = Next::To(Mode::Land);
    const A: Next = Next::To(Mode::Abort);
    const F: Next = Next::To(Mode::Released);
    [
    // Arm Start Hold Resume Return Land Abort Disarm | Armed Disarmed Go NoGo AtStart NotAtStart
    //                                                | Deviation Spliced Unsolvable PlanEnd OverHome StateLost Jumped Taken
    /* Idle     */ [S, S, X, X, X, X, S, S,   M, S, X, S, X, X,   X, X, X, X, X, X, X, X],
    /* Armed    */ [S, S, X, X, X, X, A, I,   S, I, U, I, X, X,   X, X, X, X, X, I, I, F],
    /* Takeoff  */ [X, X, H, X, R, L, A, X,   X, I, X, X, T, L,   X, X, X, X, X, L, L, F],
    /* Track    */ [X, X, H, S, R, L, A, X,   X, I, X, X, X, X,   P, X, X, L, X, L, L, F],
    /* Replan   */ [X, X, H, S, R, L, A, X,   X, I, X, X, X, X,   S, T, H, L, X, L, L, F],
    /* Hold     */ [X, X, S, S, R, L, A, X,   X, I, X, X, X, X,   X, T, S, X, X, L, L, F],
    /* Return   */ [X, X, X, X, S, L, A, X,   X, I, X, X, X, X,   X, X, X, X, L, L, L, F],
    /* Land     */ [X, X, X, X, X, S, A, X,   X, I, X, X, X, X,   X, X, X, X, X, S, S, F],
    /* Abort    */ [X, X, X, X, X, X, S, I,   X, S, X, X, X, X,   X, X, X, X, X, S, S, F],
    /* Released */ [X, X, X, H, X, X, X, X,   X, I, X, X, X, X,   X, X, X, X, X, X, X, S],
    ]
};

/// What `trigger` does in `mode`.
#[must_use]
pub fn next(mode: Mode, trigger: Trigger) -> Next {
    TABLE[row(mode)][trigger as usize]
}

/// Whether the vehicle flies by our setpoints in `mode` (it may still stand in take-off).
#[must_use]
pub fn flies(mode: Mode) -> bool {
    matches!(
        mode,
        Mode::Takeoff | Mode::Track | Mode::Replan | Mode::Hold | Mode::Return | Mode::Land | Mode::Abort
    )
}

fn row(mode: Mode) -> usize {
    match mode {
        Mode::Idle => 0,
        Mode::Armed => 1,
        Mode::Takeoff => 2,
        Mode::Track => 3,
        Mode::Replan => 4,
        Mode::Hold => 5,
        Mode::Return => 6,
        Mode::Land => 7,
        Mode::Abort => 8,
        Mode::Released => 9,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How severe a mode is (safety.md: none < hold < return < land < abort).
    fn severity(mode: Mode) -> u8 {
        match mode {
            Mode::Hold => 1,
            Mode::Return => 2,
            Mode::Land => 3,
            Mode::Abort => 4,
            _ => 0,
        }
    }

    #[test]
    fn rows_and_columns_are_in_order() {
        for (i, mode) in ALL_MODES.into_iter().enumerate() {
            assert_eq!(row(mode), i);
        }
        for (i, trigger) in ALL_TRIGGERS.into_iter().enumerate() {
            assert_eq!(trigger as usize, i);
        }
    }

    #[test]
    fn nothing_but_resume_or_the_ground_lowers_severity() {
        for mode in ALL_MODES {
            for trigger in ALL_TRIGGERS {
                let Next::To(to) = next(mode, trigger) else { continue };
                let leaves_by_right = matches!(
                    trigger,
                    Trigger::Disarmed | Trigger::Disarm | Trigger::Taken | Trigger::Spliced
                );
                if severity(to) < severity(mode) {
                    assert!(leaves_by_right, "{mode:?} {trigger:?} {to:?}");
                }
                assert_ne!(to, mode, "{mode:?} {trigger:?}: a change to itself is Stay");
            }
        }
    }

    #[test]
    fn severe_commands_are_taken_in_every_flying_mode_below_them() {
        for mode in ALL_MODES.into_iter().filter(|m| flies(*m)) {
            assert_ne!(next(mode, Trigger::Abort), Next::No);
            if severity(mode) <= 3 {
                assert_ne!(next(mode, Trigger::Land), Next::No);
            }
            if severity(mode) <= 2 {
                assert_ne!(next(mode, Trigger::Return), Next::No);
            }
            assert_eq!(next(mode, Trigger::Arm), Next::No);
            // Abort is left by disarm, which the agent refuses in the air.
            assert_eq!(next(mode, Trigger::Disarm) == Next::No, mode != Mode::Abort);
        }
    }

    #[test]
    fn every_mode_but_abort_ends_idle_when_disarmed() {
        for mode in ALL_MODES.into_iter().filter(|m| !matches!(m, Mode::Idle | Mode::Abort)) {
            assert_eq!(next(mode, Trigger::Disarmed), Next::To(Mode::Idle));
        }
        assert_eq!(next(Mode::Abort, Trigger::Disarmed), Next::Stay);
    }

    #[test]
    fn released_is_left_only_by_resume_or_on_the_ground() {
        for trigger in ALL_TRIGGERS {
            let expected = match trigger {
                Trigger::Resume => Next::To(Mode::Hold),
                Trigger::Disarmed => Next::To(Mode::Idle),
                Trigger::Taken => Next::Stay,
                _ => Next::No,
            };
            assert_eq!(next(Mode::Released, trigger), expected);
        }
    }

    #[test]
    fn a_mission_walks_through_the_table() {
        let walk = [
            (Trigger::Arm, Mode::Idle),
            (Trigger::Armed, Mode::Armed),
            (Trigger::Start, Mode::Armed),
            (Trigger::Go, Mode::Takeoff),
            (Trigger::AtStart, Mode::Track),
            (Trigger::Deviation, Mode::Replan),
            (Trigger::Spliced, Mode::Track),
            (Trigger::PlanEnd, Mode::Land),
            (Trigger::Disarmed, Mode::Idle),
        ];
        let mut mode = Mode::Idle;
        for (trigger, expected) in walk {
            match next(mode, trigger) {
                Next::To(to) => mode = to,
                Next::Stay => {}
                Next::No => panic!("{mode:?} {trigger:?}"),
            }
            assert_eq!(mode, expected);
        }
    }
}
