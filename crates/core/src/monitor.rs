//! Deviation monitor: the event that triggers a local replan (paper section IV-C; design.md, Replan).
//!
//! Every `T_e` the Euclidean distance between the measured position and the reference of the same
//! mission time is compared with `eta`. Before that each sample is compared with the one before it: an
//! estimator that jumps moves the *measured* drone, not the drone, and must not be chased.
//!
//! Re-arming: an event is reported once. The next one needs the deviation to have been below
//! [`RELEASE`] `eta` at a check since, or a call of [`DeviationMonitor::rearm`] (a replan was
//! committed, so the deviation counts against a new reference, or one failed and may be tried again).

use crate::types::{Nanos, ReplanParams, State, Vec3};
use serde::{Deserialize, Serialize};

/// Share of eta below which the monitor arms itself again.
pub const RELEASE: f64 = 0.75;
/// Smallest unexplained step between two samples that is an estimator reset [m] (safety.md, row 16).
pub const RESET: f64 = 1.0;

/// What the monitor saw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "seen", rename_all = "snake_case")]
pub enum Observation {
    /// The estimator jumped by this much beyond what the velocity explains [m].
    EstimatorReset {
        /// How far [m].
        metres: f64,
    },
    /// The deviation passed eta.
    Deviation {
        /// How far [m].
        metres: f64,
    },
}

/// Watches one drone against its committed reference.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviationMonitor {
    period: f64,
    eta: f64,
    next_check: Option<Nanos>,
    last: Option<State>,
    resets: Option<u8>,
    armed: bool,
}

impl DeviationMonitor {
    /// A monitor with the plan's period `T_e` and threshold `eta`.
    #[must_use]
    pub fn new(params: &ReplanParams) -> Self {
        let (period, eta) = (params.t_e, params.eta);
        Self { period, eta, next_check: None, last: None, resets: None, armed: true }
    }

    /// Allows the next event at the next check.
    pub fn rearm(&mut self) {
        self.armed = true;
    }

    /// Forgets everything seen: the reference was not followed for a while.
    pub fn restart(&mut self) {
        (self.next_check, self.last, self.resets, self.armed) = (None, None, None, true);
    }

    /// Takes the newest state, the position of the committed reference at the *same* mission time as
    /// `state.at`, and the autopilot's reset counter when it sends one. May be called at any rate: a
    /// state that was seen before is skipped, resets are looked for in every new state, the deviation
    /// at most once per period.
    pub fn update(
        &mut self,
        state: &State,
        reference: &Vec3,
        reset_counter: Option<u8>,
    ) -> Option<Observation> {
        let counted = matches!((self.resets, reset_counter), (Some(a), Some(b)) if a != b);
        self.resets = reset_counter.or(self.resets);
        let previous = self.last;
        if previous.is_some_and(|last| state.at <= last.at) && !counted {
            return None;
        }
        self.last = Some(*state);
        if let Some(metres) = previous.map(|last| unexplained(&last, state))
            && (counted || metres > RESET)
        {
            // The deviation is judged from the next period on, against samples after the jump.
            self.next_check = Some(state.at.plus(self.period));
            return Some(Observation::EstimatorReset { metres });
        }
        if self.next_check.is_some_and(|due| state.at < due) {
            return None;
        }
        self.next_check = Some(self.due_after(state.at));
        self.compare((state.p - reference).norm())
    }

    /// The next point of the grid of periods after `now`; a late sample does not shift the grid.
    fn due_after(&self, now: Nanos) -> Nanos {
        let due = self.next_check.unwrap_or(now);
        let late = (now.since(due) / self.period).floor().max(0.0);
        due.plus((late + 1.0) * self.period)
    }

    fn compare(&mut self, metres: f64) -> Option<Observation> {
        if metres < RELEASE * self.eta {
            self.armed = true;
        }
        // A distance that is not a number is a broken state, not a small deviation; its owner checks
        // states for being finite, so this only keeps the comparison honest.
        let beyond = metres > self.eta;
        (beyond && std::mem::take(&mut self.armed)).then_some(Observation::Deviation { metres })
    }
}

/// Distance between the new position and where the mean of both velocities would have taken the
/// old one [m].
fn unexplained(last: &State, state: &State) -> f64 {
    let dt = state.at.since(last.at).max(0.0);
    (state.p - last.p - (last.v + state.v) * (0.5 * dt)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Quat;
    use proptest::prelude::*;

    const PARAMS: ReplanParams = ReplanParams { t_e: 0.1, t_g: 5.0, eta: 0.4, enabled: true };

    fn state(t: f64, x: f64, v: f64) -> State {
        let at = Nanos::from_seconds(t);
        State {
            at,
            p: Vec3::new(x, 0.0, 0.0),
            v: Vec3::new(v, 0.0, 0.0),
            q: Quat::identity(),
            w: Vec3::zeros(),
        }
    }

    /// Feeds deviations at 100 Hz along a reference that moves at 1 m/s.
    fn run(
        monitor: &mut DeviationMonitor,
        deviation: impl Fn(f64) -> f64,
        seconds: f64,
    ) -> Vec<(f64, Observation)> {
        let n = (seconds * 100.0).round() as u32;
        (0..n)
            .filter_map(|k| {
                let t = f64::from(k) * 0.01;
                let reference = Vec3::new(t, 0.0, 0.0);
                monitor.update(&state(t, t + deviation(t), 1.0), &reference, Some(0)).map(|o| (t, o))
            })
            .collect()
    }

    #[test]
    fn reports_a_deviation_once_within_one_period() {
        let mut monitor = DeviationMonitor::new(&PARAMS);
        let seen = run(&mut monitor, |t| 0.35 * t, 3.0);
        assert_eq!(seen.len(), 1);
        let (t, Observation::Deviation { metres }) = seen[0] else { panic!("{seen:?}") };
        assert!((0.4 / 0.35..=0.4 / 0.35 + 0.1 + 1e-9).contains(&t), "at {t}");
        assert!((metres - 0.35 * t).abs() < 1e-12);
    }

    #[test]
    fn arms_again_below_the_release_and_by_hand() {
        let wave = |t: f64| 0.3 + 0.2 * (2.0 * t).cos();
        let mut monitor = DeviationMonitor::new(&PARAMS);
        // Back to 0.1 m, below 0.3 m, once per period of pi seconds.
        assert_eq!(run(&mut monitor, wave, 9.0).len(), 3);
        let mut monitor = DeviationMonitor::new(&PARAMS);
        assert_eq!(run(&mut monitor, |t| 0.4 + 0.08 * (2.0 * t).cos(), 9.0).len(), 1);
        let still = state(20.0, 20.5, 1.0);
        assert_eq!(monitor.update(&still, &Vec3::new(20.0, 0.0, 0.0), Some(0)), None);
        monitor.rearm();
        let later = state(20.2, 20.7, 1.0);
        assert!(monitor.update(&later, &Vec3::new(20.2, 0.0, 0.0), Some(0)).is_some());
    }

    #[test]
    fn a_jump_of_the_estimator_is_no_deviation() {
        let mut monitor = DeviationMonitor::new(&PARAMS);
        let seen = run(&mut monitor, |t| if t < 1.0 { 0.0 } else { 1.5 }, 1.05);
        let [(t, Observation::EstimatorReset { metres })] = seen[..] else { panic!("{seen:?}") };
        assert!((t - 1.0).abs() < 1e-9 && (metres - 1.5).abs() < 1e-9);
    }

    #[test]
    fn a_reset_counter_reports_even_a_small_jump() {
        let mut monitor = DeviationMonitor::new(&PARAMS);
        assert_eq!(monitor.update(&state(0.0, 0.0, 0.0), &Vec3::zeros(), Some(3)), None);
        let seen = monitor.update(&state(0.01, 0.45, 0.0), &Vec3::zeros(), Some(4));
        assert!(
            matches!(seen, Some(Observation::EstimatorReset { metres }) if (metres - 0.45).abs() < 1e-12)
        );
        // After the jump the deviation is judged again, from the next period on.
        assert_eq!(monitor.update(&state(0.05, 0.45, 0.0), &Vec3::zeros(), Some(4)), None);
        let seen = monitor.update(&state(0.12, 0.45, 0.0), &Vec3::zeros(), Some(4));
        assert!(matches!(seen, Some(Observation::Deviation { .. })));
    }

    #[test]
    fn the_same_sample_twice_counts_once() {
        let mut monitor = DeviationMonitor::new(&PARAMS);
        let s = state(1.0, 0.0, 0.0);
        assert_eq!(monitor.update(&s, &Vec3::zeros(), None), None);
        monitor.rearm();
        assert_eq!(monitor.update(&s, &Vec3::new(9.0, 0.0, 0.0), None), None);
    }

    proptest! {
        #[test]
        fn fires_only_beyond_eta_and_never_twice_without_release(
            steps in prop::collection::vec(0.0..0.8_f64, 1..200)
        ) {
            let mut monitor = DeviationMonitor::new(&PARAMS);
            let mut released = true;
            for (k, d) in steps.iter().enumerate() {
                // One check per sample; a slow drift keeps steps below the reset threshold.
                let seen = monitor.update(&state(k as f64 * 0.1, *d, 0.0), &Vec3::zeros(), None);
                let fires = released && *d > PARAMS.eta;
                prop_assert_eq!(seen.is_some(), fires, "sample {}", k);
                released = (released || *d < RELEASE * PARAMS.eta) && !fires;
            }
        }
    }
}
