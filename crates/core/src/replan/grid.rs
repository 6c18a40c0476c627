//! Knot times of a local replan.

/// Length of a slot of mission time [s]: corridors are constant over one slot, and segments are no
/// longer (design.md, Replan). Slots are counted from mission time 0, not from the splice, so that
/// two drones that replan at the same time use the same bisecting planes.
pub const SLOT: f64 = 0.5;
/// Shortest segment next to a slot boundary [s]; a shorter one would need huge jerk for nothing.
const EDGE: f64 = 0.15;
/// Shortest replan [s]: three segments of 0.1 s, the fewest that leave two knots free.
pub const SHORTEST: f64 = 0.3;
/// Longest replan [s]; three topic periods of 5 s, doubled.
pub const LONGEST: f64 = 30.0;

/// Knot times from `start` to `end` [s], on slot boundaries where these are not too near the ends;
/// every segment lasts 0.1 to 0.5 s. `end - start` is at least [`SHORTEST`].
pub fn knot_times(start: f64, end: f64) -> Vec<f64> {
    let mut times = vec![start];
    let first = ((start + EDGE) / SLOT).ceil() as i64;
    let mut k = first;
    while k as f64 * SLOT <= end - EDGE {
        push_within_slot(&mut times, k as f64 * SLOT);
        k += 1;
    }
    push_within_slot(&mut times, end);
    if times.len() < 4 {
        let third = (end - start) / 3.0;
        times = vec![start, start + third, start + 2.0 * third, end];
    }
    times
}

/// Appends `t`, with a knot half-way when the step would be longer than a slot.
fn push_within_slot(times: &mut Vec<f64>, t: f64) {
    let last = times[times.len() - 1];
    if t - last > SLOT + 1e-9 {
        times.push(0.5 * (last + t));
    }
    times.push(t);
}

/// Indices of the slots that `[from, to]` overlaps.
pub fn slots(from: f64, to: f64) -> std::ops::Range<usize> {
    /// Rounding of a knot time against a slot boundary, in slots.
    const SAME: f64 = 1e-9;
    let first = (from / SLOT + SAME).floor().max(0.0) as usize;
    let last = (to / SLOT - SAME).ceil().max(1.0) as usize;
    first..last.max(first + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn segments_are_never_too_short_or_too_long(start in 0.0..100.0_f64, span in SHORTEST..LONGEST) {
            let times = knot_times(start, start + span);
            prop_assert_eq!(times[0], start);
            prop_assert_eq!(times[times.len() - 1], start + span);
            prop_assert!(times.len() >= 4);
            for w in times.windows(2) {
                prop_assert!((0.0999..=SLOT + 1e-9).contains(&(w[1] - w[0])), "{:?}", times);
            }
        }

        #[test]
        fn slots_cover_the_interval(start in 0.0..100.0_f64, span in 0.1..0.5_f64) {
            let range = slots(start, start + span);
            prop_assert!(range.start as f64 * SLOT <= start + 1e-6);
            prop_assert!(range.end as f64 * SLOT >= start + span - 1e-6);
            prop_assert!(range.len() <= 2);
        }
    }
}
