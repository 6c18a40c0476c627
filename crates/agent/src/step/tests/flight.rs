//! Whole flights.

use super::rig::Rig;
use fleet_core::wire::{EventKind, Mode};

#[test]
fn flies_the_plan_from_pad_to_pad() {
    // The configured guess of hover thrust is 0.5; the vehicles differ.
    for hover in [0.3, 0.5, 0.65] {
        let mut rig = Rig::started(hover, 12.0);
        rig.run_until(Mode::Takeoff, 3.0);
        rig.run_until(Mode::Track, 11.0);
        rig.run_until(Mode::Land, 21.0);
        assert!(rig.worst < 0.1, "hover {hover}: deviation {}", rig.worst);
        rig.run_until(Mode::Idle, 15.0);
        assert!(!rig.body.armed);
        assert!((rig.body.p - rig.body.pad).norm() < 0.1);
        let landed = rig.events().filter(|e| e.kind == EventKind::Landed).count();
        assert_eq!((landed, rig.faults()), (1, Vec::new()));
        assert!((rig.agent.hover.hover_thrust() - hover).abs() < 0.05 * hover);
    }
}
